"""The ladder: settings in a row, steps and mesh of about the same error in each, and each some six times as exact.

Rung r has the tolerance 5e-2, 1e-2, 2e-3, … of adaptive steps, or fixed steps whose error falls in the same ratio by
the order of their scheme. Its mesh starts with the fewest cells. An element of degree k has an error of h^(k+1) in
displacements (Strang & Fix 1973, section 3.4). So of a beam, whose solution is smooth, a degree more is worth more than
cells half as long, and costs less: the degree is raised first. Of a plate it is not: strains are not smooth at the
corners of a clamp, and the matrices of 32 cells of degree 2 take an eighth of the time of 8 cells of degree 4, which
have as many nodes. Its cells are cut, in elements of the least degree that does not lock. Of a mesh file only the
degree can be raised.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from rotfem import registry
from rotfem.accuracy.answer import Elements, Setting
from rotfem.scene import Scene
from rotfem.scene.settings import estimates_error

#: Tolerances of the rungs.
TOLERANCES = (5e-2, 1e-2, 2e-3, 3e-4, 5e-5, 8e-6, 1.2e-6, 2e-7)

#: Number of elements and degree of a beam by rung.
BEAMS = ((2, 2), (2, 3), (2, 4), (3, 4), (4, 5), (6, 5), (8, 6), (12, 6))

#: Cells across the shorter edge of a plate by rung, of degree 2, or as triangles, one fewer, of degree 3; and the most
#: cells along the longer edge for each of them.
PLATES, LONG = (2, 3, 4, 6, 9, 13, 19, 28), 4

#: Degree by rung of a mesh file.
FILES = (2, 3, 4, 5, 6)

#: Steps of the first rung of a fixed-step scheme, in the time of a history.
FIRST_STEPS = 50


def ladder(scene: Scene, theory: str | None = None, scheme: str = "esdirk4", moving: bool = True) -> Iterator[Setting]:
    """Yield the settings of a scene, from the cheapest one on.

    Args:
        scene: validated.
        theory: name; that of the scene if None.
        scheme: of the steps, adaptive where it estimates its error.
        moving: whether a history is computed, if the scene has [time].
    """
    own = Setting.of(scene, moving)
    estimates = estimates_error(registry.schemes[scheme])
    for rung, tolerance in enumerate(TOLERANCES):
        mesh = mesh_of(scene, rung)
        if mesh is None:
            return
        elements, degree = mesh
        setting = Setting(theory or own.theory, elements, degree)
        if own.moving and scene.time is not None:
            finer = (TOLERANCES[0] / tolerance) ** (1.0 / registry.schemes[scheme].order)
            step = None if estimates else scene.time.end / round(FIRST_STEPS * finer)
            setting = replace(setting, scheme=scheme, tolerance=tolerance if estimates else None, step=step)
        yield setting


def mesh_of(scene: Scene, rung: int) -> tuple[Elements, int] | None:
    """Return the elements of a rung and their degree; None where there is no finer mesh."""
    if scene.structure.mesh_file is not None:
        return (None, FILES[rung]) if rung < len(FILES) else None
    structure: Any = scene.structure
    mesh: Any = scene.mesh
    if structure.type != "plate":
        return BEAMS[rung]
    triangles = mesh.cell == "triangle"
    return cells_of(structure.length / structure.width, PLATES[rung] - triangles), 2 + triangles


def cells_of(aspect: float, across: int) -> tuple[int, int]:
    """Return (nx, ny) of a rectangle of an aspect ratio with so many cells across its shorter edge."""
    along = across * min(round(max(aspect, 1 / aspect)), LONG)  # so that both are cut in one ratio
    return (along, across) if aspect >= 1.0 else (across, along)
