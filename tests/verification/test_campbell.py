"""Campbell diagrams: branches through veerings and crossings, critical speeds, unstable ranges, what is written."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from rotfem import SceneError, campbell, modes
from rotfem.analysis.branches import AMBIGUOUS, SURE
from rotfem.commands.campbell import parse_speeds
from rotfem.errors import Stopped
from rotfem.results.campbell import CampbellResult

pytestmark = pytest.mark.estimated

Array = npt.NDArray[np.float64]

MESH = {"elements": 12, "degree": 3}


def slender(r: float) -> dict[str, float]:
    """Return the section of the unit beam with radius of gyration r, as in the reference values."""
    return {"EA": r**-2, "GA": r**-2 / 3.059, "EI": 1.0, "mass_per_length": 1.0, "rotary_inertia": r**2}


#: theory, L/r, hub radius, last speed: lag and axial modes meet at least twice on the way
DIAGRAMS = [("reissner", 20, 1.0, 12.0), ("von_karman_linear", 25, 0.0, 60.0)]


def scene(unit_beam: Any, theory: str, slenderness: int, radius: float, **changes: Any) -> Any:
    tables = {"structure.section": slender(1 / slenderness), "structure.hub_radius": radius, "model.theory": theory}
    return unit_beam(tables | changes, mesh=MESH)


def by_branch(result: CampbellResult, name: str) -> dict[int, dict[float, Any]]:
    """Return branch ↦ speed ↦ one entry of its rows."""
    out: dict[int, dict[float, Any]] = {}
    for row in result.rows:
        out.setdefault(row["branch"], {})[row["speed"]] = row[name]
    return out


def exchanges(result: CampbellResult) -> int:
    """Return how many times a branch passes from a share of lag above 0.5 to one below, or back."""
    count = 0
    for shares in by_branch(result, "share_lag").values():
        lag = np.array([shares[s] for s in sorted(shares)]) > 0.5
        count += int(np.count_nonzero(np.diff(lag.astype(int))))
    return count


# --- many speeds ------------------------------------------------------------------------------------------------------


def test_a_basis_of_modes_gives_what_full_solutions_do(unit_beam: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Through a veering, frequencies and names; to 1e-7, as the basis has a solution more than when it met 1e-6."""
    beam, speeds = scene(unit_beam, "von_karman_linear", 25, 0.0), [5.0 * i for i in range(13)]
    quick = campbell(beam, speeds)
    monkeypatch.setattr("rotfem.analysis.reduced_basis.MANY", len(speeds) + 1)
    full = campbell(beam, speeds)
    assert "reduced_basis" in quick.summary
    assert "reduced_basis" not in full.summary
    assert [row["label"] for row in quick.rows] == [row["label"] for row in full.rows]
    for name in ("speed", "frequency"):
        np.testing.assert_allclose([r[name] for r in quick.rows], [r[name] for r in full.rows], rtol=1e-7)


def test_digits_that_the_mixed_form_keeps_are_kept_at_many_speeds(unit_beam: Any) -> None:
    """A beam that hardly stretches: no basis of the displacement form, whose stiffness has lost them."""
    stiff = slender(0.02) | {"EA": 1e11, "GA": 1e11}
    beam = unit_beam({"structure.section": stiff, "model.theory": "consistent_linear", "modes.count": 2}, mesh=MESH)
    result = campbell(beam, [0.1 * i for i in range(12)])
    assert max(row["error_bound"] for row in result.rows) < 1e-5
    assert "reduced_basis" not in result.summary


# --- E: branches -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("theory", "slenderness", "radius", "last"), DIAGRAMS)
def test_veering_branches_do_not_swap(
    unit_beam: Any, theory: str, slenderness: int, radius: float, last: float
) -> None:
    """Nine speeds give the branches of 81, at every common speed; and both are the spectrum in its order.

    The second half is independent of any tracking: with Coriolis force lag and axial motion are coupled, so eigenvalues
    of the one-parameter family do not cross, and the k-th branch is the k-th frequency.
    """
    beam = scene(unit_beam, theory, slenderness, radius)
    coarse, fine = (campbell(beam, np.linspace(0.0, last, n), orders=0) for n in (9, 81))
    assert exchanges(fine) >= 4  # two branches take part in each of at least two veerings
    a, b = (by_branch(result, "frequency") for result in (coarse, fine))
    compared = 0
    for branch in range(1, 7):
        common = sorted(a[branch].keys() & b[branch].keys())
        assert len(common) >= 9
        np.testing.assert_allclose([a[branch][s] for s in common], [b[branch][s] for s in common], rtol=1e-7, atol=1e-7)
        compared += len(common)
    for result, table in ((coarse, a), (fine, b)):
        for speed in table[1]:
            assert np.all(np.diff([table[branch][speed] for branch in range(1, 7)]) > 0)
        assert result.summary["ambiguous"] == []
        assert min(row["confidence"] for row in result.rows) >= SURE - 1e-12
        assert result.summary["speeds_inserted"] == 0
    print(f"E {theory}: {compared} values compared, {exchanges(fine) // 2} veerings")


