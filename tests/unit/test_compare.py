"""Results side by side: distances that are known, modes and branches that are exchanged."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rotfem.errors import InputError
from rotfem.results.campbell import CampbellResult
from rotfem.results.compare import compare
from rotfem.results.modes import ModesResult, ResponseResult
from rotfem.results.run import RunResult
from rotfem.version import __version__

X = np.linspace(0.0, 1.0, 41)


def summary(command: str, name: str = "a", **more: Any) -> dict[str, Any]:
    versions = {"rotfem": __version__}
    return {"command": command, "status": "done", "name": name, "warnings": [], "versions": versions, **more}


def history(name: str, n: int, end: float, size: float = 1.0) -> RunResult:
    """A tip that moves on a circle, and a speed."""
    t = np.linspace(0.0, end, n)
    tip = {"tip_u1": 0.01 * np.cos(t), "tip_u2": size * np.sin(t)}
    return RunResult(summary("run", name, kind="history"), {"t": t, "psi_dot": 0.0 * t, **tip})


NAMES = ("0th edgewise", "1st edgewise", "2nd edgewise", "3rd edgewise")


def modes(name: str, numbers: tuple[int, ...], factor: float = 1.0, nodes: Any = X) -> ModesResult:
    """Sine modes of these numbers, of frequency n² times a factor."""
    rows = [
        {"mode": i, "label": NAMES[n], "frequency": factor * n**2, "frequency_hz": 0.0}
        for i, n in enumerate(numbers, start=1)
    ]
    shapes = {
        f"mode {i}": {"x": 2 * nodes, "u2": np.sin(n * np.pi * nodes), "u2_imag": np.zeros(len(nodes))}
        for i, n in enumerate(numbers, start=1)
    }
    return ModesResult(summary("modes", name, speed=0.0), rows, shapes)


def campbell(name: str, labels: tuple[str, ...], factor: float, last: float = 10.0) -> CampbellResult:
    speeds = np.linspace(0.0, last, 11)
    rows = [
        {"speed": s, "branch": b, "label": label, "frequency": factor * np.sqrt((10.0 * b) ** 2 + s**2)}
        for s in speeds
        for b, label in enumerate(labels, start=1)
    ]
    critical = [
        {"speed": 10.0 * factor, "kind": "per_rev", "order": 2, "branch": 2, "per_rev": 2, "label": labels[1]},
        {"speed": 5.0 * factor, "kind": "per_rev", "order": 2, "branch": 1, "per_rev": 2, "label": labels[0]},
    ]
    keys = {"branches": [], "instabilities": [], "ambiguous": [], "per_rev": 2}
    return CampbellResult(summary("campbell", name, critical_speeds=critical, **keys), rows)


def test_distance_of_histories_on_other_times() -> None:
    """The second is 1 % larger, on other times, and ends earlier: as far as both go they are 1 % apart."""
    found = {row["quantity"]: row for row in compare(history("a", 401, 10.0), history("b", 297, 7.0, 1.01)).rows}
    assert found["tip_u2"]["difference"] == pytest.approx(0.01, rel=1e-3)
    square = (7.0 - np.sin(14.0) / 2) / 14.0  # mean of sin² over 7 s
    assert found["tip_u2"]["rms"] == pytest.approx(0.01 * np.sqrt(square), rel=1e-3)
    assert abs(found["tip_u2"]["reference"]) == pytest.approx(1.0, rel=1e-3)
    assert found["tip_u1"]["difference"] < 1e-8  # of the size of the tip's whole displacement
    assert found["psi_dot"]["difference"] == 0.0  # both rest


def test_distance_of_steady_states() -> None:
    a, b = history("a", 1, 0.0), history("b", 1, 0.0)
    b.history["tip_u1"] = np.array([0.02])
    found = {row["quantity"]: row for row in compare(a, b).rows}
    assert found["tip_u1"]["difference"] == pytest.approx(1.0)


def test_distance_of_responses_counts_the_phase() -> None:
    omega = np.linspace(1.0, 2.0, 5)

    def of(name: str, turn: float) -> ResponseResult:
        values = np.exp(1j * turn) * np.ones((5, 1))
        rows = [{"frequency": float(w), "tip_u2": 1.0, "tip_u2_phase": turn} for w in omega]
        return ResponseResult(summary("response", name, outputs=["tip_u2"], speed=0.0), rows, values)

    (row,) = compare(of("a", 0.0), of("b", 0.1)).rows
    assert row["difference"] == pytest.approx(2 * np.sin(0.05))  # |e^{0.1 i} − 1|
    assert (row["reference"], row["value"]) == pytest.approx((1.0, 1.0))


def test_modes_are_matched_by_their_shapes() -> None:
    """They come in another order and on other nodes; sines of different numbers are orthogonal."""
    other = modes("b", (3, 1, 2), 1.1, np.linspace(0.0, 1.0, 81))
    found = {row["quantity"]: row for row in compare(modes("a", (1, 2, 3)), other).rows}
    for n in (1, 2, 3):
        row = found[NAMES[n]]
        assert row["difference"] == pytest.approx(0.1)
        assert row["mac"] == pytest.approx(1.0, abs=1e-9)


def test_modes_without_a_common_component_are_matched_by_frequency() -> None:
    other = modes("b", (1, 2))
    for shape in other.shapes.values():
        shape["u3"], shape["u3_imag"] = shape.pop("u2"), shape.pop("u2_imag")
    rows = compare(modes("a", (1, 2)), other).rows
    assert [(row["difference"], row["mac"]) for row in rows] == [(0.0, 0.0)] * 2


def test_branches_are_matched_by_name_then_by_frequency() -> None:
    b = campbell("b", ("1st edgewise", "edge 2", "1st axial"), 1.05, last=8.0)
    result = compare(campbell("a", ("1st edgewise", "2nd edgewise", "1st axial"), 1.0), b)
    for row in result.rows:
        assert row["difference"] == pytest.approx(0.05, rel=1e-2), row
    assert len(result.rows) == 3 + 2  # the critical speeds are among them
    assert result.summary["worst"] == max(row["difference"] for row in result.rows)


def test_what_only_one_has_is_said() -> None:
    b = history("b", 401, 10.0)
    b.history["torque"] = np.zeros(401)
    result = compare(history("a", 401, 10.0), b)
    assert result.summary["worst"] == 0.0
    assert result.warnings == ["b and a: only one of them has torque"]


def test_a_rigid_body_has_no_partner_of_another_kind() -> None:
    """The hub of one result is free; the first modes are as many as those of the other."""
    free, held = modes("a", (0, 1, 2)), modes("b", (1, 2, 3))
    free.rows[0]["label"] = "rigid body"
    free.shapes.pop("mode 1")
    for pair in ((free, held), (held, free)):
        result = compare(*pair)
        assert [row["quantity"] for row in result.rows] == ["1st edgewise", "2nd edgewise"]
        assert result.summary["worst"] == 0.0
        (said,) = result.warnings
        assert said.endswith(("rigid body, 3rd edgewise", "3rd edgewise, rigid body"))


def test_what_cannot_be_compared_is_refused(tmp_path: Path) -> None:
    a = history("a", 5, 1.0)
    with pytest.raises(InputError, match="two results at least"):
        compare(a)
    with pytest.raises(InputError, match="b: modes.*must be of run, as a is"):
        compare(a, modes("b", (1,)))
    with pytest.raises(InputError, match="no results.*must be a folder with finished results of run, modes"):
        compare(a, tmp_path)
    with pytest.raises(InputError, match="run, failed"):
        compare(a, a.with_summary(status="failed"))
    b = history("b", 5, 1.0)
    b.history["t"] += 2.0
    with pytest.raises(InputError, match=r"0 … 1 and 2 … 3.*must overlap"):
        compare(a, b)


@pytest.mark.parametrize(
    "pair",
    [
        (history("a", 401, 10.0), history("b", 297, 7.0, 1.01)),
        (modes("a", (1, 2, 3)), modes("b", (3, 1, 2), 1.1)),
        (campbell("a", ("1st edgewise", "2nd edgewise"), 1.0), campbell("b", ("1st edgewise", "2nd edgewise"), 1.1)),
    ],
    ids=["run", "modes", "campbell"],
)
def test_figure_names_axes_and_results(pair: tuple[Any, Any]) -> None:
    figure = compare(*pair).plot()
    assert all(axis.get_ylabel() or axis.get_yticklabels() for axis in figure.axes)
    assert figure.axes[-1].get_xlabel()
    assert "b" in [text.get_text() for text in figure.legends[0].get_texts()]
