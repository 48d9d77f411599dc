"""Schemes: parameters, their identities, spectral radius and order on one linear oscillator, stages and update maps."""

from __future__ import annotations

import numpy as np
import pytest

from rotfem.analysis.schemes import AlphaFamily, GeneralisedAlpha, Newmark, State

RADII = (0.0, 0.3, 0.5, 0.8, 0.9, 1.0)
SCHEMES = [*map(GeneralisedAlpha, RADII), Newmark(), Newmark(0.3025, 0.6)]


def amplification(scheme: AlphaFamily, omega_h: float) -> np.ndarray:
    """Return the matrix that carries (q, h v, h² a) over one step of q̈ + ω²q = 0, written out from the definitions."""
    w2, (alpha_m, alpha_f, beta, gamma) = omega_h**2, scheme.coefficients
    # unknowns (q, v, a) at n + 1, with q̈ = −w2 q at both ends:
    # (1 − alpha_m) a1 + alpha_m a0 = −w2 [(1 − alpha_f) q1 + alpha_f q0]
    left = np.array([[1, 0, -beta], [0, 1, -gamma], [w2 * (1 - alpha_f), 0, 1 - alpha_m]])
    right = np.array([[1, 1, 0.5 - beta], [0, 1, 1 - gamma], [-w2 * alpha_f, 0, -alpha_m]])
    return np.linalg.solve(left, right)


@pytest.mark.parametrize("rho", RADII)
def test_generalised_alpha(rho: float) -> None:
    """Second order needs gamma = ½ + alpha_f − alpha_m, unconditional stability beta = ¼(1 + alpha_f − alpha_m)²."""
    alpha_m, alpha_f, beta, gamma = GeneralisedAlpha(rho).coefficients
    assert gamma == pytest.approx(0.5 + alpha_f - alpha_m, abs=1e-15)
    assert beta == pytest.approx((1 + alpha_f - alpha_m) ** 2 / 4, abs=1e-15)
    assert alpha_m <= alpha_f <= 0.5


@pytest.mark.parametrize("rho", RADII)
def test_spectral_radius(rho: float) -> None:
    """rho_inf at infinite frequency (three equal values, so a root of round-off), at most 1 at every frequency."""
    s = GeneralisedAlpha(rho)
    assert max(abs(np.linalg.eigvals(amplification(s, 1e6)))) == pytest.approx(rho, abs=1e-3)
    for omega_h in np.logspace(-2, 4, 61):
        assert max(abs(np.linalg.eigvals(amplification(s, omega_h)))) <= 1 + 1e-9


@pytest.mark.parametrize("scheme", [*map(GeneralisedAlpha, RADII), Newmark()], ids=str)
def test_second_order(scheme: AlphaFamily) -> None:
    """The principal eigenvalue differs from e^(iωh) by O(h³)."""

    def error(omega_h: float) -> float:
        values = np.linalg.eigvals(amplification(scheme, omega_h))
        return float(np.min(np.abs(values - np.exp(1j * omega_h))))

    assert np.log2(error(0.02) / error(0.01)) == pytest.approx(3.0, abs=0.05)


def state(q: float, v: float, a: float, auxiliary: float) -> State:
    """Return the state of one unknown at t = 0."""
    return State(0.0, *(np.array([x]) for x in (q, v, a)), memory=np.array([auxiliary]))


@pytest.mark.parametrize("scheme", SCHEMES, ids=str)
def test_stage_and_finish_are_the_definitions(scheme: AlphaFamily) -> None:
    """One step of q̈ + ω²q = 0, its stage solved at once, is the matrix written out above, q̈ and a apart."""
    h, omega = 0.1, 7.0
    start = state(1.0, 2.0, -(omega**2), 3.0)
    stage = scheme.stage(0, start, h, h, [])
    stage.correct(-(stage.a + omega**2 * stage.q) / (stage.shifts[2] + omega**2 * stage.shifts[0]))
    end = scheme.finish(start, h, [stage])
    expected = amplification(scheme, omega * h) @ np.array([1.0, h * 2.0, h * h * 3.0])
    got = [end.q[0], h * end.v[0], h * h * end.memory[0]]
    np.testing.assert_allclose(got, expected, rtol=1e-12, atol=1e-14)
    assert end.a[0] == pytest.approx(-(omega**2) * end.q[0], rel=1e-12)
    assert end.t == h
