"""Forms with functions set to zero: what vanishes is gone, what is left has the same value."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import ufl
from basix.ufl import element
from dolfinx import fem, mesh
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI

from rotfem.commands.problem import Problem
from rotfem.equations import model as model_module
from rotfem.equations.compiled import compile_system
from rotfem.numerics import forms
from rotfem.numerics.forms import SAME_PATTERN, Assembler, Functionals


@pytest.fixture(scope="module")
def space() -> Any:
    line = mesh.create_interval(MPI.COMM_SELF, 2, [0.0, 1.0])
    return fem.functionspace(line, element("Lagrange", line.basix_cell(), 1, shape=(2,)))


def test_what_is_left_has_the_value_at_zero(space: Any) -> None:
    """(1 + |u|²) w·v at u = 0, assembled, is w·v; of what vanishes with u nothing is left."""
    u, w, v = fem.Function(space), fem.Function(space), ufl.TestFunction(space)
    w.x.array[:] = np.arange(len(w.x.array))
    f = (1 + ufl.dot(u, u)) * ufl.inner(w, v) * ufl.dx
    found, exact = (fem.assemble_vector(forms.form(g)).array for g in (forms.without(f, u), ufl.inner(w, v) * ufl.dx))
    np.testing.assert_allclose(found, exact, rtol=1e-14)
    assert forms.without(ufl.inner(ufl.dot(u, u) * u, v) * ufl.dx, u).empty()


def test_derivatives_at_no_displacement_are_those_at_rest_without_it(space: Any) -> None:
    """Of a form with products of all three; that of ∂/∂v by (1 + q·a) v is ∫ w·δv, by q·v nothing is left."""
    q, v, a = (fem.Function(space) for _ in range(3))
    test = ufl.TestFunction(space)
    F = ufl.inner((1 + ufl.dot(q, a)) * v + ufl.dot(q, v) * a + (2 + ufl.dot(q, q)) * (q + a), test) * ufl.dx
    at_rest, whole = forms.at_rest(F, q, v, a), forms.at_rest(F, q, v, a, undeformed=True)
    assert whole["f"].empty()
    for kind in "KCM":
        assert whole[kind].signature() == forms.without(at_rest[kind], q).signature()


def test_branches_that_vanish_leave_no_conditional(space: Any) -> None:
    """The derivative of a rate like θ̇ f(θ), f of two branches, is a sum in which UFL misses the argument otherwise."""
    q, rate = fem.Function(space), fem.Function(space)
    v, du = ufl.TestFunction(space), ufl.TrialFunction(space)
    s = ufl.dot(q, q)
    factor = ufl.conditional(ufl.lt(s, 1.0), 1 - s, ufl.cos(s))
    moving = ufl.inner(ufl.derivative(factor * q, q, rate), v) * ufl.dx
    at_rest = forms.without(ufl.derivative(moving, q, du) + ufl.inner(du, v) * ufl.dx, rate)
    assert forms.form(at_rest).rank == 2


def test_matrices_of_one_pattern_are_those_that_petsc_adds_up(space: Any) -> None:
    """To the last bit, whatever the form; where a form has fewer couplings than the pattern its zeros are stored."""
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    c = forms.constant(space.mesh, np.float64(1.0))
    whole = forms.form(c * ufl.dot(u, v) * ufl.dx + ufl.inner(ufl.grad(u), ufl.grad(v)) * ufl.dx)
    part = forms.form(ufl.dot(u, v) * ufl.dx)
    assembled = Assembler(whole, [])
    for factor, form in ((1.0, whole), (3.0, whole), (3.0, part)):
        c.value[...] = factor
        exact = fem_petsc.assemble_matrix(form)
        exact.assemble()
        A = assembled(form)
        np.testing.assert_array_equal(A[:, :], exact[:, :])
        assert A.getInfo()["nz_used"] == assembled.pattern.getInfo()["nz_used"]
        A.axpy(-1.0, assembled(form), SAME_PATTERN)
        assert A.norm() == 0.0


def test_functionals_are_those_assembled_one_by_one(space: Any) -> None:
    """In the cells, at their ends, and of nothing in one pass; sums over three cells differ by round-off."""
    u = fem.Function(space)
    u.x.array[:] = np.random.default_rng(3).standard_normal(len(u.x.array))
    parts = {"square": ufl.dot(u, u) * ufl.dx, "ends": u[0] * u[1] * ufl.ds, "both": u[0] * ufl.dx + u[1] ** 3 * ufl.ds}
    found = Functionals(parts, space.mesh)()
    for name, form in parts.items():
        assert found[name] == pytest.approx(fem.assemble_scalar(fem.form(form)), rel=1e-13)
    assert Functionals({}, space.mesh)() == {}


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
def test_known_forms_are_those_made_anew(theory: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a tapered blade with a tip mass, gravity and damping: to the last digit on another mesh."""
    section = {"EA": 1e6, "GA2": 4e5, "GA3": 4e5, "GJ": 1e4, "EI2": 1e3, "EI3": [[0.0, 9e3], [2.0, 3e3]]}
    section |= {"polar_radius": 0.0, "mass_per_length": 1.0}
    structure = {"type": "spatial_beam", "length": 2.0, "section": section, "tip_mass": 0.5, "precone": 0.1}

    def matrices(elements: int, speed: float) -> list[Any]:
        tables = {
            "structure": structure | {"damping": {"kelvin_voigt": 1e-4}},
            "motion": {"type": "constant", "speed": speed, "axis": [0, 0, 1]},
            "loads": {"gravity": [0.0, 0.0, -9.81]},
            "model": {"theory": theory},
            "mesh": {"elements": elements},
        }
        system = compile_system(Problem.of(tables), moving=False)
        system.set_time(0.0)
        system.set_state(1e-3 * np.arange(len(system.zeros())))
        return [A.getValuesCSR()[2] for A in system.mass_damping_stiffness()] + [system.residual().array.copy()]

    monkeypatch.setattr(model_module, "_KNOWN", {})
    matrices(3, 5.0)
    assert len(model_module._KNOWN) == (2 if theory == "consistent_linear" else 1)  # the stress stiffness apart
    shared = matrices(5, 7.0)
    monkeypatch.setattr(model_module, "_KNOWN", {})
    for known, made in zip(shared, matrices(5, 7.0), strict=True):
        np.testing.assert_array_equal(known, made)


