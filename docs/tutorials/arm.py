# %% [markdown]
# # A robot arm
#
# A motor turns an arm with a payload from the horizontal to the vertical. What torque must it have, and how long does
# the payload swing? The angle is prescribed, so the speed is a function of time, here with a smooth start and end.

# %%
import numpy as np

import rotfem

duration, angle = 1.0, np.pi / 2


def speed(t: float) -> float:
    """Speed (rad/s) of a cycloid: from rest to rest."""
    return angle / duration * (1 - np.cos(2 * np.pi * t / duration)) if 0 < t < duration else 0.0


E, width, height, rho, length, payload, g = 70e9, 0.03, 0.03, 2700.0, 1.2, 3.0, 9.81
section = {"shape": "rectangle", "width": width, "height": height, "E": E, "nu": 0.33, "rho": rho}
scene = rotfem.Scene.from_dict(
    {
        "structure": {"type": "planar_beam", "length": length, "tip_mass": payload, "section": section},
        "motion": {"type": "callable", "speed": speed},
        "loads": {"gravity": [0.0, -g]},
        "mesh": {"elements": 4},
        "time": {"end": 1.6, "step": 0.002},
    }
)
result = rotfem.run(scene)
result.plot()

# %% [markdown]
# A history starts in balance: at t = 0 the arm hangs through under its own weight and that of the payload. `root_m3` is
# the moment of the motor on the arm.

# %%
moment, u2 = result.column("root_m3"), result.tip["u2"]
print(f"the motor holds {moment[0]:.2f} N·m at first, and must have {moment.max():.2f} N·m")
after = result.t > duration
print(f"after the move the payload swings by {1e3 * np.ptp(u2[after]):.3f} mm")

# %% [markdown]
# A function is all that stands between this and other laws of motion. A slower move swings less:

# %%
slow = rotfem.run(scene.replace({"motion.speed": lambda t: speed(t / 2) / 2, "time.end": 2.6}))
print(f"twice as slow: {1e3 * np.ptp(slow.tip['u2'][slow.t > 2 * duration]):.3f} mm")

# %% [markdown]
# ## Is it right?
#
# The tables of any handbook have the deflection of the horizontal arm at rest: P L³/3EI + w L⁴/8EI. Shear adds a few
# parts in ten thousand.

# %%
EI, weight = E * width * height**3 / 12, rho * width * height * g
droop = payload * g * length**3 / (3 * EI) + weight * length**4 / (8 * EI)
print(f"{-1e3 * u2[0]:.4f} mm, handbook {1e3 * droop:.4f} mm")
assert abs(-u2[0] / droop - 1) < 1e-3
