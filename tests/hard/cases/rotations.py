"""Rotations beyond one turn of a spatial beam and beyond the pole of a plate's director: circles, helices, twists."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from tests.hard.case import Case
from tests.plate_mesh_files import write_msh

TOPIC = "rotations beyond one turn"
TURN = 2 * np.pi
EA = 1e4


def rod(moment: Sequence[float], kind: str, **changes: Any) -> dict[str, Any]:
    """Return a rod with EI = GJ = L = 1 under a moment at its tip."""
    section = {"EA": EA, "GA2": EA / 2.5, "GA3": EA / 2.5, "GJ": 1.0, "EI2": 1.0, "EI3": 1.0, "mass_per_length": 1.0}
    return {
        "structure": {"type": "spatial_beam", "length": 1.0, "section": section},
        "motion": {"type": "constant", "speed": 0.0},
        "loads": {"tip_moment": {"value": list(moment), "kind": kind}},
        "mesh": {"elements": 16},
        **changes,
    }


def helix(moment: Sequence[float]) -> list[float]:
    """Return u and θ at the tip of the rod: Λ = exp(X m), the axis shorter by m₁²/EA as fibers keep their length."""
    m = np.array(moment, dtype=float)
    r = [quad(lambda X, i=i: Rotation.from_rotvec(X * m).as_matrix()[i, 0], 0, 1, limit=200)[0] for i in range(3)]
    r = [(1 - m[0] ** 2 / EA) * x for x in r]
    return [r[0] - 1.0, r[1], r[2], *moment]


def tip(result: Any) -> list[float]:
    return [float(result.history[f"tip_{name}"][-1]) for name in ("u1", "u2", "u3", "theta1", "theta2", "theta3")]


def strip_along_2(turns: float) -> tuple[dict[str, Any], dict[str, str]]:
    """Return a strip 10 × 1 × 0.01 that a moment about direction 1 rolls up, and its mesh."""
    n, thickness = 32, 0.01
    along, across = np.meshgrid(np.linspace(0, 10, n + 1), [0.0, 1.0], indexing="ij")
    groups = {
        "clamped": [[0, 1]],
        "tip": [[2 * n, 2 * n + 1]],
        "plate": [[2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1] for i in range(n)],
    }
    with tempfile.TemporaryDirectory() as folder:
        points = np.column_stack([across.ravel(), along.ravel()])
        mesh = write_msh(Path(folder) / "strip.msh", points, groups).read_text()
    scene = {
        "structure": {"type": "plate", "mesh": "strip.msh", "thickness": thickness, "E": 1e7, "nu": 0.0, "rho": 1.0},
        "motion": {"type": "constant", "speed": 0.0},
        "loads": {"tip_moment": [turns * TURN * 1e7 * thickness**3 / 12 / 10, 0.0, 0.0]},
    }
    return scene, {"strip.msh": mesh}


def rolled(moment: float) -> dict[str, Any]:
    """Return a beam that a moment in its plane rolls up by 1.5 turns, whose modes are looked for."""
    scene = rod([0.0, 0.0, moment], "dead")
    scene["structure"]["section"] |= {"EI2": 0.7, "rotary_inertia2": 1e-4, "rotary_inertia3": 1e-4}
    scene["structure"]["section"] |= {"EA": 1e5, "GA2": 4e4, "GA3": 4e4}
    return scene | {"modes": {"count": 14}}


def in_plane(result: Any) -> list[float]:
    """Return the frequencies of the modes without flap and torsion."""
    rows = [row for row in result.rows if row["share_flap"] + row["share_torsion"] < 1e-6]
    return sorted(row["frequency"] for row in rows)[:3]


MOMENTS: tuple[tuple[str, tuple[float, float, float], bool], ...] = (
    ("circle in the plane of rotation, 2 turns", (0.0, 0.0, 2 * TURN), False),
    ("circle across it, −2 turns", (0.0, -2 * TURN, 0.0), False),
    ("helix, 1.9 turns", (4.0, -7.0, 9.0), False),
    ("twist, 3 turns", (3 * TURN, 0.0, 0.0), True),
    ("circle, 5 turns", (0.0, 0.0, 5 * TURN), True),
)

CASES = [
    Case(
        TOPIC,
        f"spatial beam, {kind} moment: {name}",
        rod(moment, kind),
        value=tip,
        reference=helix(moment),
        tolerance=1e-6,
        source="exact helix Λ = exp(X m)",
        nightly=nightly or kind == "follower",
    )
    for name, moment, nightly in MOMENTS
    for kind in ("dead", "follower")
]
CASES += [
    Case(
        TOPIC,
        f"spatial beam, {theory}: 1.1 turns",
        rod((1.1 * TURN, 0.0, 0.0), "dead", model={"theory": theory}),
        expected="failed",
        words="has turned by 1.1 turns",
        nightly=theory == "second_order",
    )
    for theory in ("second_order", "von_karman")
]
for _turns in (0.3, 1.0, 2.0):
    _scene, _files = strip_along_2(_turns)
    _kappa = _turns * TURN / 10
    CASES.append(
        Case(
            TOPIC,
            f"plate rolled up about direction 1 by {_turns:g} turns",
            _scene,
            value=lambda result: [float(result.history[f"tip_{name}"][-1]) for name in ("u2", "u3", "alpha2")],
            reference=[np.sin(10 * _kappa) / _kappa - 10, (1 - np.cos(10 * _kappa)) / _kappa, 10 * _kappa],
            tolerance=1e-4,
            source="arc of a circle, but for Green's strain, h²κ²/6",
            files=_files,
            nightly=True,  # half a minute; test_plate rolls one up in every run
        )
    )
CASES.append(
    Case(
        TOPIC,
        "modes about a spatial beam rolled up by 1.5 turns",
        rolled(1.5 * TURN),
        command="modes",
        value=in_plane,
        reference=[14.199606347, 18.520031223, 20.540234766],
        tolerance=1e-6,
        source="planar beam, whose angle has no limit",
        nightly=True,
    )
)
