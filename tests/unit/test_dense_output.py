"""States between steps are on the polynomial that the ends ask for."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from rotfem.analysis.dense_output import between
from rotfem.analysis.schemes import State


def of_polynomial(p: np.polynomial.Polynomial, t: float) -> State:
    return State(
        t, np.array([p(t)]), np.array([p.deriv()(t)]), np.array([p.deriv(2)(t)]), hub_work=np.array([t, 2 * t, 0.0])
    )


@pytest.mark.parametrize(("order", "degree"), [(2, 3), (4, 5)])
def test_polynomials_are_met_exactly(order: int, degree: int) -> None:
    """Cubics by q and q̇, quintics by q, q̇ and q̈ (Hermite); of the next degree they are not."""
    rng = np.random.default_rng(1)
    for extra in (0, 1):
        p = np.polynomial.Polynomial(rng.uniform(0.5, 1.0, degree + 1 + extra))
        old, new, times = of_polynomial(p, 1.0), of_polynomial(p, 1.5), [1.1, 1.25, 1.4]
        for state in between(old, new, times, order, MPI.COMM_SELF):
            exact = of_polynomial(p, state.t)
            off = max(abs(float(x[0] - y[0])) for x, y in zip((state.q, state.v), (exact.q, exact.v), strict=True))
            assert (off < 1e-12) == (extra == 0)
            assert state.hub_work is not None
            assert state.hub_work[0] == pytest.approx(state.t)


def test_what_holds_linearly_at_the_ends_holds_between() -> None:
    """q₃ = q₁ + q₂, as shear is a difference of slopes, though the step resolves the accelerations of q₁ alone."""
    rng = np.random.default_rng(2)
    p = np.polynomial.Polynomial(rng.uniform(0.5, 1.0, 6))
    slow = [np.array([p.deriv(k)(t) for k in range(3)]) for t in (1.0, 1.5)]
    noise = [np.array([0.1, 0.0, 1e3]), np.array([0.2, 0.0, -1e3])]
    ends = [State(t, *np.array([a, b, a + b]).T) for t, a, b in zip((1.0, 1.5), slow, noise, strict=True)]
    for state in between(*ends, [1.1, 1.25, 1.4], 4, MPI.COMM_SELF):
        assert state.q[2] == pytest.approx(state.q[0] + state.q[1], rel=1e-12)
        assert 0.1 <= state.q[1] <= 0.2
