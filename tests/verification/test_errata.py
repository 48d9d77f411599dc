"""Errata of the source papers: what an equation gives as printed, and what it gives put right (docs/theory.md).

Every number comes from a Ritz or Galerkin model in Legendre polynomials, small enough to be read at a glance; no finite
elements and nothing of rotfem takes part. Papers and equations are named as in docs/theory.md:

    SVQ    Simo & Vu-Quoc, UCB/ERL M86/10 (1986)
    ICCIA  planar flexible beam in a non-inertial frame, ICCIA (2017)
    YSU    Yigit, Scott & Ulsoy, J. Sound Vib. 121 (1988)

Unless said otherwise a beam has L = A_rho = EI = 1, so that a frequency is in sqrt(EI/(A_rho L^4)), eta is the speed in
that unit, and a plate has a = rho h = D = 1. "Own" as the source of a number means these models at a higher degree; for
the beams the digits do not change with it (test_models_are_converged), plates are extrapolated in it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import scipy.linalg as sl
from numpy.polynomial import legendre
from scipy.integrate import solve_ivp

Array = npt.NDArray[np.float64]

DEGREE = 14  # functions per beam unknown
PLATE_DEGREE = 10  # functions per direction of a plate
NU = 0.3


def polynomials(count: int, power: int, x: Array, d: int = 0) -> Array:
    """Return the d-th derivatives of x^power P_k(2x − 1), k < count, at x in [0, 1]; shape (count, len(x))."""
    factor = np.array([1.0])
    for _ in range(power):
        factor = legendre.legmul(factor, [0.5, 0.5])
    series = [legendre.legmul(factor, np.eye(k + 1)[k]) for k in range(count)]
    return np.array([legendre.legval(2 * x - 1, 2.0**d * legendre.legder(c, d)) for c in series])


def gauss(count: int) -> tuple[Array, Array]:
    """Return the points and weights of Gauss's rule on [0, 1]."""
    s, w = legendre.leggauss(count)
    return (s + 1) / 2, w / 2


def product(f: Array, g: Array, weight: Any) -> Array:
    """Return the matrix of ∫ f_i g_j with the quadrature weights, times any coefficient, in `weight`."""
    return (f * weight) @ g.T


def squares(K: Array, M: Array, count: int = 3) -> Array:
    """Return the lowest squared frequencies of K x = omega² M x, all real; K need not be symmetric."""
    values = sl.eigvals(K, M)
    values = values[np.argsort(values.real)][:count]
    assert np.abs(values.imag).max() <= 1e-6 * np.abs(values).max()
    return values.real


def frequencies(K: Array, M: Array, count: int = 3) -> Array:
    """Return the lowest frequencies of K x = omega² M x."""
    return np.sqrt(squares(K, M, count))


def gyroscopic(M: Array, C: Array, K: Array, count: int = 3) -> tuple[Array, float]:
    """Return (lowest frequencies, largest growth rate) of M ẍ + C ẋ + K x = 0."""
    zero, one = np.zeros_like(M), np.eye(len(M))
    p = sl.eigvals(np.block([[zero, one], [-sl.solve(M, K), -sl.solve(M, C)]]))
    return np.sort(p.imag[p.imag > 1e-3])[:count], float(p.real.max())


# --- transverse motion of an Euler–Bernoulli beam: SVQ (6), (9) ------------------------------------------------------


class Transverse:
    """u_2 of a beam without extension and shear: mass, bending and the pieces of the stiffness by rotation."""

    def __init__(self, degree: int = DEGREE):
        self.x, self.w = x, w = gauss(48)
        self.f = [polynomials(degree, 2, x, d) for d in range(3)]
        self.M = product(self.f[0], self.f[0], w)
        self.bending = product(self.f[2], self.f[2], w)
        self.prestress = product(self.f[1], self.f[1], w * (1 - x**2) / 2)  # −(N⁰u')', N⁰ = ½ eta² (1 − X²)
        self.slope = product(self.f[0], self.f[1], w * x)  # eta² X u', all that is printed of it

    def lag(self, eta: float, form: str) -> Array:
        """Return squared in-plane frequencies with the stiffness of SVQ (6), (9) as printed or put right."""
        by_rotation = {"linear": 0.0, "printed": self.slope, "right": self.prestress, "minus": -self.prestress}[form]
        return squares(self.bending + eta**2 * (by_rotation - self.M), self.M)


