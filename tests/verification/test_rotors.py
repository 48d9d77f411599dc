"""Shafts with disks: whirl and critical speeds against the four-degree-of-freedom rotor of the textbooks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from scipy.integrate import solve_ivp
from scipy.linalg import eig
from scipy.optimize import brentq, root

import rotfem
from rotfem.commands.modes import analysis_of
from rotfem.commands.problem import Problem
from rotfem.mechanics.problem import inactive_unknowns
from tests.figures import check

pytestmark = pytest.mark.usefixtures("unestimated")

EI, LENGTH, MASS, POLAR, DIAMETRAL = 1649.0, 0.4, 5.0, 0.04, 0.02


def overhung(**changes: Any) -> dict[str, Any]:
    """Return a disk on the end of a cantilevered shaft that has next to no mass and no shear."""
    stiff = EI / LENGTH**2
    section = {"EA": 1e3 * stiff, "GA2": 1e6 * stiff, "GA3": 1e6 * stiff, "GJ": EI, "EI2": EI, "EI3": EI}
    return {
        "structure": {
            "type": "spatial_beam",
            "length": LENGTH,
            "tip_mass": MASS,
            "tip_inertia": [[POLAR, 0, 0], [0, DIAMETRAL, 0], [0, 0, DIAMETRAL]],
            "section": section | {"mass_per_length": 1e-4},
        },
        "motion": {"type": "constant", "speed": 100.0, "axis": [1, 0, 0]},
        "mesh": {"elements": 2, "degree": 3},
        "modes": {"count": 6},
    } | changes


def disk_on_massless_shaft(speed: float) -> np.ndarray:
    """Return the whirl speeds of z e^{iωt}, negative backward, rad/s: M z̈ − iΩ G ż + K z = 0, z = (u, θ) of the disk.

    Source: Genta 2005, section 4.3 (Stodola–Green rotor), with the stiffness of a cantilever's end.
    """
    K = EI / LENGTH**3 * np.array([[12.0, -6.0 * LENGTH], [-6.0 * LENGTH, 4.0 * LENGTH**2]])
    M, G = np.diag([MASS, DIAMETRAL]), np.diag([0.0, POLAR])
    zero, one = np.zeros((2, 2)), np.eye(2)
    values = eig(np.block([[zero, one], [K, speed * G]]), np.block([[one, zero], [zero, M]]), right=False)
    return np.sort(values.real)


@pytest.mark.parametrize("axis", [1, -1])
@pytest.mark.parametrize("speed", [30.0, 150.0])
def test_whirl_of_an_overhung_disk(speed: float, axis: int) -> None:
    """Below and above the forward critical speed: 1e-5, the shaft's own mass and shear."""
    scene = overhung(motion={"type": "constant", "speed": speed, "axis": [axis, 0, 0]})
    rows = [row for row in rotfem.modes(scene).rows if row["whirl"] != "standing"][:4]
    signs = {"forward": 1.0, "backward": -1.0}
    found = sorted(signs[row["whirl"]] * row["frequency"] for row in rows)
    np.testing.assert_allclose(found, disk_on_massless_shaft(speed), rtol=1e-5)
    assert {row["label"] for row in rows} == {f"{n} {way} whirl" for n in ("1st", "2nd") for way in signs}


@pytest.mark.parametrize("count", [2, 3, 5])
def test_critical_speeds_of_an_overhung_disk(count: int) -> None:
    """The synchronous ones come first, and none of their branches is lost, however few modes are wanted: 1e-5."""
    diagram = rotfem.campbell(overhung(modes={"count": count}), "0:200:9")
    # ω(Ω) = ±Ω: det(K − Ω² (M ∓ G)) = 0.
    K = EI / LENGTH**3 * np.array([[12.0, -6.0 * LENGTH], [-6.0 * LENGTH, 4.0 * LENGTH**2]])
    expected = []
    for kind, sign in (("backward", -1.0), ("forward", 1.0)):
        squares = eig(K, np.diag([MASS, DIAMETRAL - sign * POLAR]), right=False).real
        expected += [(kind, float(np.sqrt(w))) for w in squares if 0.0 < w < 200.0**2]
    found = diagram.critical_speeds
    assert [c.kind for c in found[: len(expected)]] == [kind for kind, _ in expected] == ["backward", "forward"]
    assert all(c.kind == "per_rev" for c in found[len(expected) :])
    np.testing.assert_allclose([c.speed for c in found[:2]], [speed for _, speed in expected], rtol=1e-5)
    assert [c.label for c in found[:2]] == ["1st backward whirl", "1st forward whirl"]
    assert not diagram.summary["ambiguous"]
    assert all(b["frequency_last"] is not None for b in diagram.summary["branches"])
    assert len(set(diagram.labels)) == count


def test_diagram_in_the_fixed_frame() -> None:
    """The figure has every branch by name and the synchronous speeds."""
    diagram = rotfem.campbell(overhung(modes={"count": 4}), "0:200:5")
    (draw,) = diagram.drawings().values()
    figure = draw()
    check(figure)
    assert set(diagram.labels) <= {text.get_text() for text in figure.axes[0].texts}
    circles = [line for line in figure.axes[0].lines if line.get_marker() == "o"][-1].get_xydata()[:2]
    assert [c[0] for c in circles] == [c.speed for c in diagram.critical_speeds[:2]]
    np.testing.assert_allclose(*circles.T)  # whirl as fast as the spin


def test_a_shaft_above_its_critical_speed_is_where_it_was() -> None:
    """In the fixed frame nothing pushes it, at any speed: it is stable, and no other equilibrium is met."""
    found = rotfem.modes(overhung(motion={"type": "constant", "speed": 150.0, "axis": [1, 0, 0]}))
    assert found.summary["stability"]["stable"]
    assert not found.warnings


def test_critical_speed_is_said_by_modes() -> None:
    """At its critical speed a shaft whirls forward as fast as it spins."""
    speed = next(
        c.speed for c in rotfem.campbell(overhung(modes={"count": 2}), "0:200:9").critical_speeds if c.kind == "forward"
    )
    motions = ({"type": "constant", "speed": s, "axis": [1, 0, 0]} for s in (speed, 90.0))
    at, off = (rotfem.modes(overhung(motion=motion)) for motion in motions)
    assert any(text.startswith("critical speed: 1st forward whirl") for text in at.summary["warnings"])
    assert not any("critical speed" in text for text in off.summary["warnings"])


def test_left_vectors_of_double_modes_are_independent() -> None:
    """Two modes of one frequency have two left vectors; one and the same twice loses a branch."""
    scene = rotfem.Scene.from_dict(overhung(modes={"count": 5}))
    spinning = analysis_of(scene, Problem.of(scene).spinning(), MPI.COMM_WORLD).at(0.0, 8)
    values, left = spinning.pairs.values, spinning.pairs.left
    twins = [i for i in range(len(values) - 1) if abs(values[i + 1] - values[i]) < 1e-6 * abs(values[i])]
    assert twins
    for i in twins:
        pair = left[:, i : i + 2] / np.linalg.norm(left[:, i : i + 2], axis=0)
        assert np.linalg.svd(pair, compute_uv=False)[-1] > 1e-3


# --- supports ---------------------------------------------------------------------------------------------------------


def shaft_on_bearings(stiffness: Any, damping: Any = 0.0, **changes: Any) -> dict[str, Any]:
    """Return a disk in the middle of a shaft without mass, shear and stretch, that two bearings hold at its ends."""
    section = {"EA": 1e8, "GA2": 1e9, "GA3": 1e9, "GJ": 1e3, "EI2": EI, "EI3": EI, "mass_per_length": 1e-4}
    structure = {"type": "spatial_beam", "length": 1.0, "section": section, "masses": [{"x": 0.5, "mass": 10.0}]}
    supports = [{"x": x, "stiffness": stiffness, "damping": damping} for x in (0.0, 1.0)]
    return {
        "structure": structure | {"supports": supports, "root": {"driven": True}},
        "motion": {"type": "constant", "speed": 50.0, "axis": [1, 0, 0]},
        "mesh": {"elements": 2, "degree": 3},
        "modes": {"count": 2},
    } | changes


