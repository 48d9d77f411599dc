"""Steps and meshes that are planned from the spectrum of a motion, against vibrations whose errors are known."""

from __future__ import annotations

import numpy as np
import pytest

from rotfem.analysis.esdirk import ESDIRK4
from rotfem.commands.ahead import FREE, Ahead, put
from rotfem.selection.accuracy import Settings
from rotfem.selection.mesh_ahead import MeshAhead
from rotfem.selection.spectrum import LOST, SAFE, Vibrating
from rotfem.selection.steps_ahead import Motion, error_ahead, plan, unresolved_ahead


def vibration(omega: float, amplitude: float = 1.0, end: float = 100.0) -> Motion:
    """Return the motion of a tip that vibrates at 1 rad/s with amplitude 1, and at another frequency beside that."""
    t = np.linspace(0.0, end, 8001)
    return Motion(t, (np.cos(t) + amplitude * np.cos(omega * t))[:, None])


def of_one(omega: float, h: float, end: float = 100.0) -> float:
    """Return what steps put a vibration of amplitude 1 off at the end: C (ωh)^m T/h."""
    constant, power, _ = ESDIRK4.estimate
    return float(constant * (omega * h) ** power * end / h)


def test_the_error_of_one_vibration_is_that_of_its_phase() -> None:
    """Half of the motion moves at 1 rad/s twice over; the transform may be a few per cent off between its lines."""
    found = error_ahead([vibration(1.0)], ESDIRK4, 0.5)
    assert found == pytest.approx(SAFE * of_one(1.0, 0.5), rel=0.1)


def test_a_phase_that_fades_or_follows_its_loads_does_not_add_up() -> None:
    """The same motion of a structure that forgets in 10 s is off by a tenth of it, of one that follows by 8/3 rad.

    Of that which fades, what the window leaves below half the lowest frequency follows, a hundredth of it.
    """
    t = np.linspace(0.0, 100.0, 8001)
    free, fading, following = (
        error_ahead([Motion(t, np.cos(t)[:, None], structure=structure)], ESDIRK4, 0.5)
        for structure in (Vibrating(), Vibrating(lowest=1.0, fading=0.1), Vibrating(lowest=50.0))
    )
    assert free is not None
    assert fading == pytest.approx(free * 10 / 100, rel=0.03)
    assert following == pytest.approx(free * (8 / 3) / 100, rel=0.1)


def test_an_error_of_a_motion_as_large_as_the_structure_feeds_itself() -> None:
    """Where the tip moves by half the length, frequencies change with the error: half as much again is told."""
    t = np.linspace(0.0, 100.0, 8001)
    free, large = (
        error_ahead([Motion(t, np.cos(t)[:, None], structure=structure)], ESDIRK4, 0.5)
        for structure in (Vibrating(), Vibrating(length=2.0))
    )
    assert free is not None
    assert large == pytest.approx(1.5 * free)


def test_phases_fade_as_those_of_the_modes_beside_them() -> None:
    """At each frequency the less damped neighbour counts, of all instants that one which fades least."""
    first, then = ((np.array([2.0, 9.0, 30.0]), np.array(rates)) for rates in ([0.1, 1.0, 8.0], [0.1, 3.0, 6.0]))
    fades = Vibrating(lowest=2.0, fading=0.1, rates=(first, then)).fades(np.array([0.5, 5.0, 20.0, 50.0]))
    assert fades == pytest.approx([0.1, 0.1, 1.0, 6.0])


def test_what_is_fast_and_damped_counts_with_its_amplitude() -> None:
    """A hundredth of the motion at 20 rad/s: long steps leave just that, and none that is allowed more resolves it."""
    motion = vibration(20.0, 0.01)
    assert error_ahead([motion], ESDIRK4, 0.3) == pytest.approx(
        LOST * 0.01 / 1.01 + SAFE * of_one(1.0, 0.3) / 1.01, rel=0.1
    )
    loose, tight = (plan([motion], allowed, [ESDIRK4]) for allowed in (2e-2, 5e-3))
    assert loose is not None
    assert tight is not None
    assert tight.step < 0.1 < 0.4 < loose.step


def test_what_two_lengths_of_steps_leave_out_is_known_all_the_same() -> None:
    """Steps of 0.3 and 0.6 s damp the vibration out alike; those of 0.04 s follow it, to 0.03 rad at the end."""
    motion = vibration(20.0, 0.01)
    assert unresolved_ahead([motion], ESDIRK4, 0.3) == pytest.approx(LOST * 0.01 / 1.01, rel=0.1)
    assert unresolved_ahead([motion], ESDIRK4, 0.1) == pytest.approx(2 * 0.01 / 1.01, rel=0.1)
    assert unresolved_ahead([motion], ESDIRK4, 0.02) < 1e-6


