"""Frequency response: against the exported matrices, long time histories, statics."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.io import mmread

import rotfem
from rotfem import SceneError, modes, response
from rotfem.analysis.state_space import write_matrices
from tests.beams import STRUCTURE

pytestmark = pytest.mark.estimated

#: Damping ratios of some per cent at the first modes, so that what a start leaves dies away soon.
LENGTH, SECTION = STRUCTURE["length"], STRUCTURE["section"]
LOAD = {"harmonic": {"amplitude": [0.0, 2.0], "frequency": 1.0, "phase": 0.3}}


def scene(theory: str = "consistent_linear", speed: float = 4.0, **changes: Any) -> dict[str, Any]:
    """Return the beam of all tests with damping and a harmonic force at its tip."""
    tables: dict[str, Any] = {
        "structure": {**STRUCTURE, "damping": {"rayleigh": [0.4, 1e-3]}},
        "motion": {"type": "constant", "speed": speed},
        "model": {"theory": theory},
        "loads": {"tip_force": LOAD},
        "mesh": {"elements": 4},
        "modes": {"count": 4},
    }
    return tables | changes


@pytest.fixture(scope="module")
def swept():
    return response(scene(), 0.0, 40.0, number=21)


def by_scipy(tables: dict[str, Any], omega: float, folder: Any) -> np.ndarray:
    """Return the answer of the tip (u1, u2, alpha) from the exported M, C and K."""
    found = modes(tables)
    write_matrices(found.analysis, found.spinning, folder)
    M, C, K = (mmread(folder / f"{name}.mtx").toarray() for name in "MCK")
    unknowns = (folder / "unknowns.csv").read_text().splitlines()[1:]
    tip = [i for i, line in enumerate(unknowns) if float(line.split(",")[1]) == LENGTH]
    force = np.zeros(len(M), dtype=complex)
    force[next(i for i in tip if unknowns[i].endswith("u2"))] = 2.0 * np.exp(0.3j)
    return np.linalg.solve(K + 1j * omega * C - omega**2 * M, force)[tip]


def test_direct_response_is_that_of_the_exported_matrices(swept, tmp_path):
    """To the digits of the matrices: 1e-8 of the largest component."""
    for i in (3, 12, 20):
        wanted = by_scipy(scene(loads={}), float(swept.frequencies[i]), tmp_path)
        assert swept.direct[i, :3] == pytest.approx(wanted, abs=1e-8 * np.max(np.abs(wanted)))


def test_statics():
    """At rest and at frequency 0 it is F L³/3EI + F L/GA, in phase with the load; root and sections carry F and F x."""
    still = response(scene(speed=0.0, output={"stations": [0.0, 2.5]}), 0.0, 1.0, number=2)
    amplitudes = dict(zip(still.outputs, still.direct[0] * np.exp(-0.3j), strict=True))
    for name, wanted in {"root_f2": -2.0, "root_m3": -20.0, "Q@2.5": 2.0, "M@0": 20.0, "M@2.5": 15.0}.items():
        assert amplitudes[name] == pytest.approx(wanted, rel=1e-8), name
    u2 = still.direct[0, still.outputs.index("tip_u2")]
    assert abs(u2) == pytest.approx(2.0 * LENGTH**3 / (3 * SECTION["EI"]) + 2.0 * LENGTH / SECTION["GA"], rel=1e-9)
    assert np.angle(u2) == pytest.approx(0.3, abs=1e-9)
    assert "per_rev" not in still.rows[0]


def test_a_load_prestresses_what_is_displaced():
    """An axial load on the bent beam of a linear theory: at frequency 0 half the difference of two steady states."""
    steady, amplitude = [0.0, 30.0], 0.1
    harmonic = {"amplitude": [amplitude, 0.0], "frequency": 1.0}
    line = response(scene(loads={"tip_force": {"value": steady, "harmonic": harmonic}}), 0.0, 1.0, number=2)
    ends = [rotfem.run(scene(loads={"tip_force": [sign * amplitude, 30.0]})).summary["figures"] for sign in (1, -1)]
    for name in ("tip_u2", "root_f1", "root_f2"):
        found = line.direct[0, line.outputs.index(name)]
        assert found.real == pytest.approx((ends[0][f"{name}_final"] - ends[1][f"{name}_final"]) / 2, rel=1e-5), name


@pytest.mark.parametrize("speed", [0.0, 2.0])
def test_a_hinge_that_nothing_holds(speed):
    """On the axis it turns as 1/ω²."""
    loose = {**STRUCTURE, "root": {"lag_stiffness": 0.0}, "damping": {"kelvin_voigt": 1e-4}}
    found = response(scene(speed=speed, structure=loose), 1.0, 40.0, number=9)
    swing = 2.0 * LENGTH**2 / (SECTION["mass_per_length"] * LENGTH**3 / 3)  # F L²/I
    assert abs(found.direct[0, 1]) == pytest.approx(swing, rel=2e-2)  # (1/16.7)² of it bends
    with pytest.raises(SceneError, match="a hinge that nothing holds"):
        response(scene(speed=speed, structure=loose), 0.0, 40.0, number=9)


def test_peaks_are_seen(swept):
    """A peak stands at the frequency of its mode, and 1/√2 of it half a width aside, to what other modes add."""
    first = swept.summary["modes"][0]
    omega, half = first["frequency"], -first["growth"]
    peak = swept.summary["peaks"]["tip_u2"]
    assert peak["frequency"] == pytest.approx(omega, abs=half)
    aside = np.abs(swept.frequencies - omega - half) < 1e-9 * omega
    assert swept.amplitude("tip_u2")[aside] == pytest.approx(peak["amplitude"] / np.sqrt(2), rel=0.05)


def test_a_long_history_swings_like_that():
    """Reissner about the deformed steady state under a constant load: tip, root and sections, with every damping.

    1 % of the amplitude after 10 decay times; 0.5 % is of the steps, 60 a turn.
    """
    force = {"value": [0.0, 30.0], "harmonic": {"amplitude": [0.0, 0.1], "per_rev": 1}}
    damped = {**STRUCTURE, "damping": {"rayleigh": [1.0, 1e-3], "modal": [0.1, 0.05]}}
    tables = scene("reissner", 5.0, structure=damped, loads={"tip_force": force})
    tables["output"] = {"stations": [0.0, 4.0], "error": False}
    line = response(tables, per_rev=[1])
    assert [row["per_rev"] for row in line.rows] == [1.0]
    end = 10.0
    run = rotfem.run(tables | {"time": {"end": end, "step": 0.02}, "initial": {"state": "steady"}})
    assert run.stations is not None
    last = run.history["t"] > end - 4 * np.pi / 5.0
    t = run.history["t"][last]
    columns = np.column_stack([np.ones(len(t)), np.cos(5.0 * t), np.sin(5.0 * t)])
    moved = [*(f"tip_{name}" for name in ("u1", "u2", "alpha")), "root_f1", "root_f2", "root_m3"]
    values = {name: run.history[name] for name in moved}
    values |= {f"{name}@{x:g}": run.stations[name][:, i] for name in "NQM" for i, x in enumerate(run.stations.x)}
    for name, value in values.items():
        _, cosine, sine = np.linalg.lstsq(columns, value[last], rcond=None)[0]
        found = line.direct[0, line.outputs.index(name)]
        assert abs(cosine - 1j * sine - found) < 0.01 * abs(found), name


def test_a_free_hub_swings_too():
    """Of a hub that turns at 4 rad/s: tip, angle, root and sections against a long history, 80 steps a turn; 1 %."""
    damped = {**STRUCTURE, "hub_radius": 0.5, "damping": {"kelvin_voigt": 4e-2}}
    hub = {"type": "torque", "hub_inertia": 3000.0, "speed": 4.0}
    load = {"harmonic": {"amplitude": [0.0, 0.05], "frequency": 3.0}}
    tables = scene(structure=damped, motion=hub, loads={"tip_force": load}, modes={"count": 6})
    tables["output"] = {"stations": [0.0, 5.0], "quantities": ["N", "Q", "M"], "error": False}
    line = response(tables, 3.0, 3.001, number=2)
    end = 25 * 2 * np.pi / 3.0
    run = rotfem.run(tables | {"time": {"end": end, "step": 2 * np.pi / 3.0 / 80}})
    assert run.stations is not None
    last = run.history["t"] > end - 2 * np.pi
    t, values = run.history["t"][last], dict(run.history)
    values |= {f"{name}@{x:g}": run.stations[name][:, i] for name in "NQM" for i, x in enumerate(run.stations.x)}
    drift = [t**0, t, t**2]  # the speed goes on from where the start has left it
    columns = np.column_stack([*drift, *(part(k * 3.0 * t) for k in (1, 2) for part in (np.cos, np.sin))])
    for name in (n for n in line.outputs if n in values and n != "alpha@0" and not n.startswith("u")):
        cosine, sine = np.linalg.lstsq(columns, values[name][last], rcond=None)[0][3:5]
        found = line.direct[0, line.outputs.index(name)]
        assert abs(cosine - 1j * sine - found) < 0.01 * abs(found), name


def test_without_damping_it_is_said():
    tables = scene(structure=STRUCTURE)
    warned = response(tables, 1.0, 10.0, number=3)
    assert any("no damping" in line for line in warned.warnings)


@pytest.mark.parametrize(
    ("changes", "asked", "message"),
    [
        ({"loads": {}}, {}, "needs a harmonic load"),
        ({"loads": {"tip_force": {**LOAD, "over_time": [[0, 0, 0], [1, 0, 1]]}}}, {}, "must be constant or harmonic"),
        ({"loads": {"tip_force": {"over_time": [[0, 0, 0], [1, 0, 1]]}}}, {}, "needs a harmonic load"),
        ({"motion": {"type": "torque", "hub_inertia": 100.0}}, {"low": 0.0, "high": 10.0}, "above 0 of a free hub"),
        ({}, {"low": 2.0, "high": 1.0}, "--from"),
        ({}, {"low": "3 m"}, "--from"),
        ({}, {"per_rev": (0.0,)}, "--per-rev"),
    ],
)
def test_what_has_none_is_refused(changes, asked, message):
    with pytest.raises(SceneError, match=message):
        response(scene(**changes), **asked)


def test_files_and_figure(swept, tmp_path):
    swept.write(tmp_path)
    table = (tmp_path / "response.csv").read_text().splitlines()
    assert table[0].startswith("frequency,frequency_hz,per_rev,tip_u1,tip_u1_phase,tip_u2")
    assert len(table) == 1 + len(swept.rows)
    assert len(swept.plot().axes) == 8  # amplitudes and phases of tip u and α, of root force and moment


def test_amplitudes_beyond_linear_theory_are_said():
    """½ θ² of a tenth of a radian is nothing, of more than a third it is."""
    for size, said in ((2.0, False), (200.0, True)):
        found = response(scene(loads={"tip_force": {"harmonic": {**LOAD["harmonic"], "amplitude": [0.0, size]}}}))
        assert any("the response is linear" in warning for warning in found.warnings) == said