def test_jeffcott_rotor() -> None:
    """On rigid bearings the disk whirls at √(48 EI/(m L³)), both critical speeds: 5e-5, as stiff as they are."""
    diagram = rotfem.campbell(shaft_on_bearings(1e9), "0:150:6")
    expected = np.sqrt(48.0 * EI / 10.0)
    assert sorted(c.kind for c in diagram.critical_speeds[:2]) == ["backward", "forward"]
    np.testing.assert_allclose([c.speed for c in diagram.critical_speeds[:2]], expected, rtol=5e-5)
    whirl = np.array([row["frequency"] for row in diagram.rows if row["whirl"] != "standing"])
    np.testing.assert_allclose(whirl, expected, rtol=5e-5)


@pytest.mark.parametrize("theory", ["reissner", "consistent_linear"])
def test_unequal_shaft_is_unstable_between_its_two_frequencies(theory: str) -> None:
    """√(48 EI/(m L³)) of both directions bound one range (Genta 2005, chapter 6): 1e-4, the bearings and the mesh."""
    scene = shaft_on_bearings(1e9, model={"theory": theory})
    scene["structure"]["section"] |= {"EI3": 1.3 * EI}
    (found,) = rotfem.campbell(scene, "75:115:5", orders=0).instabilities
    assert found.kind == "static instability"
    np.testing.assert_allclose([found.speed, found.until], np.sqrt(np.array([1.0, 1.3]) * 48.0 * EI / 10.0), rtol=1e-4)


@pytest.mark.parametrize("theory", ["reissner", "consistent_linear"])
@pytest.mark.parametrize("speed", [0.0, 40.0, 200.0])
def test_damped_bearings(theory: str, speed: float) -> None:
    """Bearings that yield: the eigenvalues in the fixed frame do not depend on the speed, and none grows.

    Closed form: half the disk on the shaft's spring k_s = 24 EI/L³ in series with a bearing k + cλ,
    m/2 λ² (k_s + k + cλ) + k_s (k + cλ) = 0; 5e-5, the shaft's own mass and shear.
    """
    k, c, k_s, half = 2e4, 150.0, 24.0 * EI, 5.0
    motion = {"type": "constant", "speed": speed, "axis": [1, 0, 0]}
    rows = rotfem.modes(shaft_on_bearings(k, c, motion=motion, model={"theory": theory})).rows
    roots = np.roots([half * c, half * (k_s + k), k_s * c, k_s * k])
    expected = roots[np.argmax(roots.imag)]
    for row in rows:
        np.testing.assert_allclose([row["frequency"], row["growth"]], [expected.imag, expected.real], rtol=5e-5)


@pytest.mark.parametrize("theory", ["reissner", "consistent_linear"])
def test_damping_by_mode_of_a_shaft_is_external(theory: str) -> None:
    """The modes at rest on their bearings have the ratio, and a Jeffcott rotor keeps it at any speed: 1e-4."""
    for speed in (0.0, 200.0):
        motion = {"type": "constant", "speed": speed, "axis": [1, 0, 0]}
        scene = shaft_on_bearings(2e4, motion=motion, model={"theory": theory})
        scene["structure"]["damping"] = {"modal": 0.02}
        np.testing.assert_allclose([row["damping"] for row in rotfem.modes(scene).rows], 0.02, rtol=1e-4)


def test_cross_coupling_makes_forward_whirl_grow() -> None:
    """[[k, q], [−q, k]]: m/2 λ² + K z with K = k_s(k − iq)/(k_s + k − iq) in z = y + iz; the pair is λ = ±√(−2K/m)."""
    k, q, k_s, half = 2e4, 500.0, 24.0 * EI, 5.0
    rows = rotfem.modes(shaft_on_bearings([[k, q], [-q, k]])).rows
    K = k_s * (k - 1j * q) / (k_s + k - 1j * q)
    root = np.sqrt(-K / half)
    growing = root if root.real > 0 else -root
    by_whirl = {row["whirl"]: row for row in rows}
    grows = "forward" if growing.imag > 0 else "backward"
    assert grows == "forward"
    for way, sign in ((grows, 1.0), ("backward", -1.0)):
        row = by_whirl[way]
        np.testing.assert_allclose(row["growth"], sign * growing.real, rtol=2e-4)
        np.testing.assert_allclose(row["frequency"], abs(growing.imag), rtol=5e-5)


def test_damped_bearings_of_a_shaft_that_differs_by_direction() -> None:
    """In the rotating frame dampers at rest push by the turn of the frame, too: as in the exact theory, 1e-6."""
    scene = shaft_on_bearings(2e4, 100.0, modes={"count": 4})
    scene["structure"]["section"] |= {"EI3": 1.3 * EI, "mass_per_length": 1.0}
    one, other = (rotfem.modes(scene | {"model": {"theory": t}}).rows for t in ("reissner", "consistent_linear"))
    for name in ("frequency", "growth"):
        np.testing.assert_allclose(*([row[name] for row in rows] for rows in (one, other)), rtol=1e-6)


def test_cross_coupling_leaves_no_plane() -> None:
    """At rest a shaft stays in the plane of its load, unless its bearings couple the two directions."""
    still = {"type": "constant", "speed": 0.0, "axis": [1, 0, 0]}
    for coupling, inactive in ((0.0, {"u3", "theta1", "theta2"}), (500.0, set())):
        stiffness = [[2e4, coupling], [-coupling, 2e4]]
        tables = shaft_on_bearings(stiffness, motion=still, loads={"tip_force": [0.0, 1.0, 0.0]})
        assert set(inactive_unknowns(Problem.of(rotfem.Scene.from_dict(tables)))) == inactive


def planes_on_bearing(stiffness: np.ndarray, damping: np.ndarray, speed: float) -> np.ndarray:
    """Return λ of a disk on a cantilevered massless shaft with a bearing at the disk, 1/s, those with Im λ > 0.

    M q̈ + (C + ΩG) q̇ + K q = 0 of q = (y, −θ_z, z, θ_y) in the fixed frame (Genta 2005, section 4.3): a turning disk
    couples the two planes by its polar moment of inertia, the bearing adds to the displacements y and z.
    """
    plane = EI / LENGTH**3 * np.array([[12.0, -6.0 * LENGTH], [-6.0 * LENGTH, 4.0 * LENGTH**2]])
    zero, G = np.zeros((2, 2)), np.diag([0.0, POLAR])
    M = np.diag([MASS, DIAMETRAL, MASS, DIAMETRAL])
    K, C = np.block([[plane, zero], [zero, plane]]), speed * np.block([[zero, G], [-G, zero]])
    displaced = np.ix_([0, 2], [0, 2])
    K[displaced] += stiffness
    C[displaced] += damping
    values = eig(
        np.block([[np.zeros((4, 4)), np.eye(4)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]]), right=False
    )
    return np.array(sorted(values[values.imag > 0.0], key=abs))


BEARING = np.array([[3e4, 4e3], [4e3, 9e4]]), np.array([[20.0, 0.0], [0.0, 60.0]])
CROSS_COUPLED = np.array([[3e4, 7e3], [-2e3, 9e4]]), np.array([[20.0, 3.0], [5.0, 60.0]])


@pytest.mark.parametrize("axis", [1, -1])
@pytest.mark.parametrize("theory", ["reissner", "consistent_linear"])
@pytest.mark.parametrize("bearing", [BEARING, CROSS_COUPLED])
def test_bearings_that_differ_by_direction(bearing: tuple[np.ndarray, np.ndarray], theory: str, axis: int) -> None:
    """Eigenvalues in the fixed frame, below and above critical speeds: 2e-5, the shaft's own mass and shear."""
    for speed in (40.0, 200.0):
        scene = overhung(motion={"type": "constant", "speed": speed, "axis": [axis, 0, 0]}, model={"theory": theory})
        stiffness, damping = (A.tolist() for A in bearing)
        scene["structure"]["supports"] = [{"x": LENGTH, "stiffness": stiffness, "damping": damping}]
        found = rotfem.modes(scene)
        rows = [row for row in found.rows if row["whirl"] != "standing"][:4]
        expected = planes_on_bearing(*bearing, axis * speed)
        np.testing.assert_allclose([row["frequency"] for row in rows], expected.imag, rtol=2e-5)
        size = np.max(np.abs(expected.real))
        np.testing.assert_allclose([row["growth"] for row in rows], expected.real, rtol=2e-5, atol=2e-5 * size)
        assert found.summary["frame"] == "fixed"


