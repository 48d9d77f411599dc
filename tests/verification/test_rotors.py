"""Shafts with disks: whirl and critical speeds against the four-degree-of-freedom rotor of the textbooks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from scipy.linalg import eig

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
    found = sorted(signs[row["whirl"]] * row["frequency_fixed"] for row in rows)
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
    """Both figures have every branch by name and the synchronous speeds."""
    diagram = rotfem.campbell(overhung(modes={"count": 4}), "0:200:5")
    drawings = diagram.drawings()
    assert set(drawings) == {"campbell.png", "campbell_fixed.png"}
    for draw in drawings.values():
        figure = draw()
        check(figure)
        assert {b["label"] for b in diagram.summary["branches"]} <= {text.get_text() for text in figure.axes[0].texts}
    (circles,) = [line.get_xydata() for line in figure.axes[0].lines if line.get_marker() == "o"]
    np.testing.assert_allclose([c[0] for c in circles], [c[1] for c in circles])  # whirl as fast as the spin
    assert len(circles) == 2


def test_a_shaft_above_its_critical_speed_is_where_it_was() -> None:
    """Nothing bends it there, so that no other equilibrium is met on the way to the speed; its spin alone holds it."""
    warnings = rotfem.modes(overhung(motion={"type": "constant", "speed": 150.0, "axis": [1, 0, 0]})).summary[
        "warnings"
    ]
    assert not any("bifurcation" in text for text in warnings)
    assert any("gyroscopic forces alone hold it" in text for text in warnings)


def test_critical_speed_is_said_by_modes() -> None:
    """At its critical speed a shaft has a mode of zero frequency, which is no mistake of the solver."""
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
    whirl = np.array([row["frequency_fixed"] for row in diagram.rows if row["whirl"] != "standing"])
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
        fixed = abs(row["frequency_fixed"]) if speed else row["frequency"]
        np.testing.assert_allclose([fixed, row["growth"]], [expected.imag, expected.real], rtol=5e-5)


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
        np.testing.assert_allclose(row["frequency_fixed"], abs(growing.imag), rtol=5e-5)


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
    """In the fixed frame and in the rotor: 1e-9, the difference of the bearings."""
    one, other = (
        rotfem.modes(shaft_on_bearings(stiffness, 30.0)).rows
        for stiffness in (2e4, [[2e4, 0.0], [0.0, 2e4 * (1 + 1e-9)]])
    )
    fixed = [sorted((row["frequency_fixed"], row["growth"]) for row in rows) for rows in (one, other)]
    np.testing.assert_allclose(*fixed, rtol=1e-7)


def test_bearings_that_differ_by_direction_are_refused_in_the_rotating_frame() -> None:
    """Coefficients would change with time there; a shaft that differs by direction, too, has no frame without."""
    supports = [[2e4, 0.0], [0.0, 1e4]]
    scene = shaft_on_bearings(supports)
    harmonic = {"tip_force": {"harmonic": {"amplitude": [0.0, 1.0, 0.0], "frequency": 3.0}}}
    for compute in (rotfem.run, rotfem.explain, rotfem.response):
        with pytest.raises(rotfem.SceneError, match=r"structure\.supports.*change with time"):
            compute(scene | {"loads": harmonic})
    with pytest.raises(rotfem.SceneError, match=r"structure\.supports.*change with time"):
        rotfem.modes(scene, sensitivities=True)
    problem = rotfem.Problem.of(scene)
    for compute in (problem.steady, lambda: problem.march(end=1.0, step=0.1)):
        with pytest.raises(rotfem.InputError, match=r"structure\.supports.*change with time"):
            next(compute())
    scene["structure"]["section"] = scene["structure"]["section"] | {"EI2": 2 * EI}
    with pytest.raises(rotfem.SceneError, match=r"structure\.supports.*need a shaft that does not"):
        rotfem.modes(scene)


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"motion": {"type": "constant", "speed": 5.0}}, "motion.axis"),
        ({"supports": [{"x": 0.0, "stiffness": 1.0}]}, "structure.root.driven"),
        ({"supports": [{"x": 2.0, "stiffness": 1.0}]}, "structure.supports.0.x"),
        ({"supports": [{"x": 0.5}]}, "structure.root.driven"),
        ({"supports": [{"x": 0.5, "stiffness": [[1.0, 0.0], [0.0, -2.0]]}]}, "structure.supports.0.stiffness"),
        ({"precone": 0.1}, "structure.supports"),
        ({"root": {"driven": True, "lag_stiffness": 1.0}}, "structure.root.driven"),
    ],
)
def test_supports_that_cannot_be(change: dict[str, Any], key: str) -> None:
    tables = shaft_on_bearings(1.0)
    tables = tables | change if "motion" in change else tables | {"structure": tables["structure"] | change}
    with pytest.raises(rotfem.SceneError, match=key):
        rotfem.Scene.from_dict(tables)


def test_a_shaft_on_bearings_in_time() -> None:
    """A force that rests in the rotor, as of an unbalance, bends the shaft for good: a history stays there, 2e-4.

    Half the disk: z = (F/2)/(k_s k̂/(k_s + k̂) − m/2 Ω²) in the rotor, where the damper sees Ω: k̂ = k + iΩc. Of the
    bearing z k_s/(k_s + k̂).
    """
    k, c, k_s, half, speed, force = 2e4, 150.0, 24.0 * EI, 5.0, 50.0, 3.0
    load = {"at": [{"x": 0.5, "force": [0.0, force, 0.0], "kind": "follower"}]}
    result = rotfem.run(shaft_on_bearings(k, c, loads=load, time={"end": 0.2, "step": 0.002}))
    bearing = k + 1j * speed * c
    disk = 0.5 * force / (k_s * bearing / (k_s + bearing) - half * speed**2)
    end = disk * k_s / (k_s + bearing)
    for name, value in (("u2", end.real), ("u3", end.imag)):
        np.testing.assert_allclose(result.tip[name], value, atol=2e-4 * abs(end))
