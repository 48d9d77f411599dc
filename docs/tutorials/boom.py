# %% [markdown]
# # A satellite with a boom
#
# A satellite turns by a torque, and the boom on it bends and rings. Its hub is free: the angle is one more unknown, so
# the boom turns the satellite, too. This is a complete scene of `motion.type = "torque"`.

# %%
import numpy as np

import rotfem

scene = rotfem.Scene.from_dict(
    {
        "structure": {
            "type": "planar_beam",
            "length": "10 m",
            "hub_radius": "0.8 m",
            "tip_mass": "2 kg",
            "section": {
                "shape": "tube",
                "outer_radius": "20 mm",
                "wall": "1 mm",
                "E": "70 GPa",
                "nu": 0.33,
                "rho": 2700,
            },
            "damping": {"modal": [0.02]},
        },
        "motion": {"type": "torque", "hub_inertia": 400.0, "pulses": [[0, 4, 5.0], [4, 8, -5.0]]},
        "mesh": {"elements": 6},
        "time": {"end": 60.0, "step": 0.05},
    }
)
quick = rotfem.run(scene)
quick.plot()

# %% [markdown]
# The boom rings long after the torque is over. Its frequency is not that of a clamped boom: the lighter the satellite,
# the higher it is. `modes` has the satellite's inertia in it.

# %%
free = rotfem.modes(scene.replace({"modes.count": 2}))
ringing = next(f for f in free.frequencies if f > 0.01)
period = 2 * np.pi / ringing
print(f"{free.labels}: the boom rings with a period of {period:.3f} s")

# %% [markdown]
# A pulse that lasts one period leaves nothing of what it has excited. So both halves of the turn take one period each,
# and the torque is what gives the same angle.

# %%
torque = 5.0 * (4.0 / period) ** 2
shaped = rotfem.run(scene.replace({"motion.pulses": [[0, period, torque], [period, 2 * period, -torque]]}))
for name, result in (("4 s", quick), ("one period", shaped)):
    after = result.t > max(8.0, 2 * period)
    print(f"pulses of {name}: the tip swings by {1e3 * np.ptp(result.tip['u2'][after]):.2f} mm afterwards")

# %% [markdown]
# ## Is it right?
#
# Angular momentum is the impulse of the torque. Integrated once more: when the boom has come to rest, the angle is M
# T²/J with the inertia J of satellite, boom and tip mass together, whatever has happened in between.

# %%
rho_A = 2700 * np.pi * (0.020**2 - 0.019**2)
J = 400.0 + rho_A * ((0.8 + 10) ** 3 - 0.8**3) / 3 + 2.0 * (0.8 + 10) ** 2
angle, expected = shaped.column("psi")[-1], torque * period**2 / J
print(f"{np.degrees(angle):.4f}° turned, expected {np.degrees(expected):.4f}°")
assert abs(angle / expected - 1) < 1e-3