def test_critical_speeds_on_bearings_that_differ_by_direction() -> None:
    """Both whirls of a mode are critical where their frequency is Ω, one backward, one forward: 2e-5."""
    scene = overhung(modes={"count": 4})
    scene["structure"]["supports"] = [{"x": LENGTH, "stiffness": BEARING[0].tolist()}]
    diagram = rotfem.campbell(scene, "0:300:7")
    found = [c for c in diagram.critical_speeds if c.kind != "per_rev"]
    assert [c.kind for c in found[:2]] == ["backward", "forward"]
    assert [c.label for c in found[:2]] == ["1st backward whirl", "1st forward whirl"]
    for c in found:
        whirl = planes_on_bearing(BEARING[0], np.zeros((2, 2)), c.speed).imag
        assert np.min(np.abs(whirl - c.speed)) < 2e-5 * c.speed
    assert set(diagram.drawings()) == {"campbell.png"}


def test_nearly_isotropic_bearings_have_the_modes_of_isotropic_ones() -> None:
    """1e-7, the difference of the bearings."""
    one, other = (
        rotfem.modes(shaft_on_bearings(stiffness, 30.0)).rows
        for stiffness in (2e4, [[2e4, 0.0], [0.0, 2e4 * (1 + 1e-9)]])
    )
    fixed = [sorted((row["frequency"], row["growth"]) for row in rows) for rows in (one, other)]
    np.testing.assert_allclose(*fixed, rtol=1e-7)


def test_bearings_and_a_shaft_that_both_differ_by_direction_are_refused() -> None:
    """Their equations have periodic coefficients in every frame, which is said."""
    scene = shaft_on_bearings([[2e4, 0.0], [0.0, 1e4]])
    scene["structure"]["section"] = scene["structure"]["section"] | {"EI2": 2 * EI}
    for compute in (rotfem.run, rotfem.modes, rotfem.explain, lambda s: rotfem.campbell(s, [0.0, 1.0])):
        with pytest.raises(rotfem.SceneError, match=r"structure\.supports.*periodic coefficients"):
            compute(scene)


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"supports": [{"x": 0.5, "stiffness": 1.0, "frame": "fixed"}], "root": {}}, "structure.supports.0.frame"),
        ({"supports": [{"x": 0.0, "stiffness": 1.0}]}, "structure.root.driven"),
        ({"supports": [{"x": 2.0, "stiffness": 1.0}]}, "structure.supports.0.x"),
        ({"supports": [{"x": 0.5}]}, "structure.root.driven"),
        ({"supports": [{"x": 0.5, "stiffness": [[100.0, 1e7], [200.0, 2e7]]}]}, "structure.supports.0.stiffness"),
        ({"precone": 0.1}, "structure.supports"),
        ({"root": {"driven": True, "lag_stiffness": 1.0}}, "structure.root.driven"),
    ],
)
def test_supports_that_cannot_be(change: dict[str, Any], key: str) -> None:
    tables = shaft_on_bearings(1.0)
    tables = tables | {"structure": tables["structure"] | change}
    if "frame" in str(change):
        tables["motion"] = {"type": "constant", "speed": 5.0}
    with pytest.raises(rotfem.SceneError, match=key):
        rotfem.Scene.from_dict(tables)


# --- unbalance --------------------------------------------------------------------------------------------------------


def whirl_of_unbalance(bearing: complex, speed: float, moment: float) -> tuple[complex, complex]:
    """Return z of disk and bearings in the rotor (Genta 2005, chapter 4): half the disk on the shaft's k_s."""
    k_s, half = 24.0 * EI, 5.0
    disk = 0.5 * moment * speed**2 / (k_s * bearing / (k_s + bearing) - half * speed**2)
    return disk, disk * k_s / (k_s + bearing)


@pytest.mark.parametrize("axis", [1, -1])
def test_unbalance_of_a_jeffcott_rotor(axis: int) -> None:
    """Amplitude and phase of disk and bearings, forces on bearings, below and above the peak: 1e-4, as `shaft`."""
    k, c, moment, phase = 2e4, 150.0, 1e-3, 0.4
    unbalance = {"unbalance": [{"x": 0.5, "kg_m": moment, "phase": phase}]}
    motion = {"type": "constant", "speed": 1.0, "axis": [axis, 0, 0]}
    found = rotfem.unbalance(shaft_on_bearings(k, c, loads=unbalance, motion=motion), [20.0, 50.0, 80.0])
    for i, speed in enumerate(found.speeds):
        disk, end = whirl_of_unbalance(k + 1j * speed * c, speed, moment)
        for x, expected in ((0.5, disk), (0.0, end), (1.0, end)):
            of = found.at(x)
            turned = expected * np.exp(1j * axis * phase)  # seen along the spin the phase counts the other way
            z = of["u2"][i] * np.exp(1j * of["u2_phase"][i])
            np.testing.assert_allclose(z, turned, rtol=1e-4)
            np.testing.assert_allclose(of["u3"][i] * np.exp(1j * of["u3_phase"][i]), -1j * axis * turned, rtol=1e-4)
            np.testing.assert_allclose(of["major"][i], abs(expected), rtol=1e-4)
        force = (k + 1j * speed * c) * end
        np.testing.assert_allclose(found.at(0.0)["f2"][i], abs(force), rtol=1e-4)


def test_peak_of_an_unbalance_has_its_amplification_factor() -> None:
    """N_c/(N₂ − N₁) at 0.707 of the peak, of the closed form on a fine grid: 1e-3; separation from 60 to 70 rad/s."""
    k, c = 2e4, 300.0
    scene = shaft_on_bearings(k, c, loads={"unbalance": [{"x": 0.5, "kg_m": 1e-3}]})
    found = rotfem.unbalance(scene, "5:120:24", operating=(60.0, 70.0))
    (peak,) = [p for p in found.summary["peaks"] if p["x"] == 0.5]
    fine = np.linspace(5.0, 120.0, 200001)
    sizes = np.abs([whirl_of_unbalance(k + 1j * s * c, s, 1e-3)[0] for s in fine])
    top = int(np.argmax(sizes))
    above = fine[sizes > np.sqrt(0.5) * sizes[top]]
    np.testing.assert_allclose(peak["speed"], fine[top], rtol=1e-4)
    np.testing.assert_allclose(peak["amplification"], fine[top] / (above[-1] - above[0]), rtol=1e-3)
    np.testing.assert_allclose(peak["margin"], max(60.0 - fine[top], 0.0) / 60.0, atol=1e-4)
    for draw in found.drawings().values():
        check(draw())


def test_peaks_of_an_undamped_shaft_have_no_height() -> None:
    """Which is said; of one that bearings damp it is not."""
    for damping, said in ((0.0, True), (100.0, False)):
        scene = shaft_on_bearings(2e4, damping, loads={"unbalance": [{"x": 0.5, "kg_m": 1e-3}]})
        warnings = rotfem.unbalance(scene, [30.0, 50.0]).summary["warnings"]
        assert any("nothing damps" in text for text in warnings) == said


@pytest.mark.parametrize("theory", ["linear", "reissner"])
def test_a_history_ends_in_the_whirl_of_its_unbalance(theory: str) -> None:
    """Bearings that differ by direction and cross-couple, an offset mass: the end of a history is the orbit, 1e-3."""
    k, c = [[2e4, 3e3], [-2e3, 3e4]], [[300.0, 0.0], [0.0, 400.0]]
    scene = shaft_on_bearings(k, c, model={"theory": theory}, time={"end": 0.8, "step": 0.001})
    scene["structure"]["masses"] = [{"x": 0.5, "mass": 10.0, "offset": [0.0, 1e-4, 2e-4]}]
    scene["structure"]["supports"][1]["tilt_stiffness"] = 0.1 * EI
    result = rotfem.run(scene)
    (row,) = [row for row in rotfem.unbalance(scene, [49.0, 50.0]).rows if row["speed"] == 50.0 and row["x"] == 1.0]
    turn = np.exp(1j * 50.0 * 0.8)
    for name in ("u2", "u3"):
        expected = (row[name] * np.exp(1j * row[f"{name}_phase"]) * turn).real
        np.testing.assert_allclose(result.tip[name][-1], expected, atol=1e-3 * row["major"])
    for name in ("f2", "f3", "m2", "m3"):
        expected = (row[name] * np.exp(1j * row[f"{name}_phase"]) * turn).real
        np.testing.assert_allclose(result.history[f"support_1_{name}"][-1], expected, atol=2e-3 * row[name])


