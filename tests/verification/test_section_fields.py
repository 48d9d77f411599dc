"""Tables with more rows than the mesh has elements: projected properties, and what they make of mass and frequencies.

Only definitions and limits are asserted: the projection's orthogonality, its conservation of mass and first moment,
and that frequencies go to those of the mesh that follows all rows.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI
from numpy.polynomial import legendre

import rotfem
from rotfem.commands.advice import advise
from rotfem.commands.problem import Problem
from rotfem.equations.model import Model
from rotfem.scene import Scene
from rotfem.structures.section_fields import not_negative
from tests.beams import STRUCTURE
from tests.plate_mesh_files import grid, write_msh

pytestmark = pytest.mark.estimated

LENGTH, ROWS = 10.0, 41
X = np.linspace(0.0, LENGTH, ROWS) + np.sin(np.arange(ROWS) * np.pi / (ROWS - 1)) * np.sin(7.0 * np.arange(ROWS)) * 0.05


def rough(mean: float) -> list[list[float]]:
    """Return rows of a property that falls along the span and changes by a fifth from row to row."""
    return [[x, mean * (1.0 - 0.06 * x) * (1.0 + 0.2 * np.sin(37.0 * i))] for i, x in enumerate(X.tolist())]


def scene(elements: int, section: dict[str, Any] | None = None, **more: Any) -> Scene:
    given = STRUCTURE["section"]
    rows = section or {key: rough(given[key]) for key in ("EA", "EI", "mass_per_length")}
    return Scene.from_dict(
        {
            "structure": {**STRUCTURE, "length": LENGTH, "section": {**given, **rows}},
            "motion": {"type": "constant", "speed": 3.0},
            "model": {"theory": "consistent_linear"},
            "mesh": {"elements": elements},
            "modes": {"count": 3},
            **more,
        }
    )


def test_places_that_only_typing_keeps_apart_are_one_node() -> None:
    """A row at x = 3.3333333 and a load that ends at 10/3: a short element between them made 2e-4 of round-off."""
    x, found = LENGTH / 3, []
    for row in (x, round(x, 7)):
        loads = {"distributed": {"over_span": [[0.0, 0.0, 10.0], [x, 0.0, 10.0], [x, 0.0, 0.0], [LENGTH, 0.0, 0.0]]}}
        section = {"EI": [[0.0, 1.4e4], [row, 1.4e4], [LENGTH, 2.0e4]]}
        still = {"type": "constant", "speed": 0.0}
        found.append(rotfem.run(scene(8, section, loads=loads, motion=still)).tip["u2"][-1])
    assert found[1] == pytest.approx(found[0], rel=1e-6)


def frequencies(elements: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest frequencies (rad/s), and what is said of their error by the mesh."""
    rows = rotfem.modes(scene(elements), hint=None).rows[:3]
    return np.array([row["frequency"] for row in rows]), np.array([row["mesh_error"] for row in rows])


def beam(case: Scene) -> Any:
    return Model(Problem.of(case), MPI.COMM_SELF).structure


def polynomials(f: fem.Function) -> list[tuple[float, float, np.ndarray]]:
    """Return ends of the elements and Legendre coefficients of a scalar discontinuous field on each."""
    space, found = f.function_space, []
    x = space.tabulate_dof_coordinates()[:, 0]
    for dofs in space.dofmap.list:
        a, b = x[dofs].min(), x[dofs].max()
        xi = 2.0 * (x[dofs] - a) / (b - a) - 1.0
        found.append((a, b, np.linalg.solve(legendre.legvander(xi, len(dofs) - 1), f.x.array[dofs])))
    return found


def moments(rows: np.ndarray, a: float, b: float, most: int) -> np.ndarray:
    """Return ∫ c P_n dx, n ≤ most, of a table on [a, b] by a rule of Gauss from row to row."""
    xi, w = legendre.leggauss(8)
    cuts = np.array([a, *(x for x in rows[:, 0] if a < x < b), b])
    half = np.diff(cuts)[:, None] / 2
    x = (cuts[:-1, None] + half * (1.0 + xi)).ravel()
    values = np.interp(x, *rows.T) * (half * w).ravel()
    return legendre.legvander(2.0 * (x - a) / (b - a) - 1.0, most).T @ values


def test_mass_and_first_moment_are_those_of_the_table() -> None:
    rows = np.array(rough(STRUCTURE["section"]["mass_per_length"]))
    mass, about_middle = moments(rows, 0.0, LENGTH, 1)
    found = rotfem.check(scene(3))
    assert found.mass == pytest.approx(mass, rel=1e-12)
    assert found.center_of_mass[0] == pytest.approx(LENGTH / 2 * (1 + about_middle / mass), rel=1e-12)


def test_frequencies_go_to_those_of_the_mesh_that_follows_all_rows() -> None:
    """By 4 and more for twice the elements; and what is said of the error holds what projection does."""
    exact, _ = frequencies(2 * (ROWS - 1))
    off, said = zip(
        *((np.abs(found / exact - 1.0), error) for found, error in map(frequencies, (5, 10, 20))), strict=True
    )
    for coarse, fine in pairwise(off):
        assert np.max(fine) < np.max(coarse) / 4.0
    for true, error in zip(off, said, strict=True):
        assert 0.3 < np.max(error) / np.max(true) < 64.0
    assert np.max(np.abs(frequencies(ROWS - 1)[0] / exact - 1.0)) < 1e-6