@pytest.mark.parametrize(
    ("eta", "form", "expected"),
    [
        # own, and by shooting in the next test
        (12.0, "printed", [10.17873, 23.58613, 62.26908]),
        (12.0, "right", [5.427049, 35.636976, 78.704925]),
        (4.0, "printed", [4.538533, 22.214980, 61.761903]),
        (4.0, "right", [3.897723, 23.941501, 63.841573]),
    ],
)
def test_svq_9_lacks_the_axial_force_times_curvature(eta: float, form: str, expected: list[float]) -> None:
    np.testing.assert_allclose(np.sqrt(Transverse().lag(eta, form)), expected, rtol=1e-6)


@pytest.mark.parametrize("form", ["printed", "right"])
def test_svq_9_by_shooting(form: str) -> None:
    """The three frequencies at eta = 12 again, by integrating the differential equation from the free end."""
    eta = 12.0

    def mismatch(omega: float) -> float:
        """Return the determinant of (u, u') at the clamp over the two solutions with free end X = 1."""

        def slope(X: float, y: Array) -> Array:
            u, du, ddu, dddu = y.reshape(4, 2)
            by_rotation = X * du if form == "printed" else X * du - (1 - X**2) / 2 * ddu
            return np.concatenate([du, ddu, dddu, (eta**2 + omega**2) * u - eta**2 * by_rotation])

        start = np.concatenate([np.eye(2), np.zeros((2, 2))]).ravel()
        end = solve_ivp(slope, (1.0, 0.0), start, method="DOP853", rtol=1e-11, atol=1e-11).y[:, -1]
        return float(np.linalg.det(end.reshape(4, 2)[:2]))

    for omega in np.sqrt(Transverse().lag(eta, form)):
        assert mismatch(omega * (1 - 1e-6)) * mismatch(omega * (1 + 1e-6)) < 0


def test_svq_6_softens_until_it_is_unstable() -> None:
    """The first squared frequency falls as 3.5160² − eta², through zero at eta = 3.5160 (own; any text on beams)."""
    assert Transverse().lag(0.0, "linear")[0] == pytest.approx(3.5160153**2, rel=1e-7)
    assert Transverse().lag(12.0, "linear")[0] == pytest.approx(3.5160153**2 - 144, rel=1e-7)


def test_svq_21b_drops_the_term_that_9_lacks() -> None:
    """((1 − J^−½) u_2')' is u_1''u_2' + u_1'u_2'' at second order, of which the first product is printed."""
    eps, X, step = 1e-6, 0.6, 1e-30

    def force(x: complex) -> complex:
        du1, du2 = eps * (1 + 2 * x), eps * (3 * x**2 - x)
        return (1 - ((1 + du1) ** 2 + du2**2) ** -0.5) * du2

    exact = force(X + 1j * step).imag / step / eps**2
    first, second = 2 * (3 * X**2 - X), (1 + 2 * X) * (6 * X - 1)
    assert exact == pytest.approx(first + second, rel=1e-5)  # the rest is O(eps)
    assert first == pytest.approx(0.96)  # by hand, for these u_1, u_2 at X = 0.6
    assert second == pytest.approx(5.72)