def test_run_up_through_the_critical_speed() -> None:
    """An own ODE of half the disk on shaft and bearing, the speed a table and the unbalance with its Ω̇ part: 1e-3."""
    k, c, k_s, half, moment, rate, end = 2e4, 300.0, 24.0 * EI, 5.0, 1e-3, 40.0, 2.0
    motion = {"type": "table", "table": [[0.0, 0.0], [end, rate * end]], "interpolation": "linear", "axis": [1, 0, 0]}
    scene = shaft_on_bearings(k, c, loads={"unbalance": [{"x": 0.5, "kg_m": moment}]}, motion=motion)
    result = rotfem.run(scene | {"time": {"end": end, "step": 5e-4}})

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        z, v, bearing = y  # disk, its rate, displacement of a bearing: k_s (z − b) = k b + c ḃ
        angle, speed = 0.5 * rate * t**2, rate * t
        force = 0.5 * moment * (speed**2 - 1j * rate) * np.exp(1j * angle)
        return np.array([v, (force - k_s * (z - bearing)) / half, (k_s * (z - bearing) - k * bearing) / c])

    expected = solve_ivp(rates, (0.0, end), np.zeros(3, dtype=complex), rtol=1e-9, atol=1e-12, t_eval=result.t)
    tip = expected.y[2]
    off = np.abs(result.history["tip_u2"] + 1j * result.history["tip_u3"] - tip)
    assert np.max(off) < 1e-3 * np.max(np.abs(tip))


def test_unbalance_takes_energy_from_its_drive() -> None:
    """A torque drives the shaft through its critical speed, which takes part of it: an own ODE, 1e-3.

    z of the disk, m z̈ = m ε (Ω² − iΩ̇) e^{iψ} − F, and I Ω̇ + m ε Im(e^{−iψ} z̈) = M; a bearing c ḃ + k b = F/2.
    """
    k, c, k_s, mass, moment, inertia, torque, end = 2e4, 100.0, 24.0 * EI, 10.0, 0.02, 0.05, 1.5, 2.0
    motion = {"type": "torque", "hub_inertia": inertia, "table": [[0.0, torque], [end, torque]], "axis": [1, 0, 0]}
    scene = shaft_on_bearings(k, c, loads={"unbalance": [{"x": 0.5, "kg_m": moment}]}, motion=motion)
    result = rotfem.run(scene | {"time": {"end": end, "tolerance": 1e-4}, "model": {"theory": "linear"}})

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        z, v, bearing, (psi, speed) = y[0], y[1], y[2], y[3:].real
        turn, force = np.exp(1j * psi), 2.0 * k_s * (z - bearing)
        rate = (torque + moment / mass * np.imag(force / turn)) / (inertia - moment**2 / mass)
        a = (moment * (speed**2 - 1j * rate) * turn - force) / mass
        return np.array([v, a, (k_s * (z - bearing) - k * bearing) / c, speed, rate])

    expected = solve_ivp(rates, (0.0, end), np.zeros(5, dtype=complex), rtol=1e-9, atol=1e-12, t_eval=result.t).y
    assert expected[4, -1].real < 0.95 * torque / inertia * end
    np.testing.assert_allclose(result.history["psi_dot"], expected[4].real, atol=1e-3)
    force = k_s * (expected[0] - expected[2])
    off = np.abs(result.history["support_0_f2"] + 1j * result.history["support_0_f3"] - force)
    assert np.max(off) < 1e-3 * np.max(np.abs(force))


@pytest.mark.parametrize("theory", ["reissner", "linear"])
def test_bearings_carry_the_weight(theory: str) -> None:
    """60 and 40 % of a disk at 0.4 of the span, and a tilting bearing's moment; 1e-4, the shaft itself."""
    scene = shaft_on_bearings(2e4, 100.0, loads={"gravity": [0, -9.81, 0]}, model={"theory": theory})
    scene["structure"]["masses"][0]["x"] = 0.4
    history = rotfem.run(scene).history
    np.testing.assert_allclose([history[f"support_{i}_f2"][0] for i in (0, 1)], [-58.86, -39.24], rtol=1e-4)
    np.testing.assert_allclose([history[f"support_{i}_f3"][0] for i in (0, 1)], 0.0, atol=1e-5)
    scene["structure"]["supports"][0] |= {"tilt_stiffness": 1e9, "stiffness": 1e12}
    history = rotfem.run(scene).history
    other = history["support_1_f2"][0]
    np.testing.assert_allclose(history["support_0_m3"][0], 98.1 * 0.4 * -1.0 - other, rtol=1e-4)


def test_loss_of_a_blade_is_a_jump_of_unbalance() -> None:
    """Nothing moves before it."""
    scene = shaft_on_bearings(2e4, 300.0, loads={"unbalance": [{"x": 0.5, "kg_m": 1e-3, "start": 0.02}]})
    result = rotfem.run(scene | {"time": {"end": 0.04, "step": 0.001}})
    before = result.t <= 0.02
    assert np.all(result.history["tip_u2"][before] == 0.0)
    assert np.max(np.abs(result.history["tip_u2"][~before])) > 1e-6


# --- structure of shafts ----------------------------------------------------------------------------------------------


def test_spinning_shaft_on_equal_bearings() -> None:
    """ω = ω₀ (√(1 + λ²) ∓ λ), λ = ½ Ω I_x/√(EI ρS) at 3000 rad/s, ω₀ of the pinned beam: 1e-3, shear and bearings.

    Source: Genta 2005, section 4.5; as V2.02.141 of code_aster.
    """
    radius, E, rho, length = 0.05, 2e11, 7800.0, 10.0
    section = {"shape": "circle", "radius": radius, "E": E, "nu": 0.3, "rho": rho, "shear_correction": 1.0}
    supports = [{"x": x, "stiffness": 1e13} for x in (0.0, length)]
    structure = {"type": "spatial_beam", "length": length, "root": {"driven": True}, "supports": supports}
    motion = {"type": "constant", "speed": 3000.0, "axis": [1, 0, 0]}
    found = rotfem.modes({"structure": structure | {"section": section}, "motion": motion, "modes": {"count": 4}})
    area, second = np.pi * radius**2, np.pi / 4 * radius**4
    omega = (np.array([1.0, 2.0]) * np.pi / length) ** 2 * np.sqrt(E * second / (rho * area))
    lam = 0.5 * 3000.0 * 2 * rho * second / np.sqrt(E * second * rho * area) * np.array([1.0, 1.0])
    expected = [w * (np.sqrt(1 + x**2) + sign * x) for w, x in zip(omega, lam, strict=True) for sign in (-1, 1)]
    np.testing.assert_allclose(found.frequencies, expected, rtol=1e-3)
    assert found.summary["frame"] == "fixed"


