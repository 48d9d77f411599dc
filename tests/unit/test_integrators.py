"""Schemes as data: parameters, their identities, and spectral radius and order on one linear oscillator."""

from __future__ import annotations

import numpy as np
import pytest

from rotfem.analysis.stepper import Scheme
from rotfem.scene import Scene

RADII = (0.0, 0.3, 0.5, 0.8, 0.9, 1.0)


def amplification(s: Scheme, omega_h: float) -> np.ndarray:
    """Return the matrix that carries (q, h v, h² a) over one step of q̈ + ω²q = 0, written out from the definitions."""
    w2 = omega_h**2
    # unknowns (q, v, a) at n + 1, with q̈ = −w2 q at both ends:
    # (1 − alpha_m) a1 + alpha_m a0 = −w2 [(1 − alpha_f) q1 + alpha_f q0]
    left = np.array([[1, 0, -s.beta], [0, 1, -s.gamma], [w2 * (1 - s.alpha_f), 0, 1 - s.alpha_m]])
    right = np.array([[1, 1, 0.5 - s.beta], [0, 1, 1 - s.gamma], [-w2 * s.alpha_f, 0, -s.alpha_m]])
    return np.linalg.solve(left, right)


@pytest.mark.parametrize("rho", RADII)
def test_generalised_alpha(rho: float) -> None:
    """Second order needs gamma = ½ + alpha_f − alpha_m, unconditional stability beta = ¼(1 + alpha_f − alpha_m)²."""
    s = Scheme.generalised_alpha(rho)
    assert s.gamma == pytest.approx(0.5 + s.alpha_f - s.alpha_m, abs=1e-15)
    assert s.beta == pytest.approx((1 + s.alpha_f - s.alpha_m) ** 2 / 4, abs=1e-15)
    assert s.alpha_m <= s.alpha_f <= 0.5


@pytest.mark.parametrize("rho", RADII)
def test_spectral_radius(rho: float) -> None:
    """rho_inf at infinite frequency (three equal values, so a root of round-off), at most 1 at every frequency."""
    s = Scheme.generalised_alpha(rho)
    assert max(abs(np.linalg.eigvals(amplification(s, 1e6)))) == pytest.approx(rho, abs=1e-3)
    for omega_h in np.logspace(-2, 4, 61):
        assert max(abs(np.linalg.eigvals(amplification(s, omega_h)))) <= 1 + 1e-9


@pytest.mark.parametrize("scheme", [*map(Scheme.generalised_alpha, RADII), Scheme.newmark()], ids=str)
def test_second_order(scheme: Scheme) -> None:
    """The principal eigenvalue differs from e^(iωh) by O(h³)."""

    def error(omega_h: float) -> float:
        values = np.linalg.eigvals(amplification(scheme, omega_h))
        return float(np.min(np.abs(values - np.exp(1j * omega_h))))

    assert np.log2(error(0.02) / error(0.01)) == pytest.approx(3.0, abs=0.05)


def test_newmark_is_the_trapezoidal_rule() -> None:
    s = Scheme.newmark()
    assert (s.alpha_m, s.alpha_f, s.beta, s.gamma) == (0.0, 0.0, 0.25, 0.5)
    np.testing.assert_allclose(abs(np.linalg.eigvals(amplification(s, 0.7)))[:2].max(), 1.0, atol=1e-14)


def test_first_order_without_its_identity() -> None:
    """The test of order can fail: Newmark with gamma = 0.6 is of first order."""
    s = Scheme.newmark(0.3025, 0.6)
    errors = [np.min(np.abs(np.linalg.eigvals(amplification(s, w)) - np.exp(1j * w))) for w in (0.02, 0.01)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("rho", RADII)
def test_shifts_are_the_derivatives_of_the_update(rho: float) -> None:
    """c_q, c_v, c_m = ∂(q, v, q̈)/∂q by differences of the update maps (linear, so to round-off)."""
    s, h = Scheme.generalised_alpha(rho), 0.01

    def update(a1: float) -> tuple[float, float, float]:
        q = 1 + h * 2 + h * h * ((0.5 - s.beta) * 3 + s.beta * a1)
        v = 2 + h * ((1 - s.gamma) * 3 + s.gamma * a1)
        acceleration = ((1 - s.alpha_m) * a1 + s.alpha_m * 3 - s.alpha_f * 4) / (1 - s.alpha_f)
        return q, v, acceleration

    one, zero = np.array(update(1.0)), np.array(update(0.0))
    np.testing.assert_allclose(s.shifts(h), (one - zero) / (one - zero)[0], rtol=1e-9)


def test_scheme_of_a_scene() -> None:
    section = {"EA": 1.0, "GA": 1.0, "EI": 1.0, "mass_per_length": 1.0}
    tables = {
        "structure": {"type": "planar_beam", "length": 1.0, "section": section},
        "motion": {"type": "constant", "speed": 1.0},
        "time": {"end": 1.0, "step": 0.1},
    }
    scene = Scene.from_dict(tables)
    assert Scheme.of(scene) == Scheme.generalised_alpha(0.9)
    assert Scheme.of(scene.replace({"time.spectral_radius": 0.2})) == Scheme.generalised_alpha(0.2)
    assert Scheme.of(scene.replace({"time.scheme": "newmark"})) == Scheme.newmark()
    assert Scheme.of(scene.replace({"time.scheme": "newmark", "time.beta": 0.3})) == Scheme.newmark(0.3, 0.5)
