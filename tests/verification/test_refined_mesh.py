"""Equations on a refined mesh are those of twice the elements, and frequencies tell what the mesh puts off."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from basix.ufl import element
from dolfinx import fem, mesh
from mpi4py import MPI

import rotfem
from rotfem.equations.finer import FinerEquations
from rotfem.mechanics.loads import PointLoads
from rotfem.numerics.refinement import Refinement, refinement

SECTION = {"EA": 2.8e7, "GA": 1.0e7, "EI": 1.4e4, "mass_per_length": 1.2, "rotary_inertia": 6.0e-4}
PLATE = {"length": 1.0, "width": 0.5, "thickness": 0.01, "E": 70e9, "nu": 0.3, "rho": 2700.0}


def beam(elements: int, theory: str = "reissner", degree: int = 3, speed: float = 6.0) -> rotfem.Problem:
    """Return a spinning beam with a mass at its end, so that there are integrals over cells and at the tip."""
    return rotfem.Problem(
        structure=rotfem.PlanarBeam(length=10.0, section=SECTION, tip_mass=0.5),
        motion=rotfem.Motion.constant_speed(speed),
        mesh=rotfem.BeamMesh(elements=elements, degree=degree),
        theory=theory,
    )


@pytest.mark.parametrize(
    ("cell", "degree"), [(mesh.CellType.triangle, 3), (mesh.CellType.quadrilateral, 2), (mesh.CellType.interval, 3)]
)
def test_polynomials_are_carried_exactly(cell: Any, degree: int) -> None:
    """A polynomial of the degree of the space is the same one on parts of cells (round-off)."""
    line = cell == mesh.CellType.interval
    coarse = mesh.create_unit_interval(MPI.COMM_WORLD, 3) if line else None
    coarse = coarse or mesh.create_unit_square(MPI.COMM_WORLD, 2, 3, cell)
    V = fem.functionspace(coarse, element("Lagrange", coarse.basix_cell(), degree, shape=(2,)))

    def values(x: Any) -> Any:
        return np.array([(x[0] - 0.3 * x[1]) ** degree, 1.0 + x[0] * x[1]])

    f = fem.Function(V)
    f.interpolate(values)
    refined = Refinement(V)
    out = refined.function(f).x.array.reshape(-1, 2)
    np.testing.assert_allclose(out, values(refined.V.tabulate_dof_coordinates().T).T, atol=1e-13)
    cells = refined.mesh.topology.index_map(refined.mesh.topology.dim).size_global
    assert cells == (2 if line else 4) * V.mesh.topology.index_map(V.mesh.topology.dim).size_global


def test_a_refined_mesh_serves_another_space_on_the_same_cells() -> None:
    """A second mesh of the same cells takes the refined one of the first and carries the same; longer cells do not."""
    spaces = []
    for length in (1.0, 1.0, 1.5):
        line = mesh.create_interval(MPI.COMM_SELF, 3, [0.0, length])
        spaces.append(fem.functionspace(line, element("Lagrange", line.basix_cell(), 2, shape=(2,))))
    first, second, longer = (refinement(V) for V in spaces)
    assert second.V is first.V
    assert longer.V is not first.V
    f = fem.Function(spaces[1])
    f.interpolate(lambda x: np.array([x[0] ** 2, 1.0 - x[0]]))
    for refined in (second, Refinement(spaces[1])):
        out, x = refined.function(f).x.array.reshape(-1, 2), refined.V.tabulate_dof_coordinates()[:, 0]
        np.testing.assert_allclose(out, np.column_stack([x**2, 1.0 - x]), atol=1e-14)
    assert refinement(spaces[1]).function(f).function_space.mesh is first.mesh


def test_equations_are_those_of_twice_the_elements() -> None:
    """M, C, K and −F of a beam at a state in motion, from the forms of 3 elements and from those of 6 (round-off)."""
    systems = [beam(n).system() for n in (3, 6)]
    rng = np.random.default_rng(1)
    systems[0].set_time(0.0)
    systems[0].set_state(*(0.01 * rng.standard_normal(len(systems[0].zeros())) for _ in range(3)))
    fine, other = FinerEquations(systems[0]), systems[1]
    fine.take()
    places = [np.argsort(V.tabulate_dof_coordinates()[:, 0]) for V in (fine.V, other.V)]
    mine, theirs = ((3 * p[:, None] + np.arange(3)).ravel() for p in places)
    state = []
    for x in (fine.q, fine.v, fine.a):
        values = other.zeros()
        values[theirs] = x.x.array[mine]
        state.append(values)
    other.set_time(0.0)
    other.set_state(*state)
    for kind, shift in (("M", (0.0, 0.0, 1.0)), ("C", (0.0, 1.0, 0.0)), ("K", (1.0, 0.0, 0.0))):
        diagonal = float(kind == "K")
        A, B = fine.matrix(kind)[:, :], other.matrix(*shift, diagonal)[:, :]
        np.testing.assert_allclose(A[np.ix_(mine, mine)], B[np.ix_(theirs, theirs)], atol=1e-12 * np.abs(B).max())
    F, G = fine.imbalance().array, other.residual().array
    np.testing.assert_allclose(F[mine], G[theirs], atol=1e-12 * np.abs(G).max())


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_points_inside_of_parts_of_cells(cell: str) -> None:
    """Masses and a load where no corner is: of coarse shapes M and −F have the same products (round-off)."""
    bare = {"structure": rotfem.Plate(**PLATE), "mesh": rotfem.PlateMesh(elements=(2, 1), cell=cell)}
    heavy = rotfem.Plate(**PLATE, point_masses=[(0.9, 0.1, 3.0), (0.3, -0.07, 2.0)])
    load = rotfem.Loads(at=(PointLoads((0.83, 0.06), force=rotfem.ConstantLoad((0.0, 0.0, 5.0))),))
    common = {"motion": rotfem.Motion.constant_speed(3.0), "theory": "consistent_linear"}
    masses = []
    for problem in (
        rotfem.Problem(**{**bare, **common}),
        rotfem.Problem(**{**bare, "structure": heavy, "loads": load, **common}),
    ):
        system = problem.system()
        system.set_time(0.0)
        system.set_state(system.zeros())
        fine = FinerEquations(system)
        fine.take()
        X = np.random.default_rng(1).standard_normal((len(system.zeros()), 3))
        X[system.clamped] = 0.0
        Y = fine.carried(X)
        here, there = (x.T @ A[:, :] @ x for x, A in ((X, system.matrix(0.0, 0.0, 1.0, 0.0)), (Y, fine.matrix("M"))))
        np.testing.assert_allclose(there, here, atol=1e-12 * np.abs(here).max())
        f, g = X.T @ system.residual().array, Y.T @ fine.imbalance().array
        np.testing.assert_allclose(g, f, atol=1e-12 * np.abs(f).max())
        masses.append(here)
    assert np.linalg.norm(masses[1]) > 1.1 * np.linalg.norm(masses[0])  # the points are felt