@pytest.mark.parametrize("theory", ["reissner", "consistent_linear"])
def test_crossing_branches_cross(unit_beam: Any, theory: str) -> None:
    """Without Coriolis force lag and axial modes do not know of each other: branches keep their family and cross."""
    beam = scene(unit_beam, theory, 20, 1.0, **{"model.effects": ["centrifugal", "rotary_inertia"]})
    coarse, fine = (campbell(beam, np.linspace(0.0, 9.0, n), orders=0) for n in (4, 31))
    for result in (coarse, fine):
        assert exchanges(result) == 0
        families = by_branch(result, "mode")
        for names in families.values():
            assert len({name.split(" ")[1] for name in names.values()}) == 1
        assert any("coriolis" in text for text in result.summary["warnings"])
    ends = [b["frequency_last"] for b in coarse.summary["branches"]]
    assert np.any(np.diff(ends) < 0)  # they did change places
    np.testing.assert_allclose(ends, [b["frequency_last"] for b in fine.summary["branches"]], rtol=1e-9)


def test_branches_are_the_modes_of_their_speed(unit_beam: Any) -> None:
    """One row of a sweep, refined in between and continued from speed to speed, against `modes` at that speed."""
    beam = scene(unit_beam, "reissner", 20, 1.0)
    result = campbell(beam, "0:12:5", orders=0)
    for speed in (3.0, 12.0):
        alone = modes(beam.replace({"motion.speed": speed}))
        rows = [row for row in result.rows if row["speed"] == speed]
        assert not any(row["refined"] for row in rows)
        np.testing.assert_allclose(
            sorted(row["frequency"] for row in rows), [row["frequency"] for row in alone.rows], rtol=1e-8
        )
    assert {row["speed"] for row in result.rows if not row["refined"]} == {0.0, 3.0, 6.0, 9.0, 12.0}
    assert all(0.0 <= row["confidence"] <= 1.0 for row in result.rows)
    assert all(row["residual"] < 1e-8 for row in result.rows)


def test_speeds_that_are_finished_are_not_solved_again(unit_beam: Any, tmp_path: Path) -> None:
    """Interrupted after three of five speeds: the diagram of three, and then all of it by three solutions less."""

    def interrupt(share: float) -> None:
        if share >= 0.5:
            raise KeyboardInterrupt

    beam = scene(unit_beam, "reissner", 20, 1.0)
    with pytest.raises(Stopped) as stop:
        campbell(beam, "0:12:5", folder=tmp_path, progress=interrupt)
    until = stop.value.result
    assert until.summary["status"] == "interrupted"
    assert list(until.speeds) == [0.0, 3.0, 6.0]
    assert any(text.startswith("3 of 5 speeds are finished, up to 6 rad/s") for text in until.summary["warnings"])
    other = campbell(beam.replace({"modes.count": 5}), "0:12:5", folder=tmp_path)
    assert not (tmp_path / "speeds.npz").exists()
    with pytest.raises(Stopped):
        campbell(beam, "0:12:5", folder=tmp_path, progress=interrupt)
    rest, whole = campbell(beam, "0:12:5", folder=tmp_path), campbell(beam, "0:12:5")
    assert not (tmp_path / "speeds.npz").exists()
    assert rest.summary["speeds_solved"] == whole.summary["speeds_solved"] - 3
    assert other.summary["speeds_solved"] >= 5
    np.testing.assert_allclose(rest.frequencies, whole.frequencies, rtol=1e-10)
    found, expected = ([c.speed for c in r.critical_speeds] for r in (rest, whole))
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_only_the_speeds_that_are_asked_for(unit_beam: Any) -> None:
    """Critical speeds are interpolated then, 2 rad/s apart to 1e-3; the branches are those of a whole diagram."""
    beam = scene(unit_beam, "reissner", 20, 1.0)
    few, whole = (campbell(beam, "0:12:7", only=only) for only in (True, False))
    assert few.summary["speeds_solved"] == 7
    np.testing.assert_array_equal(few.frequencies, whole.frequencies)
    pairs = zip(few.critical_speeds, whole.critical_speeds, strict=True)
    assert max(abs(a.speed / b.speed - 1.0) for a, b in pairs) < 1e-3
    assert any("interpolated" in text for text in few.summary["warnings"])


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
def test_a_hinge_that_nothing_holds_is_one_branch(spin_up: Any, theory: str) -> None:
    """On the axis its frequency is zero at any speed, to round-off: no reason to solve others than those asked for."""
    loose = {"structure.root": {"lag_stiffness": 0.0}, "model.theory": theory, "modes.count": 3}
    result = campbell(spin_up(loose, mesh={"elements": 3}), [-4.0, -2.0, 0.0, 2.0, 4.0])
    assert result.summary["speeds_solved"] == 5
    assert result.summary["ambiguous"] == []
    assert all(row["label"] != "1st edgewise" for row in result.summary["critical_speeds"])


