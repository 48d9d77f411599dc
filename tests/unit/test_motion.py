"""Prescribed motion: speed, rate and angle belong together, whatever way they are given."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest
from dolfinx import mesh
from mpi4py import MPI
from scipy.integrate import quad

from rotfem.commands.problem import motion_of
from rotfem.mechanics.motion import Motion, smooth_spin_up
from rotfem.mechanics.work import Frame
from rotfem.scene import Scene

BEAM: dict[str, Any] = {
    "structure": {
        "type": "planar_beam",
        "length": 1.0,
        "section": {"EA": 1.0, "GA": 1.0, "EI": 1.0, "mass_per_length": 1.0},
    }
}
POINTS = [[0.5, 1.0], [1.0, 2.0], [2.0, 2.5], [4.0, 0.5]]
MOTIONS: dict[str, dict[str, Any]] = {
    "constant": {"type": "constant", "speed": -3.0},
    "spin_up": {"type": "spin_up", "speed": 6.0, "duration": 2.0},
    "pchip": {"type": "table", "table": POINTS},
    "cubic": {"type": "table", "table": POINTS, "interpolation": "cubic"},
    "linear": {"type": "table", "table": POINTS, "interpolation": "linear"},
    "speed only": {"type": "callable", "speed": lambda t: 2 + np.sin(3 * t)},
    "all three": {
        "type": "callable",
        "speed": lambda t: 2 + np.sin(3 * t),
        "rate": lambda t: 3 * np.cos(3 * t),
        "angle": lambda t: 2 * t + (1 - np.cos(3 * t)) / 3,
    },
}


def motion(tables: dict[str, Any]) -> Motion:
    return motion_of(Scene.from_dict(copy.deepcopy(BEAM) | {"motion": tables}))


@pytest.mark.parametrize("name", list(MOTIONS))
def test_rate_is_the_derivative_of_the_speed(name: str) -> None:
    """Central differences of 1e-4 s: truncation and round-off below 1e-7; times are off the knots of the tables."""
    m, h = motion(MOTIONS[name]), 1e-4
    for t in (0.3, 0.7, 1.3, 1.9, 3.1, 5.0):
        assert m.rate(t) == pytest.approx((m.speed(t + h) - m.speed(t - h)) / (2 * h), abs=1e-6)


@pytest.mark.parametrize("name", list(MOTIONS))
def test_angle_is_the_integral_of_the_speed(name: str) -> None:
    m = motion(MOTIONS[name])
    assert m.angle(0.0) == pytest.approx(0.0, abs=1e-14)
    for t in (0.3, 0.7, 1.3, 5.0, 1.9):  # not in order: a later question must not spoil an earlier one
        exact = quad(m.speed, 0.0, t, points=[p for p, _ in POINTS if p < t], epsabs=1e-11, limit=200)[0]
        assert m.angle(t) == pytest.approx(exact, abs=1e-8)


def test_smooth_spin_up() -> None:
    """Ω(t) = Ω_s (t/T − sin(2πt/T)/2π): half the speed at half the time, zero rate at both ends, angle Ω_s T/2."""
    omega, rate, angle = smooth_spin_up(6.0, 15.0)
    assert (omega(0.0), omega(7.5), omega(15.0), omega(100.0)) == pytest.approx((0.0, 3.0, 6.0, 6.0), abs=1e-14)
    assert (rate(0.0), rate(7.5), rate(15.0)) == pytest.approx((0.0, 0.8, 0.0), abs=1e-14)
    assert angle(15.0) == pytest.approx(45.0)
    assert angle(16.0) == pytest.approx(51.0)


@pytest.mark.parametrize("kind", ["pchip", "cubic", "linear"])
def test_table_passes_through_its_points_and_is_constant_outside(kind: str) -> None:
    m = motion({"type": "table", "table": POINTS, "interpolation": kind})
    for t, speed in POINTS:
        assert m.speed(t) == pytest.approx(speed, abs=1e-12)
    assert (m.speed(0.0), m.speed(9.0)) == pytest.approx((1.0, 0.5), abs=1e-12)
    assert m.rate(0.2) == m.rate(4.5) == 0.0


@pytest.mark.parametrize("kind", ["pchip", "cubic", "linear"])
@pytest.mark.parametrize("start", [-2.0, -0.5, 1.0])
def test_the_angle_of_a_table_is_zero_at_the_start(kind: str, start: float) -> None:
    """Rows that end before t = 0, that reach over it, and that begin after it."""
    m = motion({"type": "table", "table": [[start, 3.0], [start + 1.0, 3.0]], "interpolation": kind})
    assert (m.angle(0.0), m.angle(4.0)) == pytest.approx((0.0, 12.0), abs=1e-12)


def test_rotation_turns_by_the_angle() -> None:
    m = motion(MOTIONS["spin_up"])
    Q, psi = m.rotation(1.2), m.angle(1.2)
    np.testing.assert_allclose(Q @ [1, 0, 0], [np.cos(psi), np.sin(psi), 0], atol=1e-15)
    np.testing.assert_allclose(Q @ Q.T, np.eye(3), atol=1e-15)
    other = motion(MOTIONS["spin_up"] | {"axis": [0, 0, -2]})
    np.testing.assert_allclose(other.rotation(1.2), Q.T, atol=1e-15)


@pytest.mark.parametrize("fixed", [False, True])
def test_frame_constants(fixed: bool) -> None:
    """Gravity turns backwards in the rotating frame, the base acceleration forwards in the fixed one."""
    m = motion(MOTIONS["spin_up"] | {"base_acceleration": [1.0, 2.0]})
    frame = Frame(mesh.create_unit_interval(MPI.COMM_SELF, 1), planar=True, fixed=fixed, gravity=(0.0, -9.81, 0.0))
    assert frame.constants == {}
    _ = frame.w, frame.dw, frame.gravity, frame.a_o
    assert set(frame.constants) == {"w", "dw", "gravity", "a_o"}
    values, Q = frame.values(m, 1.2), m.rotation(1.2)[:2, :2]
    np.testing.assert_allclose(values["w"], m.speed(1.2))
    np.testing.assert_allclose(values["dw"], m.rate(1.2))
    np.testing.assert_allclose(values["gravity"], [0, -9.81] if fixed else Q.T @ [0, -9.81])
    np.testing.assert_allclose(values["a_o"], Q @ [1, 2] if fixed else [1, 2])
    frame.set(values)
    np.testing.assert_array_equal(frame.constants["gravity"].value, values["gravity"])
