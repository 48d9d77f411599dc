"""What a reader of a figure needs: units on axes, data inside, nothing cut off, what is 0 or too long said."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.contour import ContourSet
from matplotlib.tri import Triangulation

from rotfem.along import FORCES, STRAINS
from rotfem.results.campbell import CampbellResult
from rotfem.results.modes import ModesResult, ResponseResult
from rotfem.results.of_scene import CheckResult
from rotfem.results.plots_campbell import campbell_figure, spread
from rotfem.results.run import RunResult, StationHistory
from rotfem.results.surfaces import Surface
from tests.figures import check

ZERO = "0 (below 1e-9 of the largest of the unit): "


def said(**more: Any) -> dict[str, Any]:
    return {"name": "blade", "theory": "reissner", "status": "done", "warnings": [], **more}


def titles(figure: Any) -> list[str]:
    return [axes.get_title(loc="left") for axes in figure.axes]


# --- Campbell diagrams ------------------------------------------------------------------------------------------------

SPEEDS = np.linspace(0.0, 2.0, 9)
BLADE = {"1st flapwise": 4.2, "1st edgewise": 6.7, "2nd flapwise": 12.0, "2nd edgewise": 12.1, "3rd flapwise": 27.0}
FURTHER = {"1st torsion": 35.0, "4th flapwise": 44.0, "3rd edgewise": 50.0, "2nd torsion": 60.0, "5th flapwise": 70.0}


def diagram(frequencies: dict[str, float], damping: float = 0.0, **more: Any) -> CampbellResult:
    """Return branches of squared frequencies ω₀² + 1.3 Ω², and where they meet kΩ."""
    rows, crossings = [], []
    for branch, (name, at_rest) in enumerate(frequencies.items(), start=1):
        for speed in SPEEDS:
            values = {"frequency": float(np.hypot(at_rest, np.sqrt(1.3) * speed)), "damping": damping, "growth": 0.0}
            rows.append({"speed": float(speed), "branch": branch, "label": name, "mode": name, **values, "refined": 0})
        for k in more.get("orders", [1, 2, 3, 4]):
            if k**2 > 1.3 and (speed := at_rest / np.sqrt(k**2 - 1.3)) < SPEEDS[-1]:
                place = {"speed": speed, "kind": "per_rev", "order": k, "per_rev": k, "frequency": k * speed}
                crossings.append({**place, "branch": branch, "label": name})
    branches = [{"branch": i, "label": name} for i, name in enumerate(frequencies, start=1)]
    found = {"critical_speeds": crossings, "instabilities": [], "ambiguous": [], "orders": [1, 2, 3, 4]}
    units = {"scene": {"output": {"speed": "rpm", "frequency": "Hz"}}}
    rows.sort(key=lambda row: row["speed"])
    return CampbellResult(said(branches=branches, **(found | units | more)), rows)


@pytest.mark.parametrize("orders", [[1, 2, 3, 4], list(range(1, 16)), []])
@pytest.mark.parametrize("frequencies", [BLADE, BLADE | FURTHER])
def test_a_campbell_diagram_can_be_read(frequencies: dict[str, float], orders: list[int]) -> None:
    """What is marked is in the legend."""
    marks = {"rated": 12.1 * np.pi / 30, "operating": [6.9 * np.pi / 30, 12.1 * np.pi / 30]}
    onsets = [{"speed": 1.5, "kind": "dynamic instability", "until": None}]
    doubts = [{"branch": 1, "speed": 1.0, "confidence": 0.3}]
    figure = campbell_figure(diagram(frequencies, 0.01, orders=orders, instabilities=onsets, ambiguous=doubts, **marks))
    check(figure)
    assert figure.axes[1].get_ylabel() == "damping ratio (%)"
    texts = {text.get_text() for text in figure.legends[0].get_texts()}
    assert {"operating range, 6.9 to 12.1 rpm", "rated speed, 12.1 rpm", "ambiguous"} <= texts
    assert len(campbell_figure(diagram(frequencies, 1e-10)).axes) == 1, "round-off is no damping"


def test_the_limit_follows_the_modes_that_lines_meet() -> None:
    """At 2 rad/s the line 3Ω reaches 6 rad/s: the first mode is met, the second is the next; others are named above."""
    axis = campbell_figure(diagram(BLADE | FURTHER, orders=[1, 3])).axes[0]
    highest = np.hypot(6.7, np.sqrt(1.3) * 2.0) / (2 * np.pi)
    assert highest < axis.get_ylim()[1] < 1.1 * highest
    names = [text.get_text() for text in axis.texts]
    assert {"1st flapwise", "1st edgewise"} <= set(names)
    assert any("↑ 4 more" in name and "↑ 2nd flapwise" in name for name in names)
    everything = campbell_figure(diagram(BLADE | FURTHER, orders=[])).axes[0]
    assert everything.get_ylim()[1] > 70.0 / (2 * np.pi)


def test_a_branch_touches_zero_at_its_forward_critical_speed() -> None:
    result = diagram({"1st forward whirl": 1.0}, 0.02)
    place = {"speed": 0.9, "kind": "forward", "order": 1, "per_rev": 0, "frequency": 0.0, "branch": 1}
    result.summary["critical_speeds"] = [{**place, "label": "1st forward whirl"}]
    frequency, damping = campbell_figure(result).axes
    lines = [line for line in frequency.get_lines() if len(line.get_xdata()) == len(SPEEDS) + 1]
    assert np.min(lines[0].get_ydata()) == 0.0
    assert any(np.array_equal(line.get_ydata(), 2.0 * np.ones(len(SPEEDS))) for line in damping.get_lines())


def test_labels_are_spread_least() -> None:
    assert spread([5.0, 1.0, 1.0], 1.0, (0.0, 9.0)) == [5.0, 0.5, 1.5]
    assert spread([8.9, 9.0], 1.0, (0.0, 9.0)) == [8.0, 9.0], "labels stay within the limits"
    assert spread([1.0, 1.0, 1.0], 5.0, (0.0, 4.0)) == [0.0, 2.0, 4.0], "as far apart as there is room"


# --- histories and shapes ---------------------------------------------------------------------------------------------


def run_of(t: Any, **columns: Any) -> RunResult:
    still = {"psi": 6.0 * t, "psi_dot": 6.0 + 0.0 * t}
    return RunResult(said(kind="history"), {"t": t, **still, **columns}, {})


T = np.linspace(0.0, 100.0, 20001)


def test_what_is_zero_has_no_panel() -> None:
    """Round-off is 0, as stated; so is a speed that does not change."""
    figure = run_of(T, tip_u1=1e-16 * T, tip_u2=np.sin(T), tip_u3=2e-9 * np.sin(T), tip_theta1=0.0 * T).plot()
    check(figure)
    assert titles(figure) == ["tip u₂", "tip u₃"]
    title = "blade: reissner, rotating frame, 6 rad/s\n" + ZERO + "tip u₁, tip rotation θ₁"
    assert figure.get_suptitle() == title


def test_hub_and_root_are_drawn() -> None:
    names = [f"root_{kind}{i}" for kind in "fm" for i in (1, 2, 3)]
    roots = {name: 1e6 * np.cos(T + i) for i, name in enumerate(names)}
    tip = {f"tip_{name}": np.sin(T) for name in ("u1", "u2", "u3", "theta1", "theta2", "theta3")}
    result = run_of(T, **tip, torque=np.cos(T), **roots)
    result.history["psi_dot"] = T
    assert list(result.drawings()) == ["history.png", "loads.png"]
    assert titles(result.plot())[6:] == ["speed Ω", "angle ψ", "torque on the hub"]
    for drawing in result.drawings():
        check(result.plot(drawing=drawing))
    assert len(result.plot(drawing="loads").axes) == 6
    for name in names[:-1]:  # of which the line below the title is long
        result.history[name] = 0.0 * T
    check(result.plot(drawing="loads"))


def test_a_steady_state_and_one_in_which_nothing_moves() -> None:
    x = np.linspace(0.0, 2.0, 21)
    history = {"t": np.zeros(1), "psi_dot": np.ones(1)}
    shape = {"x": x, "u1": 1e-5 * x, "u2": 0 * x, "u3": -(x**2), "theta2": 2 * x}
    figure = RunResult(said(kind="steady"), history, shape).plot()
    check(figure)
    assert titles(figure) == ["u₁", "u₃", "rotation θ₂"]
    still = RunResult(said(kind="steady"), history, {"x": x, "u1": 0 * x}).plot()
    assert still.get_suptitle().endswith(ZERO + "u₁")
    columns, triangles = nodes()
    plate = RunResult(said(kind="steady"), {}, columns | {f"u{i}": 0 * columns["x"] for i in (1, 2, 3)}, triangles)
    rows = [{"frequency": w} for w in (1.0, 2.0)]
    for result in (plate, ResponseResult(said(outputs=["tip_u2"], speed=0.0), rows, np.zeros((2, 1)))):
        check(result.plot())


def test_section_forces_over_time() -> None:
    """Forces and unknowns have a panel each, with a line for each station."""
    x, t = np.linspace(0.0, 10.0, 6), np.linspace(0.0, 1.0, 11)
    names = [*FORCES["spatial_beam"], *STRAINS["spatial_beam"], "u1", "u2", "u3", "theta1", "theta2", "theta3"]
    values = {name: 10.0**i * np.outer(np.sin(np.pi * t), 1 + x) for i, name in enumerate(names)}
    result = RunResult(said(kind="history"), {"t": t}, stations=StationHistory(t, x, values))
    figure = result.plot(drawing="stations")
    check(figure)
    assert len(figure.axes) == 12
    assert [len(panel.get_lines()) for panel in figure.axes] == [6] * 12


# --- small motions ----------------------------------------------------------------------------------------------------


def test_modes_of_a_beam() -> None:
    x = np.linspace(0.0, 2.0, 41)
    shapes, rows = {}, []
    for i in range(1, 7):
        columns = {"x": x, "u1": 0 * x, "u2": np.sin(i * x), "u3": 0.3 * x, "theta1": 0.1 * x, "theta2": 5 * x}
        shapes[f"mode {i}: {i}th flapwise"] = columns | {f"{n}_imag": 0.01 * v for n, v in columns.items() if n != "x"}
        rows.append({"mode": i, "label": f"{i}th flapwise", "frequency": 3.0 * i})
    figure = ModesResult(said(speed=1.0), rows, shapes).plot()
    check(figure)
    assert titles(figure)[1] == "2  2th flapwise, 6 rad/s"
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["u₂", "u₃", "twist θ₁ × length"]


@pytest.mark.parametrize("omega", [np.linspace(0.1, 30.0, 400), np.array([3.0])])
def test_a_response(omega: Any) -> None:
    """Two resonances; outputs of a kind share a row, what does not answer is named; a single frequency is a point."""
    one = 1 / (25 - omega**2 + 0.1j * omega) + 0.2 / (400 - omega**2 + 0.4j * omega)
    outputs = ["tip_u1", "tip_u2", "tip_u3", "tip_theta1", "root_f1", "root_f2", "root_m3", "M3@1.5"]
    direct = np.column_stack([1e-14 * one, one, 0.3 * one, one, 1e6 * one, one, one, one])
    figure = ResponseResult(said(outputs=outputs, speed=6.0), [{"frequency": w} for w in omega], direct).plot()
    check(figure)
    amplitudes = figure.axes[:4]
    assert [len(axes.get_lines()) for axes in amplitudes] == [2, 1, 2, 1]
    assert {line.get_marker() == "." for line in amplitudes[0].get_lines()} == {len(omega) == 1}
    assert figure.get_suptitle().endswith(ZERO + "tip u₁")
    low, high = amplitudes[0].get_ylim()
    sizes = np.abs(direct[:, [1, 2]])
    assert high > sizes.max()
    assert np.all(np.mean(sizes < low, axis=0) < 0.05)


# --- plates -----------------------------------------------------------------------------------------------------------


def nodes(aspect: float = 0.5) -> tuple[dict[str, Any], Any]:
    """Return the nodes of a rectangle, 1 m long, and triangles between them."""
    x, y = (values.ravel() for values in np.meshgrid(np.linspace(0.0, 1.0, 9), np.linspace(0.0, aspect, 6)))
    return {"x": x, "y": y}, Triangulation(x, y).triangles


def colours(axes: Any) -> tuple[str, float, float]:
    drawn = axes.collections[-1]
    return drawn.get_cmap().name, float(drawn.norm.vmin), float(drawn.norm.vmax)


def test_stresses_from_zero_in_one_hue_and_what_has_two_signs_about_zero() -> None:
    columns, triangles = nodes()
    x, y = columns["x"], columns["y"]
    result = run_of(np.zeros(1))
    result.triangles = triangles
    result.resultants = columns | {"n11": -3.0 * x, "m11": x - 0.3, "m22": 1e-15 * y, "von_mises": 2e8 + 1e8 * y}
    figure = result.plot(drawing="resultants")
    check(figure)
    assert figure.get_suptitle().endswith(ZERO + "moment m₂₂")
    found = {axes.get_title(): colours(axes) for axes in figure.axes if axes.get_title()}
    assert found == {
        "membrane force n₁₁": ("Blues_r", -3.0, 0.0),
        "moment m₁₁": ("RdBu_r", -0.7, 0.7),
        "equivalent stress": ("Reds", 0.0, pytest.approx(2.5e8)),
    }


@pytest.mark.parametrize(("count", "aspect"), [(1, 1.0), (3, 0.1), (7, 1.0)])
def test_modes_of_a_plate(count: int, aspect: float) -> None:
    """One colour bar from −1 to 1 for all; no nodal line along the clamp."""
    columns, triangles = nodes(aspect)
    x, y = columns["x"], columns["y"]
    shapes, rows = {}, []
    for i in range(1, count + 1):
        w = np.sin(i * np.pi * x / 2) * (y - 0.5 * aspect) / aspect
        shapes[f"mode {i}: {i}th torsion"] = columns | {"u1": 0 * x, "u2": 0 * x, "u3": 2 * w}
        rows.append({"mode": i, "label": f"{i}th torsion", "frequency": 3.0 * i})
    result = ModesResult(said(speed=1.0), rows, shapes)
    result.triangles = triangles
    figure = result.plot()
    check(figure)
    assert len(figure.axes) == count + 1
    assert colours(figure.axes[0]) == ("RdBu_r", -1.0, 1.0)
    line = next(c for c in figure.axes[0].collections if isinstance(c, ContourSet)).get_paths()[0].vertices
    assert np.min(line[:, 0]) > 0.0, "the clamp is no nodal line"


def test_properties_of_a_blade() -> None:
    x = np.linspace(0.0, 60.0, 13)
    columns = {name: np.exp(-x / 20) for name in ("EA", "GA2", "GA3", "EI2", "EI3", "GJ", "mass_per_length")}
    columns |= {"x": x, "pretwist": 0.01 * x}
    axes = np.broadcast_to([[0.0, 1.0, 0.0]], (13, 3)), np.broadcast_to([[0.0, 0.0, 0.2]], (13, 3))
    surface = Surface.of_beam(np.column_stack([x, 0 * x, 0.1 * x]), axes, 60.0)
    center = [20.0, 0.0, 2.0]
    result = CheckResult(said(mass=1e4, length=60.0, root=[0.0] * 3, center_of_mass=center), columns, {"x": x}, surface)
    check(result.plot())
