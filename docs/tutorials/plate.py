# %% [markdown]
# # A plate from gmsh
#
# Any outline can be a plate. Here gmsh meshes a square of 1 m with a clamped edge; a blade of your own differs in its
# points only. Two physical groups are what rotfem asks for: the curve `clamped` and the surface `plate`.

# %%
import tempfile
from pathlib import Path

import gmsh

import rotfem

mesh = Path(tempfile.mkdtemp()) / "square.msh"
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
points = [gmsh.model.geo.addPoint(x, y, 0.0, 0.1) for x, y in ((0, -0.5), (1, -0.5), (1, 0.5), (0, 0.5))]
lines = [gmsh.model.geo.addLine(a, b) for a, b in zip(points, [*points[1:], points[0]], strict=True)]
surface = gmsh.model.geo.addPlaneSurface([gmsh.model.geo.addCurveLoop(lines)])
gmsh.model.geo.synchronize()
gmsh.model.addPhysicalGroup(1, [lines[3]], name="clamped")
gmsh.model.addPhysicalGroup(1, [lines[1]], name="tip")
gmsh.model.addPhysicalGroup(2, [surface], name="plate")
gmsh.model.mesh.generate(2)
gmsh.write(str(mesh))
gmsh.finalize()

# %% [markdown]
# `meshes/` has scripts that make a cantilever blade, a trapezoidal one, a disk and a blade with a hole. Triangles have
# polynomials of degree 3 by default, which do not lock.

# %%
E, nu, rho, thickness = 70e9, 0.3, 2700.0, 0.01
scene = rotfem.Scene.from_dict(
    {
        "structure": {"type": "plate", "mesh": str(mesh), "thickness": thickness, "E": E, "nu": nu, "rho": rho},
        "motion": {"type": "constant", "speed": 0.0},
        "model": {"theory": "consistent_linear"},
        "modes": {"count": 4},
    }
)
modes = rotfem.modes(scene)
modes

# %%
modes.plot()

# %% [markdown]
# Spun about the axis across it, the plate becomes stiffer: the tension is solved for, on every outline.

# %%
spinning = rotfem.modes(scene.replace({"motion.speed": "600 rpm", "structure.hub_radius": 0.5}))
for still, spun, label in zip(modes.frequencies_hz, spinning.frequencies_hz, modes.labels, strict=True):
    print(f"{label:16s} {still:8.2f} Hz at rest, {spun:8.2f} Hz at 600 rpm")

# %% [markdown]
# ## Is it right?
#
# The square cantilever of Mindlin's theory with h/a = 0.01 and ν = 0.3 has ω a² √(ρh/D) = 3.46999; Kirchhoff's has
# 3.47100.

# %%
D = E * thickness**3 / (12 * (1 - nu**2))
first = modes.frequencies[0] * (rho * thickness / D) ** 0.5
print(f"{first:.5f}, known 3.46999")
assert abs(first / 3.46999 - 1) < 1e-3