def test_rotor_with_three_disks_of_lalanne_and_ferraris() -> None:
    """Rotordynamics Prediction in Engineering, 2nd edition, chapter 6: whirl at 25 000 rpm in Hz, and critical speeds.

    1e-3, their 13 elements; coefficients of the bearings as k_xx, k_zz = 5e7, 7e7 N/m and 500, 700 N·s/m.
    """
    sizes = [(0.2, 0.24, 0.05), (0.5, 0.4, 0.05), (1.0, 0.4, 0.06)]
    disks = [
        {"x": x, "disk": {"outer_diameter": d, "inner_diameter": 0.1, "width": w, "rho": 7800}} for x, d, w in sizes
    ]
    bearing = {"stiffness": [[5e7, 0], [0, 7e7]], "damping": [[500, 0], [0, 700]]}
    structure = {
        "type": "spatial_beam",
        "length": 1.3,
        "root": {"driven": True},
        "section": {"shape": "circle", "radius": 0.05, "E": 2e11, "nu": 0.3, "rho": 7800},
        "supports": [{"x": x} | bearing for x in (0.0, 1.3)],
        "masses": disks,
    }
    motion = {"type": "constant", "speed": "25000 rpm", "axis": [1, 0, 0]}
    scene = {"structure": structure, "motion": motion, "modes": {"count": 8}}
    rows = [row for row in rotfem.modes(scene).rows if "whirl" in row["label"]]
    expected = [55.408, 67.209, 157.90, 193.71, 249.90, 407.62]
    np.testing.assert_allclose([row["frequency_hz"] for row in rows], expected, rtol=1e-3)
    found = rotfem.campbell(scene | {"modes": {"count": 6}}, "0:12000:5rpm", orders=0).critical_speeds
    speeds = [c.speed for c in found if c.kind in ("backward", "forward")]
    np.testing.assert_allclose(np.array(speeds) * 30 / np.pi, [3620.4, 3798.1, 10018.0, 11279.0], rtol=1e-3)


def test_free_tube() -> None:
    """Nothing holds it: six rigid motions, then pairs of bending as ROSS has them (its issue 885), 2e-4."""
    section = {"shape": "tube", "outer_radius": 0.01504, "inner_radius": 0.0035, "E": 2.1e11, "nu": 0.3, "rho": 7850}
    free = ["u1", "u2", "u3", "theta1", "theta2", "theta3"]
    structure = {"type": "spatial_beam", "length": 0.3, "root": {"free": free}, "section": section}
    motion = {"type": "constant", "speed": 0.0, "axis": [1, 0, 0]}
    found = rotfem.modes({"structure": structure, "motion": motion, "modes": {"count": 10}}).frequencies
    assert np.all(found[:6] < 1e-3 * found[6])
    np.testing.assert_allclose(found[6:], [9647.0, 9647.0, 25317.0, 25317.0], rtol=2e-4)


def test_stiff_tension_takes_no_digits() -> None:
    """EA = GA = 1e14 on bearings that differ by direction: frequencies of an own Timoshenko code, 1e-4."""
    supports = [{"x": x, "stiffness": [[7.5e5, 0], [0, 1.25e6]]} for x in (0.0, 1.5)]
    masses = [{"x": 0.5, "mass": 32.6, "inertia": [[0.33, 0, 0], [0, 0.178, 0], [0, 0, 0.178]]}]
    section = {"EA": 1e14, "GA2": 1e14, "GA3": 1e14, "GJ": 1e5, "EI2": 64733.0, "EI3": 64733.0}
    section |= {"mass_per_length": 15.335, "rotary_inertia2": 2.396e-3, "rotary_inertia3": 2.396e-3}
    structure = {"type": "spatial_beam", "length": 1.5, "root": {"driven": True}, "supports": supports}
    motion = {"type": "constant", "speed": 100.0, "axis": [1, 0, 0]}
    scene = {"structure": structure | {"masses": masses, "section": section}, "motion": motion, "modes": {"count": 4}}
    np.testing.assert_allclose(rotfem.modes(scene).frequencies, [113.94, 127.06, 377.82, 465.70], rtol=1e-4)


def test_steps_are_two_rows_of_one_x() -> None:
    """A bore that begins inside and a larger diameter: as two short ramps, 1e-4, of which the error is the mesh's.

    Ramps of at most 1e-6 of the length, which no mesh has nodes for, are steps.
    """
    motion = {"type": "constant", "speed": 100.0, "axis": [1, 0, 0]}

    def frequencies(ramp: float) -> np.ndarray:
        outer = [[0.0, 0.02], [0.4, 0.02], [0.4 + ramp, 0.03], [1.0, 0.03]]
        inner = [[0.0, 0.0], [0.7, 0.0], [0.7 + ramp, 0.015], [1.0, 0.015]]
        section = {"shape": "tube", "outer_radius": outer, "inner_radius": inner, "E": 2e11, "nu": 0.3, "rho": 7800}
        supports = [{"x": x, "stiffness": 1e8} for x in (0.0, 1.0)]
        structure = {"type": "spatial_beam", "length": 1.0, "root": {"driven": True}, "supports": supports}
        return rotfem.modes({"structure": structure | {"section": section}, "motion": motion}).frequencies

    np.testing.assert_allclose(frequencies(0.0), frequencies(2e-6), rtol=1e-4)
    np.testing.assert_allclose(frequencies(0.0), frequencies(3e-7), rtol=2e-6)


def internally_damped() -> tuple[dict[str, Any], float]:
    """Return a shaft damped from inside and outside, and the speed (rad/s) from which its forward whirl grows."""
    eta, c = 2e-5, 20.0
    scene = shaft_on_bearings(1e9)
    scene["structure"] |= {"damping": {"kelvin_voigt": eta}}
    scene["structure"]["supports"].append({"x": 0.5, "damping": c})
    omega = np.sqrt(48.0 * EI / 10.0)
    return scene, omega * (1.0 + c / (2 * 10.0 * omega) / (eta * omega / 2))


def test_internal_damping_turns_with_the_shaft() -> None:
    """Forward whirl grows from ω (1 + ζ_ext/ζ_int) on, backward whirl never: 1e-4 (Genta 2005, section 6.4)."""
    scene, threshold = internally_damped()
    for theory in ("reissner", "consistent_linear"):
        motions = ({"type": "constant", "speed": s * threshold, "axis": [1, 0, 0]} for s in (1 - 1e-4, 1 + 1e-4))
        below, above = (rotfem.modes(scene | {"motion": m, "model": {"theory": theory}}) for m in motions)
        assert below.rows[0]["growth"] < 0.0 < max(row["growth"] for row in above.rows)


@pytest.mark.parametrize("coupling", [None, 3e4])
def test_torsion_of_a_free_drive_train(coupling: float | None) -> None:
    """Three disks on two massless shafts that nothing holds against turning: roots of K − ω² J, 1e-6.

    A coupling in each shaft is in series with it.
    """
    J, k = (4.0, 2.0, 3.0), 2e4
    masses = [{"x": x, "inertia": [[j, 0, 0], [0, j, 0], [0, 0, j]]} for x, j in zip((0.0, 0.5, 1.0), J, strict=True)]
    section = {"EA": 1e9, "GA2": 1e9, "GA3": 1e9, "GJ": 0.5 * k, "EI2": 1e7, "EI3": 1e7, "mass_per_length": 1e-6}
    structure = {"type": "spatial_beam", "length": 1.0, "root": {"driven": True, "free": ["theta1"]}}
    structure |= {"supports": [{"x": x, "stiffness": 1e9} for x in (0.0, 1.0)], "masses": masses, "section": section}
    if coupling is not None:
        structure["couplings"] = [{"x": x, "torsion_stiffness": coupling} for x in (0.25, 0.7)]
        k = 1.0 / (1.0 / k + 1.0 / coupling)
    motion = {"type": "constant", "speed": 10.0, "axis": [1, 0, 0]}
    rows = rotfem.modes({"structure": structure, "motion": motion, "modes": {"count": 3}}).rows
    K = k * np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    expected = np.sqrt(np.abs(eig(K, np.diag(J), right=False).real))
    np.testing.assert_allclose([row["frequency"] for row in rows], np.sort(expected), rtol=1e-6, atol=1e-2)
    assert (rows[0]["label"], rows[0]["frequency"], rows[0]["stability"]) == ("rigid body", 0.0, "neutral")


def test_bearings_over_speed_have_the_modes_of_their_values() -> None:
    """At a row of the table, by PCHIP between, constant beyond it: that of a scene with the number, 1e-9."""
    table = {"over_speed": [[0.0, 1e4], [50.0, 2e4, 3e4], [100.0, 4e4, 0.0, 0.0, 5e4]]}
    for speed, value in ((50.0, [[2e4, 0.0], [0.0, 3e4]]), (200.0, [[4e4, 0.0], [0.0, 5e4]])):
        motion = {"type": "constant", "speed": speed, "axis": [1, 0, 0]}
        one, other = (rotfem.modes(shaft_on_bearings(k, motion=motion)).frequencies for k in (table, value))
        np.testing.assert_allclose(one, other, rtol=1e-9)


