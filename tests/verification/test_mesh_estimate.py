"""The error that each mode is told to have by its mesh, against the frequencies of a mesh that is fine."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rotfem import ModesResult, campbell, modes
from rotfem.accuracy.errors import ASYMPTOTIC
from tests.beams import STRUCTURE

pytestmark = pytest.mark.estimated

BEAM = {
    "type": "planar_beam",
    "length": 10.0,
    "section": STRUCTURE["section"],
}
MASSES = {**BEAM, "masses": [{"x": x, "mass": 0.1} for x in (2.0, 4.0, 6.0, 8.0)]}
EI = [[0.0, 60.0], [0.5, 60.0], [0.51, 1.4e4], [10.0, 1.4e4]]
SOFT = {**BEAM, "section": {**BEAM["section"], "EI": EI}}


def result(structure: dict[str, Any], elements: Any, count: int) -> ModesResult:
    """Return the modes at rest on a mesh."""
    scene = {
        "structure": structure,
        "motion": {"type": "constant", "speed": 0.0},
        "model": {"theory": "consistent_linear"},
        "mesh": {"elements": elements},
        "modes": {"count": count},
    }
    return modes(scene)


def plate(length: float) -> dict[str, Any]:
    """Return a strip of width 1 m and thickness 1 cm."""
    return {"type": "plate", "length": length, "width": 1.0, "thickness": 0.01, "E": 7e10, "nu": 0.3, "rho": 2700.0}


@pytest.mark.parametrize(
    ("structure", "coarse", "fine", "count"),
    [
        (BEAM, 2, 40, 4),
        (BEAM, 4, 40, 6),
        (BEAM, 8, 40, 6),
        (plate(2.0), [4, 4], [24, 12], 5),
        (plate(2.0), [8, 8], [24, 12], 5),
        (plate(10.0), [8, 4], [40, 8], 5),
        (plate(2.0), [8, 1], [24, 12], 3),  # one cell across, which half the cells along would say nothing of
        (MASSES, 6, 40, 4),  # of which five are fixed by masses
        (SOFT, 10, 100, 3),  # two short ones are fixed by the table, and matter most
    ],
)
def test_order_of_the_error(structure: dict[str, Any], coarse: Any, fine: Any, count: int) -> None:
    """Above 1e-5 (what the fine mesh leaves) it is half of the error or more, and at most 2^{2k} times it below 5 %."""
    true = result(structure, fine, count + 2)
    exact = dict(zip(true.labels, true.frequencies, strict=True))
    rows = [row for row in result(structure, coarse, count).rows if row["label"] in exact]
    assert len(rows) >= count - 1
    errors = np.array([row["frequency"] / exact[row["label"]] - 1 for row in rows])
    told = np.array([row["mesh_error"] for row in rows])
    print([f"{row['label']}: {e:.1e} told {t:.1e}" for row, e, t in zip(rows, errors, told, strict=True)])
    seen = errors > 1e-5
    assert np.all(told[seen] > errors[seen] / 2)
    small = seen & (told < ASYMPTOTIC / 2)
    assert np.all(told[small] < 64 * errors[small])


@pytest.mark.parametrize(
    ("more", "motion"),
    [
        ({}, {"type": "constant", "speed": 60.0}),
        ({"root": {"lag_stiffness": 0.0}}, {"type": "constant", "speed": 2.0}),
        ({"hub_radius": 1.0}, {"type": "torque", "hub_inertia": 50.0, "pulses": [[0.0, 1.0, 1.0]]}),
    ],
    ids=["string", "hinge", "free hub"],
)
def test_every_mode_is_judged(more: dict[str, Any], motion: dict[str, Any]) -> None:
    """Where stress holds a beam straight, where it or its hub is free to turn: above 1e-4 not under by 2.

    The double zero of the hinge is one mode, and its round-off no error of the others.
    """
    tables = {"structure": {**BEAM, **more}, "motion": motion, "model": {"theory": "consistent_linear"}}
    coarse, true = (modes({**tables, "mesh": {"elements": n}, "modes": {"count": 5}}) for n in (3, 24))
    rows, fine = coarse.rows, true.rows
    assert coarse.summary["error"]["space"] == max(row["mesh_error"] for row in rows[1:])
    assert true.summary["error"]["total"] < 1e-2
    assert not [line for line in true.warnings if line.startswith("unreliable")]
    assert [row["label"] for row in rows if row["stability"] == "neutral"] == ["rigid body"] * bool(more)
    exact = np.array([row["frequency"] for row in fine])
    judged = [row for row in rows if row["stability"] != "neutral"]
    assert len(judged) >= 4
    errors = [np.abs(row["frequency"] / exact[exact > 0.0] - 1.0).min() for row in judged]
    assert max(errors) > 1e-2
    for row, error in zip(judged, errors, strict=True):
        assert error < 1e-4 or 0.5 * error < row["mesh_error"] < 63 * error


def test_what_is_said() -> None:
    """A mesh that is too coarse for the modes wanted is said to be; the mesh that is taken without one is not."""
    few = result(BEAM, 2, 4)
    (warning,) = [text for text in few.summary["warnings"] if text.startswith("coarse")]
    assert "4th edgewise" in warning
    assert "1st edgewise" not in warning
    assert result(BEAM, 16, 6).summary["warnings"] == []
    assert result(plate(2.0), [8, 8], 6).summary["warnings"] == []
    thin = result(plate(1.0), [2, 60], 5)
    assert any(text.startswith("coarse") for text in thin.summary["warnings"])


def test_rows_over_speed_say_what_modes_say() -> None:
    """A branch has the larger error of those at both ends of the diagram."""
    tables = {
        "structure": BEAM,
        "motion": {"type": "constant", "speed": 6.0},
        "model": {"theory": "consistent_linear"},
        "mesh": {"elements": 8},
        "modes": {"count": 4},
    }
    over_speed = [row for row in campbell(tables, [0.0, 6.0]).rows if row["speed"] == 6.0]
    ends = [modes({**tables, "motion": {"type": "constant", "speed": s}}).rows for s in (0.0, 6.0)]
    larger = [max(row["mesh_error"] for row in both) for both in zip(*ends, strict=True)]
    assert [row["mesh_error"] for row in over_speed] == pytest.approx(larger, rel=1e-3)


def test_effectivity_tends_to_one() -> None:
    """Frequencies on elements of degree 1 converge with order 2: estimate over error tends to 1 (within a tenth)."""
    scene = {"structure": BEAM, "motion": {"type": "constant", "speed": 0.0}, "modes": {"count": 1}}
    exact = modes({**scene, "mesh": {"elements": 48, "degree": 4}}).rows[0]["frequency"]
    row = modes({**scene, "mesh": {"elements": 32, "degree": 1}}).rows[0]
    assert row["mesh_error"] == pytest.approx(abs(row["frequency"] / exact - 1.0), rel=0.1)


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
def test_thin_plates_are_told_the_error_of_their_limit(theory: str) -> None:
    """From 1e-3 to 1e-4 of the length neither modes nor their errors change any more; round-off is not in the way."""
    found = []
    for thickness in (1e-3, 1e-4):
        plate = {"type": "plate", "length": 1.0, "width": 1.0, "E": 7e10, "nu": 0.3, "rho": 2700.0}
        tables = {"structure": {**plate, "thickness": thickness}, "motion": {"type": "constant", "speed": 0.0}}
        result = modes({**tables, "model": {"theory": theory}, "mesh": {"elements": [8, 8]}, "modes": {"count": 4}})
        assert not any("rough" in text for text in result.summary["warnings"])
        found.append([row["mesh_error"] for row in result.rows])
    for thick, thin in zip(*found, strict=True):
        assert 0.5 < thin / thick < 2.0