@pytest.mark.parametrize(
    ("seconds", "power", "expected"),
    [
        # own; spin-up beam: L = 10 m, EI = 1.4e4 N·m², A_rho = 1.2 kg/m, 6 rad/s; (rad/s)²
        (1.0, 2, 20.36308),
        (60.0, 2, 20.36308),
        (1.0, 1, -14.45214),
        (60.0, 1, -21.45792),
    ],
)
def test_svq_10_and_22_depend_on_the_unit_of_time(seconds: float, power: int, expected: float) -> None:
    """N⁰ = ½ A_rho psi_dot^power (L² − X²): with the printed first power the beam at 6 rad/s is unstable."""
    beam, L, EI, A_rho, speed = Transverse(), 10.0, 1.4e4 * seconds**2, 1.2, 6.0 * seconds
    K = EI / L**3 * beam.bending + A_rho * L * (speed**power * beam.prestress - speed**2 * beam.M)
    assert squares(K, A_rho * L * beam.M)[0] / seconds**2 == pytest.approx(expected, rel=1e-6)


def test_svq_15a_without_its_half_doubles_the_stiffness() -> None:
    beam = Transverse()
    assert frequencies(2 * beam.bending, beam.M)[0] == pytest.approx(4.972396, rel=1e-6)  # √2 · 3.516015


def test_svq_7_curvature_alpha_makes_a_string_of_the_beam() -> None:
    """With kappa = alpha = u' the "bending" energy is ½EI u'²: frequencies (k − ½)π, exact, not 3.516, 22.03, …"""
    x, w = gauss(48)
    f, df = (polynomials(DEGREE, 1, x, d) for d in range(2))
    expected = np.pi * np.array([0.5, 1.5, 2.5])
    np.testing.assert_allclose(frequencies(product(df, df, w), product(f, f, w)), expected, rtol=1e-9)


def test_svq_19_second_sign_makes_tension_soften() -> None:
    """With −(N⁰u_2')' turned round the beam is pulled into divergence at eta = 2.37029 (own); put right it never is."""
    beam = Transverse()
    eta = sl.eigh(beam.prestress + beam.M, beam.bending, eigvals_only=True)[-1] ** -0.5
    assert eta == pytest.approx(2.370282, rel=1e-6)
    assert beam.lag(1.001 * eta, "minus")[0] < 0 < beam.lag(0.999 * eta, "minus")[0]
    assert beam.lag(12.0, "right")[0] > 0


# --- Timoshenko beam with extension and Coriolis force: SVQ (2), (11), (19), (23) -------------------------------------


def timoshenko(eta: float, slenderness: float, form: str, degree: int = DEGREE) -> tuple[Array, Array, Array]:
    """Return (M, C, K) of q = (u_1, u_2, alpha) about the spinning state, printed or right.

    EA = s², GA_s = s²/3.059, I_rho = 1/s² with s the slenderness: a rectangular section with nu = 0.3 and k = 0.85.
    """
    x, w = gauss(48)
    f, df = (polynomials(degree, 1, x, d) for d in range(2))
    m, k, fd = product(f, f, w), product(df, df, w), product(f, df, w)
    EA, GA, EI, rotary = slenderness**2, slenderness**2 / 3.059, 1.0, slenderness**-2
    K22, K23, K32, K33 = GA * k - eta**2 * m, -GA * fd.T, -GA * fd, GA * m + EI * k
    N = eta**2 * (1 - x**2) / 2
    if form == "11 printed":
        K23 = K23 + eta**2 * product(f, f, w * x)
    elif form == "11 right":
        K23, K32 = K23 + product(df, f, w * N), K32 + product(f, df, w * N)
        K33 = K33 - product(f, f, w * N)
    elif form == "23 printed":
        K22 = K22 + eta**2 * product(f, df, w * x)
    elif form == "23 right":
        K22 = K22 + product(df, df, w * N)
    elif form == "2 printed":  # Γ_1 V where (1 + Γ_1) V belongs: V is lost from the moment balance
        K32, K33 = 0 * m, EI * k
    elif form == "19 printed":  # −GA_s (u_2' − alpha) where + belongs
        K32, K33 = GA * fd, EI * k - GA * m
    zero = np.zeros_like(m)
    M = sl.block_diag(m, m, rotary * m)
    C = 2 * eta * np.block([[zero, -m, zero], [m, zero, zero], [zero, zero, zero]])
    K = np.block([[EA * k - eta**2 * m, zero, zero], [zero, K22, K23], [zero, K32, K33]])
    return M, C, K


