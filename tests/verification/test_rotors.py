"""Shafts with disks: whirl and critical speeds against the four-degree-of-freedom rotor of the textbooks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import eig

import rotfem

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
            "section": section | {"mass_per_length": 1e-6},
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
    rows = [row for row in rotfem.modes(scene).rows if row["label"].startswith("bending")][:4]
    signs = {"forward": 1.0, "backward": -1.0}
    found = sorted(signs[row["whirl"]] * row["frequency_fixed"] for row in rows)
    np.testing.assert_allclose(found, disk_on_massless_shaft(speed), rtol=1e-5)
    assert {row["label"] for row in rows} == {f"bending {n} {way}" for n in (1, 2) for way in signs}


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
    assert [c.label for c in found[:2]] == ["bending 1 backward", "bending 1 forward"]
    assert not diagram.summary["ambiguous"]
    assert all(b["frequency_last"] is not None for b in diagram.summary["branches"])
    assert len(set(diagram.labels)) == count


def test_critical_speed_is_said_by_modes() -> None:
    """At its critical speed a shaft has a mode of zero frequency, which is no mistake of the solver."""
    speed = next(c.speed for c in rotfem.campbell(overhung(), "100:150:3").critical_speeds if c.kind == "forward")
    motions = ({"type": "constant", "speed": s, "axis": [1, 0, 0]} for s in (speed, 90.0))
    at, off = (rotfem.modes(overhung(motion=motion)) for motion in motions)
    assert any(text.startswith("critical speed: bending 1 forward") for text in at.summary["warnings"])
    assert not any("critical speed" in text for text in off.summary["warnings"])


def test_left_vectors_of_double_modes_are_independent() -> None:
    """Two modes of one frequency have two left vectors; one and the same twice loses a branch."""
    from mpi4py import MPI

    from rotfem.commands.modes import analysis_of
    from rotfem.commands.problem import Problem

    scene = rotfem.Scene.from_dict(overhung(modes={"count": 5}))
    spinning = analysis_of(scene, Problem.of(scene).spinning(), MPI.COMM_WORLD).at(0.0, 8)
    values, left = spinning.pairs.values, spinning.pairs.left
    twins = [i for i in range(len(values) - 1) if abs(values[i + 1] - values[i]) < 1e-6 * abs(values[i])]
    assert twins
    for i in twins:
        pair = left[:, i : i + 2] / np.linalg.norm(left[:, i : i + 2], axis=0)
        assert np.linalg.svd(pair, compute_uv=False)[-1] > 1e-3