def test_a_large_flat_plate_has_no_entries_between_what_is_in_and_across_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """M, C and K are the same numbers; of 25 entries for each two nodes 4 in the plane and 9 across it stay.

    Coriolis forces about an axis in the plane couple one of both.
    """
    from rotfem.equations import pieces

    plate = {"type": "plate", "length": 1.0, "width": 1.0, "thickness": 0.01, "E": 7e10, "nu": 0.3, "rho": 2700.0}

    def matrices(axis: list[int]) -> list[Any]:
        motion = {"type": "constant", "speed": 77.0, "axis": axis}
        model = {"theory": "consistent_linear"}
        tables = {"structure": plate, "motion": motion, "model": model, "mesh": {"elements": [3, 2]}}
        system = compile_system(Problem.of(tables).spinning(), moving=False)
        system.set_time(0.0, system.motion.at_speed(77.0))
        return list(system.mass_damping_stiffness())

    for axis, part in (([0, 0, 1], 13 / 25), ([0, 1, 0], 15 / 25)):
        monkeypatch.undo()
        whole = matrices(axis)
        monkeypatch.setattr(pieces, "SMALL", 0)
        for A, B in zip(whole, matrices(axis), strict=True):
            assert B.getInfo()["nz_used"] == pytest.approx(part * A.getInfo()["nz_used"])
            entries = [X.convert("dense").getDenseArray() for X in (A, B)]
            np.testing.assert_allclose(*entries, rtol=1e-12, atol=1e-15 * np.max(entries))
