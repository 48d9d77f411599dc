"""Damping by mode: modes at rest have the ratios they are given, motions decay by them, and nobody forgets them."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import scipy.linalg as sl

from rotfem import InputError, Problem, SceneError, campbell, modes, run
from rotfem.analysis.march import March, Steps
from rotfem.analysis.sensitivity import sensitivities
from rotfem.errors import ComputationError
from rotfem.numerics.newton import Newton
from rotfem.registry import schemes
from rotfem.results.modes import ModesResult
from rotfem.scene import Scene
from tests.beams import STRUCTURE

Array = npt.NDArray[np.float64]

SECTION = {"EA": 2.8e7, "GA2": 1e7, "GA3": 1e7, "GJ": 1e4, "EI2": 1.4e4, "EI3": 2.8e4, "mass_per_length": 1.2}
SPATIAL = {"type": "spatial_beam", "length": 10.0, "section": SECTION | {"rotary_inertia2": 6e-4}}
PLATE = {"type": "plate", "length": 1.0, "width": 0.5, "thickness": 0.02, "E": 7e10, "nu": 0.3, "rho": 2700.0}

HUB = {"type": "torque", "hub_inertia": 500.0, "pulses": [[0.0, 0.3, 100.0]]}

#: How far the eigensolver may be off: the beam's stiffnesses are 1e5 times apart, which costs as many digits.
EXACT = 1e-10


def beam(modal: Any, speed: float = 0.0, theory: str = "linear", **changes: Any) -> Scene:
    """Return a planar beam of a few elements with damping by mode."""
    tables: dict[str, Any] = {
        "structure": STRUCTURE | {"damping": {"modal": modal}},
        "motion": {"type": "constant", "speed": speed},
        "mesh": {"elements": 4, "degree": 2},
        "model": {"theory": theory},
    }
    return Scene.from_dict(tables).replace(changes)


def by_label(result: ModesResult) -> dict[str, float]:
    """Return label ↦ damping ratio."""
    return {row["label"]: row["damping"] for row in result.rows}


# --- at rest ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("theory", ["linear", "reissner"])
def test_ratios_in_order(theory: str) -> None:
    """Those of the list, of heavily damped modes too; the modes beyond it, and those of ratio 0, are undamped."""
    result = modes(beam([0.01, 0.0, 0.6, 0.02], theory=theory, **{"modes.count": 7}))
    np.testing.assert_allclose(result.damping, [0.01, 0.0, 0.6, 0.02, 0.0, 0.0, 0.0], rtol=0, atol=EXACT)


def test_a_first_mode_far_below_the_others() -> None:
    """A tip mass of 1e3 times the beam's: ω² = 3EI/(mL³), which is no motion that nothing holds, on a hub neither."""
    heavy = beam([0.05], **{"structure.tip_mass": 1.2e4})
    first = modes(heavy).rows[0]
    assert first["frequency"] == pytest.approx(np.sqrt(3 * 1.4e4 / (1.2e4 * 1e3)), rel=2e-3)
    assert first["damping"] == pytest.approx(0.05, rel=1e-6)
    free = heavy.replace({"structure.damping": {}, "motion": HUB | {"hub_inertia": 1e12}})
    rows = modes(free).rows
    assert [row["label"] for row in rows[:2]] == ["rigid body", "1st in-plane, a"]
    assert rows[1]["frequency"] == pytest.approx(first["frequency"], rel=3e-3)


def test_families_are_counted_by_themselves() -> None:
    """A number is one ratio, and may be in per cent; a list has the axial mode where its frequency stands."""
    families = by_label(modes(beam({"lag": [0.01, 0.02], "axial": "4 %"}, **{"modes.count": 9})))
    place = list(families).index("1st axial")
    listed = by_label(modes(beam([0.01, 0.02] + [0.0] * (place - 2) + [0.04], **{"modes.count": 9})))
    assert families.keys() == listed.keys()
    for label, ratio in families.items():
        assert ratio == pytest.approx(listed[label], abs=EXACT), label
    assert families["1st axial"] == pytest.approx(0.04, abs=EXACT)


