"""CSV files of tables over time: what is a header, and slips named by line and cell."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from pydantic_core import PydanticCustomError

from rotfem.errors import SceneError
from rotfem.scene import load_scene
from rotfem.scene.files import read_rows, read_text

SCENE = """\
[structure]
type = "planar_beam"
length = 10.0
section = { EA = 2.8e7, GA = 1e7, EI = 1.4e4, mass_per_length = 1.2, rotary_inertia = 6e-4 }
[motion]
type = "table"
table = "speed.csv"
"""


def rows_of(path: Path) -> tuple[tuple[float, ...], ...]:
    return tuple(read_rows(read_text(path, 10_000), path).values())


@pytest.mark.parametrize(
    "content",
    [
        "0,0\n1.5,3\n",
        "t, Omega\n0, 0\n1.5, 3\n",
        "\ufefft,Omega\r\n0,0\r\n1.5,3\r\n",
        "# of the rig\n\nt,  # s and rad/s\n 0 , 0 # start\n\n+1.5,3e0",
    ],
    ids=["plain", "header", "as a spreadsheet writes it", "comments and an empty name"],
)
def test_rows_that_are_meant_are_read(tmp_path: Path, content: str) -> None:
    (tmp_path / "speed.csv").write_bytes(content.encode())
    assert list(rows_of(tmp_path / "speed.csv")) == [(0.0, 0.0), (1.5, 3.0)]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("0,O\n1,1\n2,2\n", 'line 1, column 2: "O" must be a finite number'),
        ("O,0\n1,1\n2,2\n", 'line 1, column 1: "O" must be'),
        ("# speed\n\n0,\n1,1\n2,2\n", 'line 3, column 2: "" must be'),
        (",\n1,1\n2,2\n", 'line 1, column 1: "" must be'),
        ("t,2\n1,1\n2,2\n", 'line 1, column 1: "t" must be'),
        ("t,w\ns,rad/s\n0,0\n1,1\n", 'line 2, column 1: "s" must be'),
        ("0,0\nt,w\n1,1\n", 'line 2, column 1: "t" must be'),
        ("t,w\n0,0\n1,\n", 'line 3, column 2: "" must be'),
        ("t,w\n0,0\n1,1,\n", 'line 3, column 3: "" must be'),
        ("t,w\n0,nan\n1,1\n", 'line 2, column 2: "nan" must be'),
        ("nan,inf\n0,0\n1,1\n", 'line 1, column 1: "nan" must be'),
        ("0,0\n1,-Infinity\n", 'line 2, column 2: "-Infinity" must be'),
        ("0,0\n1,1e999\n", 'line 2, column 2: "1e999" must be'),
        ("0,0\n# ramp\n1,1,1\n", "line 3 has 3 columns; must be 2, as in line 1"),
        ("t,w,a\n0,0\n1,1\n", "line 2 has 2 columns; must be 3, as in line 1"),
        ("", "has no row of numbers"),
        ("t,w\n# nothing yet\n", "has no row of numbers"),
        ("0;0\n1;1\n", 'line 2, column 1: "1;1" must be'),
    ],
)
def test_slips_are_named_by_line_and_cell(tmp_path: Path, content: str, message: str) -> None:
    path = tmp_path / "speed.csv"
    path.write_text(content)
    with pytest.raises(PydanticCustomError, match=re.escape(message)) as caught:
        rows_of(path)
    assert (caught.value.context or {})["value"] == str(path)


def test_a_slip_in_the_first_row_refuses_the_scene(tmp_path: Path) -> None:
    """The row was taken for a header: the motion then began at t = 1 s with the speed of that row."""
    (tmp_path / "beam.toml").write_text(SCENE)
    (tmp_path / "speed.csv").write_text("0,O\n1,5\n2,6\n")
    with pytest.raises(SceneError) as caught:
        load_scene(tmp_path / "beam.toml")
    assert caught.value.key == "motion.table"
    for part in ("beam.toml", "motion.table", "speed.csv", 'line 1, column 2: "O" must be a finite number'):
        assert part in str(caught.value)
    (tmp_path / "speed.csv").write_text("0,0\n1,5\n2,6\n")
    assert load_scene(tmp_path / "beam.toml").motion.table == ((0.0, 0.0), (1.0, 5.0), (2.0, 6.0))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("t,w,a\n# rig\n0,0,0\n1,1,1\n", "must be a table [[t, speed], …]; line 3 has 3 entries"),
        ("0,0\n1,5\n# back\n1,6\n", "the first column must increase strictly; line 4: 1 ≤ 1"),
        ("t,w\n\n0,0\n-1,5\n", "the first column must increase strictly; line 4: -1 ≤ 0"),
        ("t,w\n0,0\n", "must be a table [[t, speed], …] with at least two rows"),
    ],
)
def test_a_file_that_is_no_table_over_time_is_named_with_its_line(tmp_path: Path, content: str, message: str) -> None:
    (tmp_path / "beam.toml").write_text(SCENE)
    (tmp_path / "speed.csv").write_text(content)
    with pytest.raises(SceneError) as caught:
        load_scene(tmp_path / "beam.toml")
    assert str(caught.value) == f'beam.toml: motion.table = "speed.csv": {message}'
