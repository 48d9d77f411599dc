"""What the files of a computation do to those around them, and what is left of one that did not end."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.beams import BEAM_TABLE
from tests.cli.conftest import Done
from tests.launch import environment

SCENE = f"""\
{BEAM_TABLE}[motion]
type = "table"
table = "history.csv"
[mesh]
elements = 2
[time]
end = 8.0
step = 0.01
[output]
error = false
"""

TABLE = "t,omega\n0,0\n5,6\n10,6\n"


@pytest.fixture(autouse=True)
def _table(folder: Path) -> None:
    (folder / "history.csv").write_text(TABLE)


def test_an_input_is_not_written_over(rotfem: Any) -> None:
    done: Done = rotfem("cost", "beam.toml", "--write", "./history.csv")
    assert (done.status, done.err.count("\n")) == (2, 1)
    assert "is what has been read" in done.err
    assert Path("history.csv").read_text() == TABLE


def test_a_blade_file_is_not_written_over(rotfem: Any) -> None:
    Path("blade.toml").write_text("no blade")
    Path("link").symlink_to("blade.toml")
    done: Done = rotfem("import", "link", "-o", "blade.toml", "--format", "beamdyn")
    assert done.status == 2
    assert Path("blade.toml").read_text() == "no blade"


#: Runs one command line after another, given as JSON, and writes what comes of each.
BARE = """
import contextlib, io, json, sys
for name in ("mpi4py", "petsc4py", "slepc4py", "dolfinx", "ufl", "basix", "ffcx", "gmsh"):
    sys.modules[name] = None  # as if it were not installed
from rotfem.commands.cli import main
found = []
for arguments in json.loads(sys.argv[1]):
    sys.argv[1:], out, err, status = arguments, io.StringIO(), io.StringIO(), 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main()
        except SystemExit as end:
            status = int(end.code or 0)
    found.append((status, out.getvalue(), err.getvalue()))
print(json.dumps(found))
"""


def bare(*commands: str) -> list[Done]:
    """Return what comes of command lines where there is no FEniCSx."""
    command = [sys.executable, "-c", BARE, json.dumps([line.split() for line in commands])]
    done = subprocess.run(command, env=environment(), capture_output=True, text=True, check=True, timeout=60)
    return [Done(*found) for found in json.loads(done.stdout)]


def test_without_fenicsx_help_version_and_syntax_are_there(folder: Path) -> None:
    from rotfem import __version__

    shown, version, valid, invalid = bare(
        "--help", "--version", "check beam.toml", "check beam.toml --set time.end=soon"
    )
    assert "campbell" in shown.out
    assert version.out == f"rotfem {__version__}\n"
    assert (valid.status, valid.err) == (0, "")
    assert "beam.toml is a valid scene" in valid.out
    assert (invalid.status, invalid.err) == (2, 'rotfem: beam.toml: time.end = "soon": must be a number\n')


def test_without_fenicsx_all_else_names_the_page(folder: Path) -> None:
    for done in bare(*(f"{verb} beam.toml" for verb in ("run", "modes", "campbell --speeds 1,2", "explain", "cost"))):
        assert done.status == 2
        assert done.out == ""
        assert "docs/installation.md" in done.err
        assert done.err.count("\n") == 1
    assert sorted(path.name for path in folder.iterdir()) == ["beam.toml", "history.csv"]