@pytest.mark.parametrize(
    ("form", "expected"),
    [  # own, eta = 12, slenderness 30
        ("11 printed", [8.576917, 22.255955, 50.533717]),
        ("11 right", [4.447102, 33.225557, 51.668497]),
        ("23 printed", [8.676236, 22.521773, 50.522296]),
        ("23 right", [4.523111, 33.428251, 51.673895]),
    ],
)
def test_svq_11_and_23(form: str, expected: list[float]) -> None:
    """Printed, the stiffness of a conservative system is not symmetric; frequencies are as far off as with (9)."""
    M, C, K = timoshenko(12.0, 30.0, form)
    np.testing.assert_allclose(gyroscopic(M, C, K)[0], expected, rtol=1e-6)
    assert np.allclose(K, K.T, rtol=0, atol=1e-9 * np.abs(K).max()) == form.endswith("right")


@pytest.mark.parametrize("form", ["printed", "right"])
def test_svq_11_and_23_tend_to_9_for_a_slender_beam(form: str) -> None:
    expected = np.sqrt(Transverse().lag(12.0, form))
    for equation in ("11", "23"):
        found, _ = gyroscopic(*timoshenko(12.0, 1000.0, f"{equation} {form}"))
        np.testing.assert_allclose(found, expected, rtol=3e-4)  # O(1/slenderness)² of shear, with a large factor


def test_svq_2_lacks_the_shear_force_in_the_moment_balance() -> None:
    """At rest, slenderness 100: the section no longer turns with the axis and u_2 moves as a shear beam."""
    right, printed = (gyroscopic(*timoshenko(0.0, 100.0, form))[0] for form in ("11 right", "2 printed"))
    assert right[0] == pytest.approx(3.512704, rel=1e-6)  # own
    assert printed[0] == pytest.approx(np.pi / 2 * 100 / np.sqrt(3.059), rel=1e-6)  # exact: ½π √(GA_s/A_rho)/L


def test_svq_19_third_row_is_unstable_at_rest() -> None:
    """Growth rates 504.889 and 5706.74 (own), close to √(GA_s/I_rho); put right there is none."""
    for slenderness, growth in ((30.0, 504.8895), (100.0, 5706.745)):
        found = gyroscopic(*timoshenko(0.0, slenderness, "19 printed"))[1]
        assert found == pytest.approx(growth, rel=1e-5)
        assert found == pytest.approx(slenderness**2 / np.sqrt(3.059), rel=0.02)
        assert abs(gyroscopic(*timoshenko(0.0, slenderness, "23 right"))[1]) < 1e-6 * growth


def test_svq_17_has_two_dots_too_many() -> None:
    """|velocity|² of a point, against the differentiated inertial position (exact)."""
    X, t, step = 2.0, 0.4, 1e-30
    psi, u1, u2 = np.poly1d([1.5, 0.7, 0.0]), np.poly1d([0.3, 0.1, 0.2]), np.poly1d([-0.2, 0.5, 0.1])

    def position(s: complex) -> npt.NDArray[np.complex128]:
        c, n = np.cos(psi(s)), np.sin(psi(s))
        return np.array([c * (X + u1(s)) - n * u2(s), n * (X + u1(s)) + c * u2(s)])

    velocity = position(t + 1j * step).imag / step
    w, v1, v2 = psi.deriv()(t), u1.deriv()(t), u2.deriv()(t)
    right = (v1 - w * u2(t)) ** 2 + (v2 + w * (X + u1(t))) ** 2
    printed = (v1 - w * v2) ** 2 + (v2 + w * (X + v1)) ** 2  # holds no displacement, so no centrifugal force either
    assert right == pytest.approx(velocity @ velocity, rel=1e-12)
    assert right == pytest.approx(21.9985, abs=1e-4)  # by hand, m²/s²
    assert printed == pytest.approx(22.9994, abs=1e-4)  # by hand


