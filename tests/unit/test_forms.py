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

from rotfem.numerics import forms
from rotfem.numerics.forms import SAME_PATTERN, Assembler


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
