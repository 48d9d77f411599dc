"""What is read from results in Python: properties, tables, labelled arrays and figures, of small results by hand."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from rotfem.errors import OutputError
from rotfem.results.campbell import CampbellResult, CriticalSpeed, Instability
from rotfem.results.columns import SHORT, Columns, ShortTable, described, label, numbers
from rotfem.results.modes import ModesResult
from rotfem.results.result import Result
from rotfem.results.run import RunResult
from tests.figures import check

T = np.array([0.0, 0.5, 1.0])
X = np.array([0.0, 2.0, 4.0])

#: Figures of merit of the motion of `history`.
FIGURES = {"tip_u2_final": 1.0, "tip_u2_min": 0.0, "tip_u2_min_time": 0.0, "tip_u2_max": 1.0, "tip_u2_max_time": 1.0}


def summary(**more: Any) -> dict[str, Any]:
    """Return what every summary holds."""
    return {"name": "beam", "theory": "reissner", "status": "done", "warnings": ["mind the gap"], **more}


def history(**more: Any) -> RunResult:
    """Return the history of a beam's tip."""
    columns = {"t": T, "psi": T**2, "psi_dot": 2 * T, "tip_u1": -(T**2), "tip_u2": T, "tip_alpha": 0.5 * T}
    said = summary(command="run", kind="history", frame="rotating", figures=FIGURES) | more
    return RunResult(said, columns, {"x": X, "u1": -X, "u2": X**2, "alpha": 2 * X})


def shape(scale: complex) -> dict[str, Any]:
    """Return a mode shape along three nodes."""
    values = scale * X / 4
    return {"x": X, "u2": values.real, "u2_imag": values.imag, "alpha": 0 * X, "alpha_imag": 0 * X}


def mode(number: int, label: str, frequency: float, growth: float, **more: Any) -> dict[str, Any]:
    """Return the row of a mode."""
    size = abs(complex(growth, frequency))
    row = {"mode": number, "label": label, "name": label, "frequency": frequency, "growth": growth}
    return row | {"frequency_hz": frequency / (2 * np.pi), "damping": -growth / size if size else 0.0} | more


def modes(stability: str = "stable") -> ModesResult:
    """Return a rigid-body mode and two others, at 6 rad/s."""
    rows = [
        mode(1, "rigid body", 0.0, 0.0, stability="neutral", share_hub=1.0),
        mode(2, "1st edgewise", 4.0, -3.0, stability="stable", share_hub=0.1),
        mode(3, "2nd edgewise", 12.0, 0.5, stability=stability, share_hub=0.2),
    ]
    shapes = {"mode 2: 1st edgewise": shape(1.0), "mode 3: 2nd edgewise": shape(1j)}
    return ModesResult(summary(command="modes", speed=6.0), rows, shapes)


def plate_modes() -> ModesResult:
    """Return one mode of a plate of one triangle."""
    columns = {"x": np.array([0.0, 1.0, 0.0]), "y": np.array([0.0, 0.0, 1.0])}
    for name in ("u1", "u2", "u3"):
        columns |= {name: np.array([0.0, 0.0, float(name == "u3")]), f"{name}_imag": np.zeros(3)}
    rows = [mode(1, "1st flapwise", 2.0, 0.0, stability="stable", turning=0.0)]
    result = ModesResult(summary(command="modes", speed=0.0), rows, {"mode 1: 1st flapwise": columns})
    result.triangles = np.array([[0, 1, 2]])
    return result


def campbell() -> CampbellResult:
    """Return two branches over three speeds, one of them refined; the second branch is lost at the last."""
    rows = [
        {"speed": speed, "branch": branch, "label": name, "mode": name, "frequency": branch * (3.0 + speed)}
        | {"growth": 0.0, "damping": 0.0, "confidence": 1.0, "refined": int(speed == 5.0)}
        for speed in (0.0, 5.0, 10.0)
        for branch, name in ((1, "1st edgewise"), (2, "1st axial"))
        if (speed, branch) != (10.0, 2)
    ]
    ends = {"confidence": 1.0, "frequency_first": 3.0, "frequency_last": 13.0}
    branches = [{"branch": 1, "label": "1st edgewise", **ends}]
    branches.append({**ends, "branch": 2, "label": "1st axial", "frequency_last": None})
    meets = {"speed": 3.0, "kind": "per_rev", "order": 2, "branch": 1, "per_rev": 2, "frequency": 6.0}
    said = summary(
        **{"command": "campbell", "branches": branches, "per_rev": 2, "orders": [1, 2], "ambiguous": []},
        critical_speeds=[{**meets, "label": "1st edgewise"}],
        instabilities=[{"speed": 8.0, "kind": "dynamic instability", "until": None}],
    )
    return CampbellResult(said, rows)