def test_svq_17_has_no_centrifugal_force() -> None:
    """The steady stretch that printed (17) lacks, of a rod with the energy put right: tan(kL)/k − L (exact), in m."""
    L, EA, A_rho, speed = 10.0, 2.8e7, 1.2, 6.0
    x, w = gauss(48)
    f, df = (polynomials(DEGREE, 1, x, d) for d in range(2))
    K = EA / L * product(df, df, w) - speed**2 * A_rho * L * product(f, f, w)
    u = sl.solve(K, speed**2 * A_rho * L * (f * w) @ (L * x))
    k = speed * np.sqrt(A_rho / EA)
    assert u @ polynomials(DEGREE, 1, np.array([1.0]))[:, 0] == pytest.approx(np.tan(k * L) / k - L, rel=1e-9)
    assert np.tan(k * L) / k - L == pytest.approx(5.14317e-4, rel=1e-6)  # own


# --- hub beam of ICCIA -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class HubBeam:
    """Euler–Bernoulli beam of ICCIA with extension, Coriolis force and, in the one-order model, rotary inertia."""

    E: float = 6.8952e10
    rho: float = 2766.0
    L: float = 8.0
    I: float = 8.2189e-9  # noqa: E741 (the paper's symbol)
    A: float = 7.2986e-5

    def _assemble(self, speed: float, N: Any, stretch: Any, curvature: Callable[[Array, Array], Array], rotary: float):
        x, w = gauss(48)
        u = [polynomials(DEGREE, 1, x, d) / self.L**d for d in range(2)]
        v = [polynomials(DEGREE, 2, x, d) / self.L**d for d in range(3)]
        A_rho, EA, EI, w = self.rho * self.A, self.E * self.A, self.E * self.I, w * self.L
        kappa, turn = curvature(v[1], v[2]), v[1] / stretch
        M = sl.block_diag(
            A_rho * product(u[0], u[0], w), A_rho * product(v[0], v[0], w) + rotary * product(turn, turn, w)
        )
        K = sl.block_diag(
            EA * product(u[1], u[1], w) - speed**2 * A_rho * product(u[0], u[0], w),
            EI * product(kappa, kappa, w)
            + product(v[1], v[1], w * N / stretch)
            - speed**2 * A_rho * product(v[0], v[0], w),
        )
        G, zero = 2 * speed * A_rho * product(u[0], v[0], w), np.zeros((DEGREE, DEGREE))
        return gyroscopic(M, np.block([[zero, -G], [G.T, zero]]), K)[0]

    def one_order(self, R: float, speed: float, hub_terms: int) -> Array:
        """Return frequencies (rad/s) with the hub term R speed² C of the stiffness counted hub_terms times."""
        X = self.L * gauss(48)[0]
        N = self.rho * self.A * speed**2 * (hub_terms * R * (self.L - X) + (self.L**2 - X**2) / 2)
        return self._assemble(speed, N, 1.0, lambda dv, ddv: ddv, self.rho * self.I)

    def exact(self, R: float, speed: float) -> Array:
        """Return frequencies (rad/s) of the elastica about its exact stretched state, EA r'' = −A_rho speed² r."""
        X, k = self.L * gauss(48)[0], speed * np.sqrt(self.rho / self.E)
        b = (1 / k + R * np.sin(k * self.L)) / np.cos(k * self.L)  # r(0) = R, r'(L) = 1
        stretch = k * (b * np.cos(k * X) - R * np.sin(k * X))
        slope = -(k**2) * (b * np.sin(k * X) + R * np.cos(k * X))

        def curvature(dv: Array, ddv: Array) -> Array:
            return ddv / stretch - dv * slope / stretch**2

        return self._assemble(speed, self.E * self.A * (stretch - 1), stretch, curvature, 0.0)