def test_lost_and_ambiguous_branches_are_said_to_be(unit_beam: Any) -> None:
    """consistent_linear beyond N0 = GA_s, the end of the theory: short waves come in at once and push branches out."""
    result = campbell(scene(unit_beam, "consistent_linear", 30, 0.0), "0:40:2", orders=0)
    summary = result.summary
    assert summary["speeds_inserted"] <= 2 + 4
    lost = [b["label"] for b in summary["branches"] if b["frequency_last"] is None]
    assert lost
    for label in lost:
        assert any(text.startswith(label) and "left the computed modes" in text for text in summary["warnings"])
        assert max(result.branches()[label]["speed"]) < 40.0  # no row pretends to follow it
    assert any(onset["kind"] == "static instability" for onset in summary["instabilities"])
    # With no speed between them, the model of so many modes leaves some in doubt.
    summary = campbell(scene(unit_beam, "consistent_linear", 30, 0.0), "0:40:2", orders=0, only=True).summary
    assert summary["ambiguous"]
    for entry in summary["ambiguous"]:
        assert 0.0 <= entry["confidence"] < AMBIGUOUS
        assert 0.0 < entry["speed"] <= 40.0
        label = summary["branches"][entry["branch"] - 1]["label"]
        assert any(text.startswith(f"ambiguous: {label} at") for text in summary["warnings"])
    assert all(0.0 <= row["confidence"] <= 1.0 for row in result.rows)


# --- critical speeds and instability ---------------------------------------------------------------------------------


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
def test_critical_speeds(spin_up: Any, theory: str) -> None:
    """Where a branch meets k Ω: found between the speeds asked for, checked by `modes` at the speed found."""
    beam = spin_up({"model.theory": theory, "modes.count": 4})
    result = campbell(beam, "0:8:5", orders=4)
    crossings = result.summary["critical_speeds"]
    assert result.summary["per_rev"] == 4
    assert result.summary["speeds_solved"] <= 2 * 5 + 4
    expected = [("1st edgewise", 4), ("1st edgewise", 3), ("1st edgewise", 2), ("1st edgewise", 1), ("2nd edgewise", 4)]
    assert [(c["label"], c["per_rev"]) for c in crossings] == expected
    for c in crossings:
        assert c["frequency"] == pytest.approx(c["per_rev"] * c["speed"], rel=1e-12)
        rows = modes(beam.replace({"motion": {"type": "constant", "speed": c["speed"]}})).rows
        nearest = min(abs(row["frequency"] - c["frequency"]) for row in rows)
        assert nearest < 1e-6 * c["frequency"]


def test_onset_and_end_of_flutter(unit_beam: Any) -> None:
    """A follower force just above Beck's load: the beam at rest flutters, the centrifugal force steadies it."""
    load = {"tip_force": {"value": [-22.0, 0.0], "kind": "follower"}}
    beam = unit_beam({"structure.section": slender(1e-2), "modes.count": 3}, mesh=MESH, loads=load)
    (ending,) = campbell(beam, [0.0, 2.0, 4.0], orders=0).summary["instabilities"]
    assert ending["speed"] == 0.0
    assert ending["kind"] == "dynamic instability"
    assert 2.0 < ending["until"] < 4.0
    result = campbell(beam, [-4.0, -2.0, 0.0], orders=0)
    (starting,) = result.summary["instabilities"]
    assert starting["speed"] == pytest.approx(-ending["until"], rel=1e-6)
    assert starting["until"] is None
    assert any(text.startswith("dynamic instability from -2.") for text in result.summary["warnings"])
    for factor, kinds in ((0.9999, {"stable", "dynamic instability"}), (1.0001, {"stable"})):
        rows = modes(beam.replace({"motion.speed": factor * ending["until"]})).rows
        assert {row["stability"] for row in rows} == kinds