MAKERS = {"run": history, "modes": modes, "plate": plate_modes, "campbell": campbell}
ALL = pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)


# --- properties -------------------------------------------------------------------------------------------------------


def test_a_run_by_its_names() -> None:
    result = history()
    assert (result.status, result.warnings) == ("done", ["mind the gap"])
    np.testing.assert_array_equal(result.t, T)
    assert list(result.tip) == ["u1", "u2", "alpha"]
    np.testing.assert_array_equal(result.tip["u1"], -(T**2))
    np.testing.assert_array_equal(result.column("psi_dot"), 2 * T)
    assert result.figures == FIGURES
    assert not result.steady
    assert history(kind="steady").steady
    with pytest.raises(KeyError, match="no number 'tip_u3' in the table; there are t, psi, psi_dot, tip_u1"):
        result.column("tip_u3")


def test_modes_by_their_names() -> None:
    result = modes()
    assert result.labels == ["rigid body", "1st edgewise", "2nd edgewise"]
    assert result.speed == 6.0
    np.testing.assert_array_equal(result.frequencies, [0.0, 4.0, 12.0])
    np.testing.assert_allclose(2 * np.pi * result.frequencies_hz, result.frequencies)
    np.testing.assert_array_equal(result.growth, [0.0, -3.0, 0.5])
    np.testing.assert_allclose(result.damping[1], 0.6)
    np.testing.assert_array_equal(result.eigenvalues, [0.0, -3.0 + 4.0j, 0.5 + 12.0j])
    np.testing.assert_array_equal(result.column("share_hub"), [1.0, 0.1, 0.2])
    assert result.stable
    assert not modes("dynamic instability").stable
    with pytest.raises(KeyError, match="no number 'label' in the table; there are mode, frequency"):
        result.column("label")


def test_branches_over_speed() -> None:
    result = campbell()
    np.testing.assert_array_equal(result.speeds, [0.0, 5.0, 10.0])
    np.testing.assert_array_equal(result.refined, [False, True, False])
    assert result.labels == ["1st edgewise", "1st axial"]
    np.testing.assert_array_equal(result.frequencies, [[3.0, 6.0], [8.0, 16.0], [13.0, np.nan]])
    assert result.growth.shape == result.damping.shape == (3, 2)
    assert result.critical_speeds == [CriticalSpeed(3.0, "per_rev", 2, 1, 2, 6.0, "1st edgewise")]
    assert result.instabilities == [Instability(8.0, "dynamic instability", None)]
    np.testing.assert_array_equal(result.branches()["1st axial"]["frequency"], [6.0, 16.0])


# --- columns: CSV, tables, labelled arrays ----------------------------------------------------------------------------


def test_columns_of_rows() -> None:
    """What a row does not have is empty in CSV, NaN in arrays; rows with two labels are places of a grid."""
    rows = [{"k": 1, "l": "a", "u": 0.1, "ok": True}, {"k": 1, "l": "b", "u": None, "why": "x"}, {"k": 2, "l": "a"}]
    columns = Columns.of_rows(rows, ("k", "l"))
    assert columns.csv() == "k,l,u,ok,why\n1,a,0.1,True,\n1,b,,,x\n2,a,,,\n"
    assert columns.numbers == ["k", "u", "ok"]
    found = columns.variables()
    assert found["l"][1].tolist() == ["a", "b"]
    np.testing.assert_array_equal(found["u"][1], [[0.1, np.nan], [np.nan, np.nan]])
    assert found["why"][1].tolist() == [["", "x"], ["", ""]]
    assert columns.to_pandas().loc[(1, "b"), "why"] == "x"


def test_tables_of_pandas() -> None:
    run = history().to_pandas()
    assert run.index.name == "t"
    assert run.loc[0.5, "tip_u1"] == -0.25
    assert modes().to_pandas().loc[3, "label"] == "2nd edgewise"
    table = campbell().to_pandas()
    assert table.loc[(5.0, "1st axial"), "frequency"] == 16.0
    assert list(table["frequency"].unstack("label")["1st edgewise"]) == [3.0, 8.0, 13.0]