@pytest.mark.parametrize(
    ("R", "speed", "printed", "right", "exact"),
    # own; rad/s; "exact" is independent of the paper's approximation
    [(2.0, 8.0, 8.079190, 6.417749, 6.417488), (1.0, 4.0, 4.166872, 3.779504, 3.779473)],
)
def test_iccia_16_counts_the_hub_twice(R: float, speed: float, printed: float, right: float, exact: float) -> None:
    """Its "precise model is stiffer" is this error: linearised exactly, the beam agrees with the one-order model."""
    beam = HubBeam()
    assert beam.one_order(R, speed, 2)[0] == pytest.approx(printed, rel=1e-6)
    assert beam.one_order(R, speed, 1)[0] == pytest.approx(right, rel=1e-6)
    assert beam.exact(R, speed)[0] == pytest.approx(exact, rel=1e-6)
    assert right == pytest.approx(exact, rel=1e-4)


# --- hub coupling of YSU ---------------------------------------------------------------------------------------------

YSU_L, YSU_A, YSU_EI, YSU_RHO = 0.5, 0.05, 5.50, 0.0858  # m, m, N·m², kg/m


def beam_inertia(cross_term: bool) -> float:
    """Return J of the rigid beam (kg·m²); about the axis it holds a cross term rho a L²."""
    return YSU_RHO * (YSU_L**3 / 3 + YSU_A**2 * YSU_L + (YSU_A * YSU_L**2 if cross_term else 0.0))


def coupled_frequency(beta: float, J: float) -> float:
    """Return the first elastic frequency (Hz) of beam and free hub at small speed, I_R = beta J."""
    beam = Transverse()
    M, K = YSU_RHO * YSU_L * beam.M, YSU_EI / YSU_L**3 * beam.bending
    S = YSU_RHO * YSU_L * (beam.f[0] * beam.w) @ (YSU_A + YSU_L * beam.x)
    bordered = np.block([[M, S[:, None]], [S[None, :], np.array([[(1 + beta) * J]])]])
    return float(np.sqrt(squares(sl.block_diag(K, 0.0), bordered, 2)[1])) / (2 * np.pi)  # [0] is the free rotation


def test_ysu_inertia_about_the_axis() -> None:
    assert beam_inertia(True) == pytest.approx(YSU_RHO * ((YSU_A + YSU_L) ** 3 - YSU_A**3) / 3, rel=1e-14)


@pytest.mark.parametrize(
    ("beta", "cross_term", "expected"),
    [  # own, Hz; the paper: 40.67 at beta = 0.5, "about 16 %" above the cantilever at beta = 4
        (0.5, True, 29.400765),
        (0.5, False, 40.974893),
        (4.0, True, 19.898615),
        (4.0, False, 20.609402),
    ],
)
def test_ysu_coupled_frequency_with_both_readings_of_J(beta: float, cross_term: bool, expected: float) -> None:
    assert coupled_frequency(beta, beam_inertia(cross_term)) == pytest.approx(expected, rel=1e-6)


def test_ysu_coupling_vanishes_for_a_heavy_hub() -> None:
    cantilever = 3.5160153 / (2 * np.pi) * np.sqrt(YSU_EI / (YSU_RHO * YSU_L**4))
    assert cantilever == pytest.approx(17.92126, rel=1e-6)  # the paper: 18 Hz
    assert coupled_frequency(1e9, beam_inertia(True)) == pytest.approx(cantilever, rel=1e-6)


