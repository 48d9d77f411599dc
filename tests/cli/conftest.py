"""A folder with the module's SCENE in it, and `rotfem …` run there in this process."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from rotfem.commands.cli import app


class Done(NamedTuple):
    status: int
    out: str
    err: str


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Path:
    """Return the working directory, with the scene beam.toml in it."""
    (tmp_path / "beam.toml").write_text(request.module.SCENE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def rotfem(folder: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., Done]:
    """Return a function that runs `rotfem …` there."""

    def run(*arguments: str) -> Done:
        with pytest.raises(SystemExit) as end:
            app(list(arguments))
        return Done(int(end.value.code or 0), *capsys.readouterr())

    return run
