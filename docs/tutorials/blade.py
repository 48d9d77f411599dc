# %% [markdown]
# # A turbine blade
#
# From a table of sections to a Campbell diagram. The blade is 20 m long and tapers; its chord is along the direction of
# rotation. All that a beam needs of a section is how much it stretches, shears, bends, twists and weighs. A shape with
# a material says so here; [blades.md](../blades.md) has stiffnesses, 6×6 matrices, and files of OpenFAST, HAWC2 and
# windIO.

# %%
import numpy as np

import rotfem

E, rho, length = 30e9, 1900.0, 20.0
scene = rotfem.Scene.from_dict(
    {
        "structure": {
            "type": "spatial_beam",
            "length": length,
            "section": {
                "shape": "rectangle",
                "width": 1.0,
                "height": [[0.0, 0.2], [length, 0.1]],
                "E": E,
                "nu": 0.3,
                "rho": rho,
            },
        },
        "motion": {"type": "constant", "speed": "20 rpm"},
        "model": {"theory": "consistent_linear"},
        "modes": {"count": 5},
        "output": {"speed": "rpm", "frequency": "Hz"},
    }
)

# %% [markdown]
# ## Check the input
#
# `check` computes nothing but masses and centres, and draws what is there. Slips of units show here.

# %%
check = rotfem.check(scene)
print(f"{check.mass:.0f} kg, of a wedge {rho * 1.0 * 0.15 * length:.0f} kg")

# %% [markdown]
# ## Modes and Campbell diagram

# %%
modes = rotfem.modes(scene)
for label, frequency in zip(modes.labels, modes.frequencies_hz, strict=True):
    print(f"{label:12s} {frequency:8.4f} Hz")

# %% [markdown]
# Flapping, across the plane of rotation, is raised by the tension from the spin more than lagging, in it. Where a
# branch meets a line kΩ, what happens k times in a revolution is in resonance.

# %%
diagram = rotfem.campbell(scene, "0:30:7rpm", orders=3)
diagram.plot()

# %% [markdown]
# A blade is twisted, and its hub has a radius. `replace` makes variants, each validated anew:

# %%
real = scene.replace({"structure.pretwist": [[0.0, "13 deg"], [length, "0 deg"]], "structure.hub_radius": 1.5})
print(rotfem.modes(real).labels)

# %% [markdown]
# ## Is it right?
#
# Rayleigh's method takes ten lines: bending energy, tension energy and kinetic energy in polynomials that the clamp
# allows, x², x³, …. It shares nothing with finite elements.

# %%
x, w = np.polynomial.legendre.leggauss(40)
x, w = length * (x + 1) / 2, length * w / 2
height = 0.2 - 0.1 * x / length
m, EI = rho * height, E * height**3 / 12
omega = 20 * 2 * np.pi / 60
# Tension is the centrifugal force on all mass outside.
N = omega**2 * rho * (0.2 * (length**2 - x**2) / 2 - 0.1 / length * (length**3 - x**3) / 3)
powers = np.arange(2, 10)[:, None]
s = x / length
f, df, ddf = s**powers, powers * s ** (powers - 1) / length, powers * (powers - 1) * s ** (powers - 2) / length**2
K, M = (w * EI * ddf) @ ddf.T + (w * N * df) @ df.T, (w * m * f) @ f.T
flap = np.sqrt(np.linalg.eigvals(np.linalg.solve(M, K)).real.min())

computed = next(f for f, label in zip(modes.frequencies, modes.labels, strict=True) if label == "1st flapwise")
print(f"first flap {computed:.5f} rad/s, Rayleigh {flap:.5f} rad/s")
assert abs(computed / flap - 1) < 1e-3