def test_unstable_at_the_first_speed(hub_beam: Any) -> None:
    """A sweep that begins beyond the critical speed says so."""
    result = campbell(hub_beam({"model.theory": "linear", "modes.count": 2}), [4.0, 5.0], orders=0)
    assert result.summary["instabilities"] == [{"speed": 4.0, "kind": "static instability", "until": None}]
    assert any(text.startswith("static instability from 4 rad/s on") for text in result.summary["warnings"])


# --- what is written -------------------------------------------------------------------------------------------------


def test_speeds_as_text() -> None:
    assert parse_speeds("0:12:4") == [0.0, 4.0, 8.0, 12.0]
    assert parse_speeds("1, 2.5,4") == [1.0, 2.5, 4.0]
    for bad in ("", "3", "0:12", "0:12:1", "12:0:5", "1,1,2", "2,1", "a:b:c", "0:inf:3", "1,nan", "0:1:2.5"):
        with pytest.raises(SceneError, match="--speeds") as caught:
            parse_speeds(bad)
        assert "first:last:number" in str(caught.value)


def test_as_many_lines_as_meet_a_branch(unit_beam: Any) -> None:
    """Lines 1Ω … 4Ω at most, fewer where the last speed is above all frequencies; none where none are wanted."""
    beam = scene(unit_beam, "consistent_linear", 20, 0.0, **{"modes.count": 2})
    assert campbell(beam, "0:5:2").summary["per_rev"] == 4
    assert campbell(beam, "0:10.5:3").summary["per_rev"] == 3
    assert campbell(beam, "0:5:2", orders=0).summary["critical_speeds"] == []


def test_critical_speeds_on_both_sides_of_zero(unit_beam: Any) -> None:
    """The lines ω = k|Ω| have a kink at 0, which no speed is asked for at: what is critical at Ω is so at −Ω."""
    beam = scene(unit_beam, "consistent_linear", 100, 0.3)
    found = sorted(c["speed"] for c in campbell(beam, [-12.0, 12.0], orders=[1, 4]).summary["critical_speeds"])
    assert len(found) >= 4
    np.testing.assert_allclose(found, -np.array(found[::-1]), rtol=1e-6)


def test_lines_and_speeds_of_operation_that_are_asked_for(unit_beam: Any, tmp_path: Path) -> None:
    """Of the lines 1 to 4 those asked for; options win over keys of the scene, and speeds are understood with units."""
    scene = unit_beam({"modes.orders": [4], "modes.operating": ["60 rpm", "90 rpm"]})
    every, some = (campbell(scene, "0:6:7", orders=orders) for orders in (4, [3, 1]))
    assert every.summary["orders"] == [1, 2, 3, 4]
    assert some.summary["orders"] == [1, 3]
    assert campbell(scene, "0:6:3").summary["orders"] == [4]
    expected = [c for c in every.critical_speeds if c.order in (1, 3)]
    assert expected
    assert [(c.label, c.order) for c in some.critical_speeds] == [(c.label, c.order) for c in expected]
    np.testing.assert_allclose([c.speed for c in some.critical_speeds], [c.speed for c in expected], rtol=1e-9)
    marked = campbell(scene, "0:6:3", rated="12.1 rpm", orders=[])
    np.testing.assert_allclose(marked.summary["rated"], 12.1 * np.pi / 30)
    marked.write(tmp_path)
    kept = json.loads((tmp_path / "campbell.json").read_text())
    np.testing.assert_allclose(kept["operating"], [2 * np.pi, 3 * np.pi])
    assert (kept["orders"], kept["critical_speeds"]) == ([], [])
    for wrong in ({"orders": [0]}, {"rated": -1.0}, {"operating": (2.0, 1.0)}, {"operating": ("1 rpm",)}):
        with pytest.raises(SceneError, match=f"modes.{next(iter(wrong))}"):
            campbell(scene, "0:6:3", **wrong)


def test_critical_speeds_are_not_searched_below_round_off(unit_beam: Any) -> None:
    """Of a beam so slender that round-off leaves six digits a search takes four solutions, and stops within them."""
    tables = {"structure.section": slender(1e-6), "model.theory": "reissner", "modes.count": 2}
    found = campbell(unit_beam(tables, mesh=MESH), [0.5, 1.0, 1.5, 2.0, 3.0], orders=4).summary
    crossings = found["critical_speeds"]
    assert len(crossings) == 3
    assert found["speeds_solved"] <= 5 + 4 * len(crossings)
    for crossing in crossings:
        at = modes(unit_beam(tables | {"motion.speed": crossing["speed"]}, mesh=MESH)).rows[0]
        assert at["frequency"] == pytest.approx(crossing["frequency"], rel=4 * at["error_bound"])