def test_tables_say_where_they_end() -> None:
    """Every verb has a warning of what is beyond a table, and none within it."""
    scene = shaft_on_bearings(
        {"over_speed": [[0.0, 1e4], [60.0, 2e4]]}, loads={"unbalance": [{"x": 0.5, "kg_m": 1e-3}]}
    )
    load = {"tip_force": {"harmonic": {"amplitude": [0.0, 1.0, 0.0], "frequency": 1e-3}}}
    for speed, there in ((50.0, False), (70.0, True)):
        at = scene | {"motion": {"type": "constant", "speed": speed, "axis": [1, 0, 0]}}
        found = [rotfem.run(at), rotfem.modes(at), rotfem.unbalance(at, [10.0, speed]), rotfem.explain(at)]
        found += [
            rotfem.campbell(at, [10.0, speed], only=True),
            rotfem.response(at | {"loads": load}, 1.0, 2.0, number=2),
        ]
        for result in found:
            assert any("supports.0.stiffness is a table" in text for text in result.summary["warnings"]) == there


def test_bearings_over_frequency_are_those_of_each_whirl() -> None:
    """A stiffness k + a ω²: half the disk on it is heavier, k̂(ω) = k_s (k + aω²)/(k_s + k + aω²) = m/2 ω²; 1e-4."""
    k, a, k_s, half = 2e4, 3.0, 24.0 * EI, 5.0
    rows = [[w, k + a * w**2] for w in np.linspace(0.0, 200.0, 201)]
    found = rotfem.modes(shaft_on_bearings({"over_frequency": rows})).frequencies[0]
    history = {"time": {"end": 0.1, "step": 0.01}}
    for refuse in (rotfem.run, rotfem.response):
        with pytest.raises(rotfem.SceneError, match=r"structure\.supports.*frequency of whirl"):
            refuse(shaft_on_bearings({"over_frequency": rows}) | history)
    omega = brentq(lambda w: k_s * (k + a * w**2) / (k_s + k + a * w**2) - half * w**2, 10.0, 200.0)
    np.testing.assert_allclose(found, omega, rtol=1e-4)


@pytest.mark.parametrize(
    ("support", "key"),
    [
        ({"stiffness": [[100, 1e7], [200, 2e7]]}, "stiffness.*over_speed"),
        ({"stiffness": {"over_speed": [[10, 1.0], [5, 2.0]]}}, "over_speed.*decrease"),
        ({"stiffness": {"over_speed": [[10, 1.0, 2.0, 3.0], [15, 2.0, 1.0, 1.0]]}}, "over_speed"),
        ({"stiffness": {}}, "exactly one"),
        ({"stiffness": 1.0, "housing": [{"mass": -1.0, "stiffness": 1.0}]}, "housing.0.mass"),
        ({"stiffness": 1.0, "housing": [{"mass": 1.0}]}, "housing.0.stiffness"),
    ],
)
def test_tables_of_supports_that_cannot_be(support: dict[str, Any], key: str) -> None:
    tables = shaft_on_bearings(1.0)
    tables["structure"]["supports"] += [{"x": 0.5} | support]
    with pytest.raises(rotfem.SceneError, match=rf"structure\.supports\.2\..*{key}"):
        rotfem.Scene.from_dict(tables)


@pytest.mark.parametrize(
    ("coupling", "key"),
    [
        ({"x": 1.0, "tilt_stiffness": 1.0}, "x"),
        ({"x": 0.5}, "stiffness"),
        ({"x": 0.5, "stiffness": 0.0}, "stiffness"),
        ({"x": 0.5, "stiffness": 1.0, "tilt_damping": 1.0}, "tilt_damping.*tilt_stiffness"),
    ],
)
def test_couplings_that_cannot_be(coupling: dict[str, Any], key: str) -> None:
    tables = shaft_on_bearings(1.0)
    tables["structure"]["couplings"] = [coupling]
    with pytest.raises(rotfem.SceneError, match=rf"structure\.couplings\.0\.{key}"):
        rotfem.Scene.from_dict(tables)


def test_disk_is_its_mass_and_inertias() -> None:
    """A disk of 280/50 mm, 70 mm wide, of steel, and the same by its numbers."""
    by_size = {"disk": {"outer_diameter": 0.28, "inner_diameter": 0.05, "width": "70 mm", "rho": 7810}}
    mass = 7810 * np.pi / 4 * (0.28**2 - 0.05**2) * 0.07
    polar = mass / 8 * (0.28**2 + 0.05**2)
    by_number = {"mass": mass, "polar_inertia": polar, "transverse_inertia": polar / 2 + mass * 0.07**2 / 12}
    scene = shaft_on_bearings(2e4)
    one, other = (
        rotfem.modes(scene | {"structure": scene["structure"] | {"masses": [{"x": 0.5} | body]}}).frequencies
        for body in (by_size, by_number)
    )
    np.testing.assert_allclose(one, other, rtol=1e-12)
    scene["structure"]["masses"] = [{"x": 0.5, "mass": 1.0, "offset": [0.0, 1e-4]}]
    with pytest.raises(rotfem.SceneError, match=r"masses\.0\.offset"):
        rotfem.Scene.from_dict(scene)


@pytest.mark.parametrize("speeds", ["0:150:2", "0:150:7"])
def test_range_of_an_unequal_shaft_does_not_depend_on_the_grid(speeds: str) -> None:
    """Both ends of the range are forward critical speeds, however far apart the speeds are: 1e-4, as above."""
    scene = shaft_on_bearings(1e9)
    scene["structure"]["section"] |= {"EI3": 1.3 * EI}
    ends = np.sqrt(np.array([1.0, 1.3]) * 48.0 * EI / 10.0)
    diagram = rotfem.campbell(scene, speeds, orders=0)
    (found,) = diagram.instabilities
    np.testing.assert_allclose([found.speed, found.until], ends, rtol=1e-4)
    np.testing.assert_allclose([c.speed for c in diagram.critical_speeds if c.kind == "forward"], ends, rtol=1e-4)


def test_housings_in_series() -> None:
    """Half the disk on the shaft's spring, a bearing, and two masses on springs: modes and whirl of unbalance, 1e-4."""
    k_s, half, bearing, under = 24.0 * EI, 5.0, 3e4, [(2.0, 5e4, 40.0), (3.0, 8e4, 0.0)]
    K, C, M = np.zeros((3, 3)), np.zeros((3, 3)), np.diag([half, under[0][0], under[1][0]])
    both = k_s * bearing / (k_s + bearing)
    for i, j, k, c in [(0, 1, both, 0.0), (1, 2, *under[0][1:]), (2, None, *under[1][1:])]:
        e = np.eye(3)[i] - (0.0 if j is None else np.eye(3)[j])
        K, C = K + k * np.outer(e, e), C + c * np.outer(e, e)
    values = eig(
        np.block([[np.zeros((3, 3)), np.eye(3)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]]), right=False
    )
    expected = np.sort(values.imag[values.imag > 0.0])[:3]
    loads = {"unbalance": [{"x": 0.5, "kg_m": 1e-3}], "gravity": [0.0, -1e-3, 0.0]}
    scene = shaft_on_bearings(bearing, modes={"count": 14}, loads=loads)
    for support in scene["structure"]["supports"]:
        support["housing"] = [{"mass": m, "stiffness": k, "damping": c} for m, k, c in under]
    scene["structure"]["masses"][0]["inertia"] = 1e4  # it does not tilt: both ends move alike, or only their housings
    for theory in ("reissner", "consistent_linear"):
        found = rotfem.modes(scene | {"model": {"theory": theory}})
        for omega in expected:
            assert np.min(np.abs(found.frequencies - omega)) < 1e-4 * omega
    speed = 60.0
    push = np.array([0.5 * 1e-3 * speed**2, 0.0, 0.0])
    u = np.linalg.solve(K + 1j * speed * C - speed**2 * M, push)
    of = rotfem.unbalance(scene, [speed, 61.0])
    np.testing.assert_allclose(of.at(0.5)["major"][0], abs(u[0]), rtol=1e-4)
    np.testing.assert_allclose(of.at(1.0)["f2"][0], both * abs(u[0] - u[1]), rtol=1e-4)
    start = {"initial": {"mode": 1, "amplitude": 1e-4}, "time": {"end": 0.01, "step": 0.001}}
    history = rotfem.run(scene | start | {"motion": {**scene["motion"], "speed": speed}})
    assert history.status == "done"
    assert not any("housing" in name for name in history.history)