def test_a_property_that_falls_by_orders_within_an_element_stays_positive() -> None:
    """EI falls by 1e6 over 0.02 m: the projection would be negative, so its mean is taken, which is exact for ∫ EI."""
    rows = [[0.0, 1e6], [3.0, 1e6], [3.02, 1.0], [5.0, 1.0], [7.0, 1.0], [LENGTH, 1.0]]
    for a, b, c in polynomials(beam(scene(2, {"EI": rows})).section["EI"]):
        assert not_negative(legendre.legval(np.linspace(-1.0, 1.0, 50), c))
        assert c[0] * (b - a) == pytest.approx(moments(np.array(rows), a, b, 0)[0], rel=1e-12)


def test_masses_are_nodes_and_a_hint_says_so_where_they_ask_for_more_elements() -> None:
    masses = [{"x": x, "mass": 0.1} for x in (2.0, 4.0, 6.0)]
    structure = {**STRUCTURE, "length": LENGTH, "masses": masses}
    case = scene(2).replace({"structure": structure})
    assert advise(case, list[str]().append)[0].startswith("point masses and kinks at 3 places")
    ends = np.unique(beam(case).mesh.geometry.x[:, 0])
    np.testing.assert_allclose(ends, [0.0, 2.0, 4.0, 6.0, LENGTH], atol=1e-12)


# --- cells of a mesh file -------------------------------------------------------------------------------------------

PLATE = {"type": "plate", "E": 70e9, "nu": 0.3, "rho": 2700.0}


def plate(path: Path, cells: int, corners: int = 4, thickness: Any = 0.01, **loads: Any) -> dict[str, Any]:
    """Return a plate of 1 × 0.2 m on a mesh file of two cells across, or of halves of these, at rest."""
    points, groups = grid(cells, 2, 1.0, 0.2)
    if corners == 3:
        groups["plate"] = [half for a, b, c, d in groups["plate"] for half in ([a, b, c], [a, c, d])]
    structure = PLATE | {"mesh": str(write_msh(path / "plate.msh", points, groups)), "thickness": thickness}
    motion = {"type": "constant", "speed": 0.0}
    return {"structure": structure, "motion": motion, "model": {"theory": "linear"}, "loads": loads}


@pytest.mark.parametrize("corners", [3, 4])
def test_a_load_between_the_corners_of_a_mesh_file_has_its_force_and_moment(corners: int, tmp_path: Path) -> None:
    """0.08 N around x = 0.54 within one of four cells; a beam has 8e-6 m, and the error is not said to be nothing."""
    found = rotfem.run(plate(tmp_path, 4, corners, pressure={"over_span": [[0.52, 10.0], [0.56, 10.0]]}))
    assert found.history["root_f3"][-1] == pytest.approx(-0.08, rel=1e-6)
    assert found.history["root_m2"][-1] == pytest.approx(0.08 * 0.54, rel=1e-6)
    assert found.tip["u3"][-1] == pytest.approx(7.985e-6, rel=0.01)  # that of 40 × 4 cells with rows for mesh lines
    assert found.summary["error"]["space"] > 1e-4


def test_triangles_of_a_mesh_file_are_refined_to_an_accuracy(tmp_path: Path) -> None:
    """Without a degree they begin with the one that does not lock, and go on to higher ones."""
    load = {"over_span": [[0.52, 10.0], [0.56, 10.0]]}
    found = rotfem.run(plate(tmp_path, 4, 3, pressure=load) | {"accuracy": 2e-3})
    assert found.summary["accuracy"]["met"]
    assert found.tip["u3"][-1] == pytest.approx(7.985e-6, rel=4e-3)


def test_a_step_of_thickness_within_cells_of_a_mesh_file_is_in_mass_and_error(tmp_path: Path) -> None:
    """Mass and first moment are those of the table. The tip of 40 × 4 cells with a line there moves by 5.7368e-5 m."""
    rows = [[0.0, 0.02], [0.55, 0.02], [0.5501, 0.01], [1.0, 0.01]]
    case = plate(tmp_path, 8, thickness={"over": "x", "table": rows}, tip_force=[0.0, 0.0, 1.0])
    body, x = rotfem.check(case), np.array([r[0] for r in rows])
    h, dx = np.array([r[1] for r in rows]), np.diff(x)
    first = np.sum(dx * (h[:-1] * (2 * x[:-1] + x[1:]) + h[1:] * (x[:-1] + 2 * x[1:])) / 6)
    assert body.mass == pytest.approx(2700 * 0.2 * np.trapezoid(h, x), rel=1e-10)
    assert body.summary["first_moment_root"][0] == pytest.approx(2700 * 0.2 * first, rel=1e-10)
    found = rotfem.run(case)
    off = abs(found.tip["u3"][-1] / 5.7368e-5 - 1.0)
    assert off < 0.04
    assert found.summary["error"]["space"] > off / 2