@pytest.mark.parametrize("EI3", [2.8e4, 1.4e4])
def test_families_of_a_spatial_beam(EI3: float) -> None:
    """With EI2 = EI3 shapes of flap and lag can be turned at will, and are turned so that each is of one family."""
    modal = {"flap": [0.01, 0.02], "lag": [0.03], "torsion": [0.04]}
    structure = SPATIAL | {"section": SPATIAL["section"] | {"EI3": EI3, "rotary_inertia3": 6e-4}}  # type: ignore[operator]
    tables = {"structure": structure | {"damping": {"modal": modal}}, "motion": {"type": "constant", "speed": 0.0}}
    model = {"model": {"theory": "consistent_linear"}, "mesh": {"elements": 4, "degree": 2}, "modes": {"count": 14}}
    found = modes(Scene.from_dict(tables | model)).damping
    np.testing.assert_allclose(np.sort(found)[-4:], [0.01, 0.02, 0.03, 0.04], rtol=0, atol=EXACT)
    np.testing.assert_allclose(np.sort(found)[:-4], 0.0, rtol=0, atol=EXACT)


def test_plate() -> None:
    structure = PLATE | {"damping": {"modal": {"bending": [0.01, 0.02, 0.0, 0.03], "in-plane": [0.05]}}}
    tables = {"structure": structure, "motion": {"type": "constant", "speed": 0.0}, "model": {"theory": "linear"}}
    found = by_label(modes(Scene.from_dict(tables | {"mesh": {"elements": [4, 2]}, "modes": {"count": 7}})))
    expected = {"1st bending": 0.01, "1st torsion": 0.02, "2nd torsion": 0.03, "1st in-plane": 0.05}
    for label, ratio in found.items():
        assert ratio == pytest.approx(expected.get(label, 0.0), abs=EXACT), label


# --- spinning ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("motion", [{"type": "constant", "speed": 6.0}, HUB | {"speed": 6.0}])
def test_spinning_modes_are_those_of_the_full_matrices(motion: dict[str, Any]) -> None:
    """LAPACK with C written out, of a fixed and of a free hub: to its own round-off."""
    scene = beam([0.02, 0.03], theory="reissner", **{"motion": motion, "structure.damping.kelvin_voigt": 1e-4})
    pencil = modes(scene).spinning.pencil
    n = pencil.K.getSize()[0]
    M, C, K = (np.real(pencil.apply(A, np.eye(n))) for A in (pencil.M, pencil.C, pencil.K))
    first, second = sl.block_diag(np.eye(n), M), np.block([[np.zeros((n, n)), np.eye(n)], [-K, -C]])
    values = sl.eigvals(second, first)
    values = values[np.isfinite(values)]
    for value in pencil.solve(4).values[1:4]:
        assert np.min(np.abs(values - value)) < 1e-7 * abs(value)


def test_branches_over_speed_are_damped() -> None:
    """The branches start with the ratios given, and go on with those of the modes at one speed."""
    scene = beam([0.02, 0.03, 0.0], speed=4.0, theory="consistent_linear", **{"modes.count": 3})
    result = campbell(scene, [0.0, 4.0, 8.0])
    np.testing.assert_allclose(result.damping[0], [0.02, 0.03, 0.0], rtol=0, atol=EXACT)
    np.testing.assert_allclose(modes(scene).damping, result.damping[1], atol=1e-8)


# --- histories --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("scheme", "tolerance"), [("esdirk4", 1e-5), ("generalised_alpha", 5e-3)])
def test_release_decays_by_the_ratio(scheme: str, tolerance: float) -> None:
    """All modes but the first are damped by a ratio of 0.9, so after a while the tip moves as e^{−ζωt} cos(ω_d t + φ).

    Steps are a hundredth of a period. Where the motion is that, u(t + T) + e^{−2ζωT} u(t − T) = 2 e^{−ζωT} cos(ω_d T)
    u(t) for any T; the tolerance of a scheme of second order is (ωh)²/12 of the phase over the time.
    """
    ratio, count = 0.03, 10
    scene = beam([ratio] + [0.9] * (count - 1))
    omega = modes(scene).frequencies[0] / np.sqrt(1 - ratio**2)
    period = 2 * np.pi / omega
    time = {"time": {"end": 6 * period, "step": period / 100, "scheme": scheme}}
    model = {"initial": {"tip_displacement": 0.01}, "model": {"theory": "linear"}}
    u = run(scene.replace(time | model)).history["tip_u2"]
    start, T = 300, 25
    lapse = T * period / 100
    before, now, after = (u[start + k * T : 501 + k * T] for k in (-1, 0, 1))
    decay = np.exp(-ratio * omega * lapse)
    expected = 2 * decay * np.cos(omega * np.sqrt(1 - ratio**2) * lapse) * now - decay**2 * before
    assert np.max(np.abs(after - expected)) < tolerance * np.max(np.abs(now))