def test_ysu_centrifugal_force_fixed_or_varied() -> None:
    """Change of the hub's inertia by the first mode with a tip of 25 mm, P held fixed (A) or varied with speed (B)."""
    beam = Transverse()
    mode = sl.eigh(beam.bending, beam.M)[1][:, 0]
    mode *= 0.025 / (mode @ polynomials(DEGREE, 2, np.array([1.0]))[:, 0])
    v, dv = mode @ beam.f[0], mode @ beam.f[1] / YSU_L
    X = YSU_L * beam.x
    deflection = YSU_RHO * YSU_L * (beam.w @ v**2)
    shortening = YSU_RHO * YSU_L * (beam.w @ ((YSU_A * (YSU_L - X) + (YSU_L**2 - X**2) / 2) * dv**2))
    assert deflection / beam_inertia(True) == pytest.approx(1.4098e-3, rel=1e-4)  # own
    assert (deflection - shortening) / beam_inertia(True) == pytest.approx(-4.940e-4, rel=1e-3)  # own


# --- square cantilever plate: SVQ (28c), (32), (33a) -----------------------------------------------------------------


class Plate:
    """Square plate clamped along X_1 = 0, spinning about its normal a_3 through the middle of that edge."""

    def __init__(self, degree: int = PLATE_DEGREE):
        self.degree = degree
        self.x, w = gauss(degree + 6)
        self.w = np.outer(w, w).ravel()
        self.X1, self.X2 = np.repeat(self.x, len(self.x)), np.tile(self.x - 0.5, len(self.x))
        self.N = self._plane_stress()

    def functions(self, power: int, d1: int, d2: int) -> Array:
        """Return derivatives (d1, d2) of X_1^power P_i P_j at the quadrature points."""
        f, g = polynomials(self.degree, power, self.x, d1), polynomials(self.degree, 0, self.x, d2)
        return np.einsum("ia,jb->ijab", f, g).reshape(self.degree**2, -1)

    def product(self, f: Array, g: Array, c: Any = 1.0) -> Array:
        """Return the matrix of ∫ c f_i g_j."""
        return product(f, g, self.w * c)

    def _plane_stress(self) -> tuple[Array, Array, Array]:
        """Return N⁰_11, N⁰_22, N⁰_12 at the quadrature points under the load X_gamma of unit speed."""
        f, f1, f2 = (self.functions(1, *d) for d in ((0, 0), (1, 0), (0, 1)))
        p, half = self.product, (1 - NU) / 2
        K12 = NU * p(f1, f2) + half * p(f2, f1)
        K = np.block([[p(f1, f1) + half * p(f2, f2), K12], [K12.T, p(f2, f2) + half * p(f1, f1)]])
        u = sl.solve(K, np.concatenate([(f * self.w) @ self.X1, (f * self.w) @ self.X2]), assume_a="pos")
        u1, u2 = np.split(u, 2)
        return u1 @ f1 + NU * u2 @ f2, u2 @ f2 + NU * u1 @ f1, half * (u1 @ f2 + u2 @ f1)

    def geometric(self, f1: Array, f2: Array) -> Array:
        """Return ∫ N⁰_gb f,g f,b for unit speed."""
        p, (N11, N22, N12) = self.product, self.N
        return p(f1, f1, N11) + p(f2, f2, N22) + p(f1, f2, N12) + p(f2, f1, N12)

    def kirchhoff(self, gamma: float, bending: str = "right", prestress: str = "right") -> Array:
        """Return frequencies of the thin plate with SVQ (28c), (33a) printed or right."""
        p, (f, f1, f2) = self.product, (self.functions(2, *d) for d in ((0, 0), (1, 0), (0, 1)))
        f11, f22, f12 = (self.functions(2, *d) for d in ((2, 0), (0, 2), (1, 1)))
        K = (1 - NU) * (p(f11, f11) + p(f22, f22) + 2 * p(f12, f12))
        if bending == "right":
            K = K + NU * p(f11 + f22, f11 + f22)
        by_rotation = self.geometric(f1, f2) if prestress == "right" else p(f, f1, self.X1) + p(f, f2, self.X2)
        return frequencies(K + gamma**2 * by_rotation, p(f, f))

    def mindlin(self, gamma: float, thickness: float, spin_of_director: bool) -> Array:
        """Return frequencies of the shear-flexible plate, k = 5/6, no Coriolis force, SVQ (32) printed or right."""
        p, (f, f1, f2) = self.product, (self.functions(1, *d) for d in ((0, 0), (1, 0), (0, 1)))
        shear, rotary, half = 5 * (1 - NU) / thickness**2, thickness**2 / 12, (1 - NU) / 2
        m = p(f, f)
        K33 = shear * (p(f1, f1) + p(f2, f2)) + gamma**2 * self.geometric(f1, f2)
        spin = -rotary * gamma**2 * m if spin_of_director else 0 * m
        K11 = shear * m + p(f1, f1) + half * p(f2, f2) + spin
        K22 = shear * m + p(f2, f2) + half * p(f1, f1) + spin
        K12, K31, K32 = NU * p(f1, f2) + half * p(f2, f1), -shear * p(f1, f), -shear * p(f2, f)
        K = np.block([[K33, K31, K32], [K31.T, K11, K12], [K32.T, K12.T, K22]])
        values = sl.eigh(K, sl.block_diag(m, rotary * m, rotary * m), eigvals_only=True, subset_by_index=[0, 4])
        return np.sqrt(values)