@pytest.mark.parametrize("theory", ["reissner", "consistent_linear"])
@pytest.mark.parametrize("frame", ["fixed", "rotating"])
def test_coupling_across_a_shaft(theory: str, frame: str) -> None:
    """The overhung disk behind a coupling of stiffness k and 1/s, dampers turning with the shaft: 2e-4, its own mass.

    The coupling adds [[a² / k̂ + s, a / k̂], [a / k̂, 1 / k̂]] to the compliance F of the disk, a before it, with
    k̂ = k + c (λ − iΩ): det(λ² M − iΩλ G + F⁻¹) = 0; forward whirl grows at 300 rad/s.
    """
    k, c, s, a, speed = 2e4, 3.0, 1 / 3e5, 0.3, 300.0
    motion = {"type": "constant", "speed": speed, "axis": [1, 0, 0]}
    scene = overhung(motion=motion, model={"theory": theory, "frame": frame}, modes={"count": 2})
    scene["structure"]["section"]["mass_per_length"] = 1e-2
    coupling = {"x": LENGTH - a, "stiffness": 1 / s, "tilt_stiffness": k, "tilt_damping": c}
    scene["structure"]["couplings"] = [coupling]
    rigid = np.array([[LENGTH**3 / 3, LENGTH**2 / 2], [LENGTH**2 / 2, LENGTH]]) / EI + np.diag([s, 0.0])
    M, G = np.diag([MASS, DIAMETRAL]), np.diag([0.0, POLAR])

    def equation(y: np.ndarray) -> list[float]:
        lam = complex(*y)
        F = rigid + np.array([[a * a, a], [a, 1.0]]) / (k + c * (lam - 1j * speed))
        value = np.linalg.det(lam**2 * M - 1j * speed * lam * G + np.linalg.inv(F)) / 1e8
        return [value.real, value.imag]

    for row in rotfem.modes(scene).rows:
        whirl = row["frequency" if frame == "fixed" else "frequency_fixed"]
        found = np.array([row["growth"], whirl if row["whirl"] == "forward" else -whirl])
        np.testing.assert_allclose(found, root(equation, found).x, rtol=2e-4, err_msg=row["whirl"])
        assert (row["growth"] > 0.0) == (row["whirl"] == "forward")


def test_a_strut_holds_the_tip_of_a_blade() -> None:
    """A radial beam at rest, clamped and on a spring k at its tip: the equation of the cantilever with it, 1e-4."""
    m, length, k = 2.0, 3.0, 500.0
    section = {"EA": 1e9, "GA2": 1e9, "GA3": 1e9, "GJ": EI, "EI2": EI, "EI3": EI, "mass_per_length": m}
    structure = {
        "type": "spatial_beam",
        "length": length,
        "section": section,
        "supports": [{"x": length, "stiffness": k}],
    }
    found = rotfem.modes({"structure": structure, "motion": {"type": "constant", "speed": 0.0}, "modes": {"count": 2}})

    def equation(b: float) -> float:
        left = b**3 * (1.0 + np.cos(b) * np.cosh(b))
        return left + k * length**3 / EI * (np.sin(b) * np.cosh(b) - np.cos(b) * np.sinh(b))

    b = brentq(equation, 1.0, 3.9)
    np.testing.assert_allclose(found.frequencies, (b / length) ** 2 * np.sqrt(EI / m), rtol=1e-4)


def test_every_verb_takes_a_shaft_on_any_bearing() -> None:
    """Bearings that differ by direction on a housing: a force that stands still moves the tip as M, C, K say, 1e-4."""
    scene = shaft_on_bearings([[2e4, 0.0], [0.0, 3e4]], 100.0)
    scene["structure"]["supports"][1]["housing"] = [{"mass": 2.0, "stiffness": 5e4}]
    assert rotfem.check(scene).mass == pytest.approx(10.0 + 1e-4)
    assert rotfem.explain(scene).verdicts["supports"] != "negligible"
    assert rotfem.run(scene).status == "done"
    load = {"tip_force": {"harmonic": {"amplitude": [0.0, 1.0, 0.0], "frequency": 1e-3}}}
    answer = rotfem.response(scene | {"loads": load}, 1e-3, 2e-3, number=2)
    series = 1.0 / (1.0 / 2e4 + 1.0 / 5e4)  # the end stands on bearing and housing, with its weight on no other
    np.testing.assert_allclose(answer.amplitude("tip_u2")[0], 1.0 / series, rtol=1e-4)


# --- frames, stability, critical speeds -------------------------------------------------------------------------------


def spinning_shaft(**changes: Any) -> dict[str, Any]:
    """Return a slender uniform shaft on two hard pins."""
    section = {"shape": "circle", "radius": 0.05, "E": 2e11, "nu": 0.3, "rho": 7800.0, "shear_correction": 1.0}
    supports = [{"x": x, "stiffness": 1e13} for x in (0.0, 10.0)]
    structure = {"type": "spatial_beam", "length": 10.0, "root": {"driven": True}, "supports": supports}
    motion = {"type": "constant", "speed": 3000.0, "axis": [1, 0, 0]}
    return {"structure": structure | {"section": section}, "motion": motion, "modes": {"count": 4}} | changes


@pytest.mark.parametrize("speeds", ["0:600:2", "0:600:9"])
@pytest.mark.parametrize("axis", [1, -1])
def test_critical_speeds_depend_on_no_grid(speeds: str, axis: int) -> None:
    """Ω² = EI k⁴/(ρS + ρI k² (1 ∓ 2)), k = nπ/L, of the Rayleigh shaft (Genta 2005, section 4.5): 1e-3, shear, pins.

    They are the same to round-off whatever the speeds.
    """
    motion = {"type": "constant", "speed": 1.0, "axis": [axis, 0, 0]}
    found = [c for c in rotfem.campbell(spinning_shaft(motion=motion), speeds).critical_speeds if c.kind != "per_rev"]
    k, area, second = np.array([1, 1, 2, 2]) * np.pi / 10.0, np.pi * 0.05**2, np.pi / 4 * 0.05**4
    polar = np.array([1, -1, 1, -1])  # of backward and forward whirl
    expected = np.sqrt(2e11 * second * k**4 / (7800.0 * (area + second * k**2 * (1.0 + 2.0 * polar))))
    np.testing.assert_allclose([c.speed for c in found], expected, rtol=1e-3)
    ratio = [c.speed / d.speed for c, d in zip(found[1::2], found[::2], strict=True)]
    np.testing.assert_allclose(np.array(ratio) - 1.0, expected[1::2] / expected[::2] - 1.0, rtol=0.01)
    assert [c.label for c in found] == [f"{n} {way} whirl" for n in ("1st", "2nd") for way in ("backward", "forward")]


def test_critical_speeds_of_whirls_that_are_no_branches() -> None:
    """Three of the first four modes are torsion; four critical speeds are found all the same."""
    scene = spinning_shaft()
    section = {"EA": 1e9, "GA2": 1e9, "GA3": 1e9, "GJ": 10.0, "EI2": 1e6, "EI3": 1e6, "mass_per_length": 61.0}
    scene["structure"]["section"] = section | {"rotary_inertia2": 0.04, "rotary_inertia3": 0.04}
    diagram = rotfem.campbell(scene, "0:60:4")
    own = [c for c in diagram.critical_speeds if c.kind != "per_rev"]
    assert len(own) == 4
    assert any(c.branch == 0 for c in own)
    assert all(c.label == diagram.labels[c.branch - 1] for c in own if c.branch)


