"""Every bad mesh of a plate is refused in one line, before anything is computed or written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests import launch
from tests.bad_meshes import BAD, refusal, write_bad


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def check_refused(folder: Path, status: int, err: str, name: str) -> None:
    """Check exit status and message, and that there is no folder of results."""
    told = [text for text in err.splitlines() if text.startswith("rotfem:")]
    assert status == 2, err
    assert len(told) == 1, err
    for part in refusal(name):
        assert part in told[0]
    assert "Traceback" not in err
    assert not (folder / "results").exists()


@pytest.mark.parametrize("name", list(BAD))
def test_bad_meshes(rotfem: Callable[..., Any], folder: Path, name: str) -> None:
    done = rotfem("modes", write_bad(folder, name))
    check_refused(folder, done.status, done.err, name)


def test_exit_status_of_a_process(folder: Path) -> None:
    """The same of a started program, which ends gmsh's library too."""
    done = launch.rotfem(folder, 1, "modes", write_bad(folder, "folded cell"), timeout=60)
    check_refused(folder, done.returncode, done.stderr, "folded cell")