@pytest.fixture(scope="module")
def plate() -> Plate:
    return Plate()


def test_svq_28c_without_poisson_coupling_of_curvatures(plate: Plate) -> None:
    """Thin plate at rest; own, 3e-4 being what the clamped corners leave at this degree."""
    np.testing.assert_allclose(plate.kirchhoff(0.0), [3.4710, 8.5061, 21.2838], rtol=3e-4)
    printed = plate.kirchhoff(0.0, bending="printed")
    np.testing.assert_allclose(printed, [2.94171, 8.09526, 18.43538], rtol=3e-5)
    assert printed[0] == pytest.approx(3.5160153 * np.sqrt(1 - NU), rel=1e-6)  # a beam of stiffness D(1 − nu), exact


def test_svq_33a_lacks_the_membrane_force_times_curvature(plate: Plate) -> None:
    """Thin plate, gamma = 10, the factor A_rho put into the bracket; own."""
    np.testing.assert_allclose(plate.kirchhoff(10.0), [11.1943, 16.6306, 31.9544], rtol=3e-4)
    printed = plate.kirchhoff(10.0, prestress="printed")
    np.testing.assert_allclose(printed, [13.0041, 16.6277, 25.0891], rtol=3e-4)


def test_svq_32_lacks_the_spin_of_the_turning_fibre(plate: Plate) -> None:
    """gamma = 10, h/a = 0.1: the missing −psi_dot² (rho d³/12) alpha raises the first five by up to 0.057 (own)."""
    right, printed = (plate.mindlin(10.0, 0.1, spin) for spin in (True, False))
    np.testing.assert_allclose(right, [11.0763, 16.2338, 30.5616, 33.4155, 38.6361], rtol=2e-4)  # own
    np.testing.assert_allclose(printed - right, [0.0136, 0.0368, 0.0569, 0.0438, 0.0401], atol=1e-4)  # own


# --- the models themselves -------------------------------------------------------------------------------------------


def test_models_are_converged() -> None:
    """Two functions more per unknown leave the quoted digits as they are."""
    for form in ("printed", "right"):
        np.testing.assert_allclose(
            Transverse(DEGREE + 2).lag(12.0, form), Transverse(DEGREE).lag(12.0, form), rtol=1e-8
        )
        for equation in ("11", "23"):
            coarse, fine = (timoshenko(12.0, 30.0, f"{equation} {form}", DEGREE + n) for n in (0, 2))
            np.testing.assert_allclose(gyroscopic(*fine)[0], gyroscopic(*coarse)[0], rtol=1e-7)