def test_spinning_beam_loses_what_damping_takes() -> None:
    """The scheme keeps the balance of every step, so the Jacobi integral loses h v·C v with the mean v, to round-off.

    A dead force that starts at once sets the beam in motion; its work is in the integral.
    """
    scene = beam([0.05, 0.02], speed=3.0, theory="reissner", **{"loads.tip_force": [0.0, 50.0]})
    system, step = Problem.of(scene).system(), 0.02
    march = March(system, schemes["energy_conserving"](), Steps(end=2.0, step=step), Newton())
    energies, lost, last = [], 0.0, system.zeros()
    for state in march:
        system.set_time(state.t)
        system.set_state(state.q, state.v)
        energies.append(system.energies()["jacobi"])
        lost += float(np.sum(system.by_mode.along(state.q - last) ** 2)) / step
        last = state.q.copy()
    assert lost > 1.0
    assert energies[0] - energies[-1] == pytest.approx(lost, rel=1e-9)


def test_schemes_agree_on_a_free_hub() -> None:
    """Bordered equations by blocks: to the error of the second order."""
    scene = beam([0.05, 0.05], theory="reissner", motion=HUB)
    tips = {}
    for scheme, step in (("esdirk4", 0.01), ("generalised_alpha", 0.0025)):
        time = {"time": {"end": 0.5, "step": step, "scheme": scheme, "output_step": 0.02}}
        tips[scheme] = run(scene.replace(time)).history["tip_u2"]
    undamped = run(scene.replace(time | {"structure.damping": {}})).history["tip_u2"]
    size = np.max(np.abs(tips["esdirk4"]))
    assert np.max(np.abs(undamped - tips["esdirk4"])) > 2e-2 * size
    for name, tip in tips.items():
        assert np.max(np.abs(tip - tips["esdirk4"])) < 1e-3 * size, name


# --- what it is part of, and what is refused --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("modal", "key", "message"),
    [
        (-0.1, "modal", "at least 0"),
        ([0.01, 48.0], "modal.1", "less than 1"),
        ({"lag": [0.01, True]}, "modal.lag.1", "number"),
    ],
)
def test_ratios_that_are_none(modal: Any, key: str, message: str) -> None:
    with pytest.raises(SceneError, match=message) as caught:
        beam(modal)
    assert caught.value.key == f"structure.damping.{key}"


@pytest.mark.parametrize(
    ("modal", "key", "message"),
    [
        ({"flap": [0.01]}, "modal.flap", "planar_beam has no such family; allowed: axial, lag"),
        ([0.01] * 60, "modal", "more ratios than there are modes on this mesh"),
        ({"axial": [0.01] * 40}, "modal.axial", "more ratios than there are axial modes on this mesh: "),
    ],
)
def test_modes_that_are_none(modal: Any, key: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        modes(beam(modal))
    assert caught.value.key == f"structure.damping.{key}"


def test_what_cannot_have_it() -> None:
    """The inertial frame, sensitivities, and rotations beyond those of small motions."""
    with pytest.raises(SceneError, match='"rotating"'):
        Problem.of(beam(0.01, theory="reissner", **{"model.frame": "inertial"}))
    result = modes(beam(0.01))
    with pytest.raises(InputError, match="sensitivities"):
        sensitivities(result.analysis, result.spinning)
    with pytest.raises(ComputationError, match="too large for damping by mode"):
        result.analysis.system.count_rotations_from(object())