def test_a_start_that_is_over_soon_counts() -> None:
    """A hundredth of the motion that has died out after a tenth of a second, where the window has hardly opened."""
    t = np.linspace(0.0, 100.0, 8001)
    blip = 0.01 * np.exp(-40.0 * t) * (np.cos(40.0 * t) + np.sin(40.0 * t))  # starts at rest
    motion = Motion(t, (1.0 - np.cos(t) + blip)[:, None])
    assert motion.start(5.0) == pytest.approx(0.01, rel=0.2)
    assert motion.start(200.0) < 1e-3
    loose, tight = (plan([motion], allowed, [ESDIRK4]) for allowed in (2e-2, 3e-3))
    assert loose is not None
    assert tight is not None
    assert tight.step < 0.15 < 0.4 < loose.step


def test_steps_between_times_at_any_distances() -> None:
    """Splines add a little; straight lines would make it thirty times as large."""
    t = np.cumsum(np.random.default_rng(1).uniform(0.01, 0.04, 2000))
    t = (t - t[0]) * 16 * np.pi / (t[-1] - t[0])
    motion = Motion.between(t, np.cos(t)[:, None])
    assert np.ptp(np.diff(motion.t)) < 1e-9
    assert error_ahead([motion], ESDIRK4, 0.2) == pytest.approx(SAFE * of_one(1.0, 0.2, 50.0), rel=0.5)


def test_increments_of_a_free_hub_do_not_run_away() -> None:
    """A stage that is d off is d/h off in speed; with nothing that brings it back, n of these are n²d at the end."""
    settings, ahead = Settings(({"theory": "reissner"},), 6, 3, "esdirk4", tolerance=1e-3), Ahead(1e-2)
    ahead.linear, ahead.length = vibration(2.0), 10.0
    held = ahead.stepped(settings, 4e-3)
    ahead.free = True
    free = ahead.stepped(settings, 4e-3)
    assert held.step == free.step
    assert held.step is not None
    assert free.increment is not None
    assert held.increment is not None
    number = 100.0 / held.step
    assert free.increment * number**2 == pytest.approx(FREE * 1e-2 * 2.0 / 10.0, rel=0.01)
    assert held.increment > 10 * free.increment


def test_nothing_is_planned_where_nothing_moves() -> None:
    still = Motion(np.linspace(0.0, 1.0, 1000), np.zeros((1000, 2)))
    assert plan([still], 1e-3, [ESDIRK4]) is None
    assert error_ahead([], ESDIRK4, 0.1) is None


def test_elements_grow_by_the_order_of_a_frequency() -> None:
    """ε ω T of one vibration, which falls by 2⁶ with twice the cubic elements."""
    mesh = MeshAhead(np.array([1.0, 50.0]), np.array([1e-4, 2e-4]), np.array([False, False]), 6, 3)
    off = mesh.error(vibration(1.0))
    assert off == pytest.approx(SAFE * 1e-4 * 1.0 * 100.0, rel=0.1)
    assert mesh.error(vibration(1.0), 2.0) == pytest.approx(off / 64, rel=1e-2)  # a little is off by as much as can be
    growth, left = mesh.growth([vibration(1.0)], off / 60)
    assert left <= off / 60
    assert growth == pytest.approx(60 ** (1 / 6), rel=0.1)


def test_cells_of_a_plate_become_as_few_as_its_motion_allows() -> None:
    """Of 40 × 8 quadratic cells, whose errors fall with n⁴, four stay along the longer edge at least."""
    mesh = MeshAhead(np.array([1.0, 50.0]), np.array([1e-8, 2e-8]), np.array([False, False]), (40, 8), 2)
    off = mesh.error(vibration(1.0))
    growth, left = mesh.growth([vibration(1.0)], 100 * off)
    assert 0.3 <= growth <= 0.4
    assert left <= 100 * off
    assert mesh.growth([vibration(1.0)], 1.0)[0] * 40 >= 4


def test_what_a_jump_has_struck_counts_unseen() -> None:
    """A vibration that the motion itself does not show: resolved by short steps, lost by long ones."""
    t = np.linspace(0.0, 100.0, 2001)
    motion = Motion(t, np.cos(t)[:, None], ((500.0, 0.01),))
    short, long = (motion.error(ESDIRK4, h) - Motion(t, motion.tips).error(ESDIRK4, h) for h in (1e-4, 0.1))
    assert long == pytest.approx(LOST * 0.01, rel=1e-2)
    assert short == pytest.approx(0.01 * SAFE * of_one(500.0, 1e-4, 100.05), rel=1e-2)


def test_the_sum_of_an_error_is_that_of_its_parts() -> None:
    """However large the part was that another one stands for now: what it was leaves no round-off."""
    error = {"time": 1e9, "space": 1e-7, "model": None, "total": 1e9 + 1e-7}
    put(error, "time", 3e-8)
    assert error == {"time": 3e-8, "space": 1e-7, "model": None, "total": 3e-8 + 1e-7}
