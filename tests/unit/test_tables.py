"""CSV files of tables over time: what is a header, and slips named by line and cell."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from rotfem.errors import SceneError
from rotfem.scene import Scene, load_scene

SCENE = """\
[structure]
type = "planar_beam"
length = 10.0
section = { EA = 2.8e7, GA = 1e7, EI = 1.4e4, mass_per_length = 1.2, rotary_inertia = 6e-4 }
[motion]
type = "table"
table = "speed.csv"
"""


def loaded(folder: Path, content: str) -> Scene:
    """Return the scene that names a table of this content."""
    (folder / "beam.toml").write_text(SCENE)
    (folder / "speed.csv").write_bytes(content.encode())
    return load_scene(folder / "beam.toml")


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
    assert loaded(tmp_path, content).motion.table == ((0.0, 0.0), (1.5, 3.0))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("0,O\n1,1\n2,2\n", "line 1 must be 2 finite numbers"),
        ("# speed\n\n0,\n1,1\n2,2\n", "line 3 must be 2"),
        ("t,w\ns,rad/s\n0,0\n1,1\n", "line 2 must be 2"),
        ("t,w\n0,nan\n1,1\n", "line 2 must be 2"),
        ("0,0\n# ramp\n1,1,1\n", "line 3 must be 2 finite"),
        ("", "has no row of numbers"),
        ("0;0\n1;1\n", "line 2 must be 1"),
        ("t,w,a\n# rig\n0,0,0\n1,1,1\n", "[0.0, 0.0, 0.0]: must have at most 2 items"),
        ("0,0\n1,5\n# back\n0.5,6\n", "the first column must not decrease; row 3: 0.5 < 1"),
        ("t,w\n0,0\n", "must have at least two rows"),
    ],
)
def test_slips_are_named_by_line_or_row(tmp_path: Path, content: str, message: str) -> None:
    with pytest.raises(SceneError, match=re.escape(message)) as caught:
        loaded(tmp_path, content)
    assert caught.value.key.startswith("motion.table")
    assert str(caught.value).startswith("beam.toml: motion.table")


@pytest.mark.parametrize("content", ["root:x:0:0:root:/root:/bin/bash\n" * 3, "secret-of-13ch\n" * 3, "\x1b[2J\n" * 3])
def test_no_message_shows_the_content_of_another_file(tmp_path: Path, content: str) -> None:
    with pytest.raises(SceneError, match="finite number") as caught:
        loaded(tmp_path, content)
    assert content.strip().splitlines()[0] not in str(caught.value)
    assert str(caught.value).isprintable()