def test_threshold_of_internal_damping_is_found() -> None:
    """ω (1 + ζ_ext/ζ_int), from there on: 1e-3 (Genta 2005, section 6.4), with speeds far apart."""
    scene, threshold = internally_damped()
    (found,) = rotfem.campbell(scene, "0:5000:3").instabilities
    assert found.until is None
    np.testing.assert_allclose(found.speed, threshold, rtol=1e-3)


def test_map_of_critical_speeds_over_the_bearings() -> None:
    """√(k_s k/(k_s + k)/(m/2)), half the disk on shaft and bearing, without the damping that the scene has: 1e-4."""
    scene = shaft_on_bearings(1e4, 300.0, mesh={"elements": 4, "degree": 3})
    scene["structure"]["section"] |= {"mass_per_length": 1e-3}
    diagram = rotfem.campbell(scene, "0:100:3", map="structure.supports.*.stiffness=1e3:1e7:5")
    rows, k_s = diagram.data()["critical_map"].values, 24.0 * EI
    k = np.array(rows["value"])
    np.testing.assert_allclose(np.unique(k), np.geomspace(1e3, 1e7, 5))
    np.testing.assert_allclose(rows["speed"], np.sqrt(k_s * k / (k_s + k) / 5.0), rtol=1e-4)
    assert sorted(set(rows["label"])) == ["1st backward whirl", "1st forward whirl"]
    figure = diagram.plot(drawing="critical_map")
    check(figure)
    (axis,) = figure.axes
    assert (axis.get_xlabel(), axis.get_xscale()) == ("stiffness of the supports (N/m)", "log")
    assert (axis.get_ylabel(), axis.get_yscale()) == ("undamped critical speed (rad/s)", "log")
    np.testing.assert_allclose(sorted({*axis.lines[0].get_ydata()}), sorted({*rows["speed"]})[::2], rtol=1e-6)
    with pytest.raises(rotfem.SceneError, match="--map.*FIRST:LAST"):
        rotfem.campbell(scene, "0:100:3", map="structure.supports.*.stiffness=1e3")
    scene["structure"]["supports"][0]["stiffness"] = {"over_speed": [[0.0, 1e4], [50.0, 2e4]]}
    with pytest.raises(rotfem.SceneError, match="map.*constant"):
        rotfem.campbell(scene, "0:100:3", map={"structure.supports.1.stiffness": [1e4, 1e5]})


def film_bearings() -> dict[str, Any]:
    """Return a disk on a shaft on oil films at 4000 rpm."""
    film = {"stiffness": [[2.1e7, 3e6], [-4e6, 3.2e7]], "damping": [[4e4, -1.1e4], [-0.9e4, 6e4]]}
    masses = [{"x": 0.7, "mass": 60.0, "inertia": [[0.9, 0, 0], [0, 0.5, 0], [0, 0, 0.5]]}]
    section = {"shape": "circle", "radius": 0.045, "E": 2.05e11, "nu": 0.3, "rho": 7850}
    structure = {"type": "spatial_beam", "length": 1.4, "root": {"driven": True}, "masses": masses, "section": section}
    structure |= {"supports": [{"x": x} | film for x in (0.0, 1.4)]}
    motion = {"type": "constant", "speed": "4000 rpm", "axis": [1, 0, 0]}
    return {"structure": structure, "motion": motion, "modes": {"count": 5}}


def test_overdamped_roots_take_no_places_of_whirls() -> None:
    """Whirls on oil films by an own Timoshenko code in the fixed frame: frequency 2e-4, damping to its three digits."""
    found = rotfem.modes(film_bearings())
    rows = [row for row in found.rows if "torsion" not in row["label"]]
    np.testing.assert_allclose([row["frequency"] for row in rows], [308.99, 322.67, 1882.4, 2004.7], rtol=2e-4)
    np.testing.assert_allclose([row["damping"] for row in rows], [0.0547, 0.0483, 0.140, 0.187], rtol=5e-3)
    decrements = [2 * np.pi * row["damping"] / np.sqrt(1 - row["damping"] ** 2) for row in rows]
    np.testing.assert_allclose([row["log_decrement"] for row in rows], decrements, rtol=1e-9)
    assert not any("edgewise" in label or "slow" in label for label in found.labels)


def test_every_table_says_its_frame() -> None:
    """Of a round shaft "fixed"; of an unequal one "rotating", with both frequencies |ω ± Ω| of the fixed frame."""
    scene = shaft_on_bearings(1e9)
    round_shaft, diagram = rotfem.modes(scene), rotfem.campbell(scene, [0.0, 50.0, 100.0])
    scene["structure"]["section"] = scene["structure"]["section"] | {"EI3": 1.3 * EI}
    unequal = rotfem.modes(scene)
    for result, frame in ((round_shaft, "fixed"), (diagram, "fixed"), (unequal, "rotating")):
        assert result.frame == frame
        assert set(result.to_pandas()["frame"]) == {frame}
        assert result.to_xarray()["frequency"].attrs["long_name"] == f"frequency, {frame} frame"
        assert any(f"{frame} frame" in head for head in result.tables()[0].head)
    assert diagram.plot().axes[0].get_ylabel() == "frequency, fixed frame (rad/s)"
    for row in unequal.rows:
        both = sorted([row["frequency_fixed"], row["frequency_fixed_2"]])
        np.testing.assert_allclose(both, sorted([abs(row["frequency"] - 50.0), row["frequency"] + 50.0]))
    turning = rotfem.campbell(scene, [10.0, 30.0, 50.0], only=True)
    figure = turning.plot(drawing="campbell_fixed")
    check(figure)
    drawn = {round(float(y), 9) for line in figure.axes[0].lines for y in np.asarray(line.get_ydata(), dtype=float)}
    first = turning.branches()[turning.labels[0]]
    assert {round(y, 9) for name in ("frequency_fixed", "frequency_fixed_2") for y in first[name].tolist()} <= drawn


def test_shafts_are_drawn_as_they_are_built() -> None:
    """A step, a bore, a disk and a support where they are; modes with orbits as wide as their shapes."""
    scene = spinning_shaft()
    section = {
        "shape": "tube",
        "E": 2e11,
        "nu": 0.3,
        "rho": 7800.0,
        "inner_radius": [[0, 0], [6, 0], [6, 0.02], [10, 0.02]],
    }
    scene["structure"]["section"] = section | {"outer_radius": [[0, 0.05], [4, 0.05], [4, 0.08], [10, 0.08]]}
    scene["structure"]["masses"] = [{"x": 7.0, "disk": {"outer_diameter": 1.0, "width": 0.1, "rho": 7800.0}}]
    figure = rotfem.check(scene).plot()
    check(figure)
    axis = figure.axes[0]
    lines = [np.asarray(line.get_xydata(), dtype=float) for line in axis.lines]
    edge = lines[0]
    for x, radius in ((3.99, 0.05), (4.01, 0.08)):
        np.testing.assert_allclose(np.interp(x, *edge.T), radius, rtol=1e-9)
    assert np.interp(4.01, *edge.T) == pytest.approx(0.08)
    (disk,) = axis.patches
    box = [disk.get_x(), disk.get_y(), disk.get_width(), disk.get_height()]
    np.testing.assert_allclose(box, [6.95, -0.5, 0.1, 1.0], rtol=1e-9)
    ends = [line[0].tolist() for line in lines if len(line) == 1 and line[0, 1] < 0.0]
    assert ends == [[0.0, -0.05], [10.0, -0.08]]
    found = rotfem.modes(scene)
    figure = found.plot()
    check(figure)
    assert [a.name for a in figure.axes] == ["3d"] * 4
    assert all(row["label"] in a.get_title() for row, a in zip(found.rows, figure.axes, strict=True))
    (shape, *_), axes = found.shapes.values(), figure.axes[0]
    orbits = [np.array(line.get_data_3d()) for line in axes.lines if len(line.get_data_3d()[0]) == 60]
    widths = [np.hypot(*orbit[1:]).max() for orbit in orbits]
    at = [np.flatnonzero(shape["x"] == orbit[0, 0])[0] for orbit in orbits]
    np.testing.assert_allclose(widths, np.abs(shape["u2"] + 1j * shape["u2_imag"])[at], rtol=1e-2, atol=1e-6)