def test_labelled_arrays(tmp_path: Path) -> None:
    data = history().to_xarray()
    assert float(data["tip_u2"].sel(t=0.5)) == 0.5
    assert data["u2"].dims == ("node",)
    units = {name: data[name].attrs["units"] for name in ("t", "psi_dot", "tip_alpha", "u2", "x")}
    assert units == {"t": "s", "psi_dot": "rad/s", "tip_alpha": "rad", "u2": "m", "x": "m"}
    assert (data.attrs["theory"], data.attrs["frame"], data.attrs["kind"]) == ("reissner", "rotating", "history")
    shapes = modes().to_xarray()
    assert bool(shapes["shape_u2"].sel(mode=1).isnull().all()), "a rigid-body mode has no shape"
    np.testing.assert_array_equal(shapes["shape_u2"].sel(mode=3).values, 1j * X / 4)
    assert (shapes["shape_u2"].attrs["units"], shapes["speed"].attrs["units"], float(shapes["speed"])) == (
        "1",
        "rad/s",
        6,
    )
    assert list(shapes["label"].values) == ["rigid body", "1st edgewise", "2nd edgewise"]
    np.testing.assert_array_equal(plate_modes().to_xarray()["triangles"].values, [[0, 1, 2]])
    branches = campbell().to_xarray()
    assert float(branches["frequency"].sel(speed=5.0, label="1st axial")) == 16.0
    assert np.isnan(branches["frequency"].sel(speed=10.0, label="1st axial"))
    branches.to_netcdf(tmp_path / "campbell.nc")
    with xarray.open_dataset(tmp_path / "campbell.nc") as again:
        np.testing.assert_array_equal(again["frequency"].values, branches["frequency"].values)


def test_names_and_units_of_columns() -> None:
    assert described("tip_u1") == ("tip u₁", "m")
    assert label("tip_u1") == "tip u₁ (m)"
    assert label("damping") == "damping ratio (–)"
    assert described("whirl") == ("whirl", "")
    assert label("whirl") == "whirl", "nothing is known of its unit"


# --- what a prompt and a notebook show ----------------------------------------------------------------------------


@ALL
def test_a_result_is_a_line_at_a_prompt_and_tables_with_a_figure_in_a_notebook(make: Any, tmp_path: Path) -> None:
    result: Result = make()
    assert len(repr(result)) < 500
    assert result.title in repr(result)
    page = result._repr_html_()
    assert "mind the gap" in page
    assert page.count("<img src=") == 1
    assert page.count("<table>") == len(result.tables())
    figure = result.plot()
    check(figure)
    assert figure._repr_png_().startswith(b"\x89PNG"), "a notebook shows figures without a magic word"
    paths = result.draw(tmp_path)
    assert [path.name for path in paths] == list(result.drawings()) != []
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in paths)


@ALL
def test_every_number_of_a_table_has_a_unit(make: Any) -> None:
    """In the heading of its column, or of its row; counts have none."""
    counts = {"mode", "branch", "elements", "degree"}
    units = re.compile(r"\(.+\)|(rad/s|rpm|Hz|deg/s) at ")
    for table in make().tables():
        for row in table.rows:
            for head, text in zip(table.head, row, strict=False):
                if re.fullmatch(r"<?-?[\d.]+(e[-+]?\d+)?", text):
                    assert head in counts or units.search(head) or units.search(row[0]), (head, row)


def test_a_printed_table() -> None:
    """Numbers stand at the right, text at the left; round-off of the largest is 0; the last column folds."""
    assert numbers([2.5, 1e-10, None, -3e-9]) == ["2.5", "0", "–", "-3e-09"]
    table = ShortTable(("name", "u (m)", "why"), [("a", "2.5", "a long reason " * 8), ("bc", "0", "none")])
    lines = table.lines(40)
    assert lines[0] == "name  u (m)  why"
    assert lines[1].startswith("a       2.5  a long reason")
    assert lines[-1] == "bc        0  none"
    assert all(len(line) <= 40 for line in lines)
    long = ShortTable(("x (m)",), [(str(i),) for i in range(100)]).html()
    assert long.count("<tr>") == 1 + SHORT + 1
    assert "and 88 more" in long


# --- figures ----------------------------------------------------------------------------------------------------------


def test_plot_writes_the_format_of_the_ending(tmp_path: Path) -> None:
    campbell().plot(tmp_path / "diagram.pdf")
    assert (tmp_path / "diagram.pdf").read_bytes().startswith(b"%PDF")
    with pytest.raises(ValueError, match="xyz"):
        campbell().plot(tmp_path / "diagram.xyz")
    with pytest.raises(OutputError, match=r"missing/diagram.png.*cannot be written"):
        campbell().plot(tmp_path / "missing" / "diagram.png")
    assert [path.name for path in tmp_path.iterdir()] == ["diagram.pdf"]


def test_plot_of_a_drawing_by_its_name() -> None:
    figure = history().plot(drawing="history.png")
    np.testing.assert_array_equal(figure.axes[1].lines[0].get_ydata(), T)
    with pytest.raises(ValueError, match="drawing 'shape' is not among those of this result; there is history"):
        history().plot(drawing="shape")
    empty = RunResult(summary(kind="history", status="failed"), {"t": T[:1]})
    assert empty.title == "beam: reissner (failed)"
    with pytest.raises(ValueError, match="none, as too little was computed"):
        empty.plot()
