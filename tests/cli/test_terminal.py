"""Every verb at a terminal of 80 columns: how wide, in which words and units, and what is seen meanwhile."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

import pytest

from rotfem.commands.cli import app
from tests import blade_decks
from tests.launch import environment

COLUMNS = 80

BLADE = """\
[structure]
type = "spatial_beam"
length = "10 m"
section = { EA = 2.8e7, GA2 = 1e7, GA3 = 1e7, GJ = 1e4, EI2 = 1.4e4, EI3 = 2.4e4, mass_per_length = 1.2 }
[motion]
type = "constant"
speed = "30 rpm"
[mesh]
elements = 2
[modes]
count = 3
"""

ARM = """\
[structure]
type = "planar_beam"
length = 10.0
section = { EA = 2.8e7, GA = 1e7, EI = 1.4e4, mass_per_length = 1.2 }
[motion]
type = "constant"
speed = "30 rpm"
[mesh]
elements = 2
[modes]
count = 2
[loads.tip_force]
harmonic = { amplitude = [0, 1], frequency = "1 Hz" }
[time]
end = 0.5
step = 0.05
"""

VERBS = {
    "history": ("run", "arm.toml"),
    "to an accuracy": ("run", "arm.toml", "--accuracy", "1e-2"),
    "steady": ("run", "blade.toml"),
    "modes": ("modes", "blade.toml"),
    "linear": ("modes", "blade.toml", "--set", "model.theory=linear"),
    "campbell": ("campbell", "blade.toml", "--speeds", "0:60:4rpm"),
    "response": ("response", "arm.toml", "--from", "0.2Hz", "--to", "1Hz", "--number", "20"),
    "check": ("check", "blade.toml"),
    "explain": ("explain", "blade.toml"),
    "cost": ("cost", "blade.toml", "--quick", "--budget", "60s", "--accuracy", "0.1"),
    "sweep": ("sweep", "blade.toml", "--set", "motion.speed=0:20:2rpm", "--", "modes"),
    "import": ("import", "Blade.st", "-o", "imported.toml"),
    "unknown key": ("run", "arm.toml", "--set", "motion.sped=3"),
    "no theory": ("modes", "blade.toml", "--set", "model.theory=nonlinear"),
    "failure": ("run", "arm.toml", "--set", "motion.speed=1e5 rpm"),
    "version": ("--version",),
}

HELPS = ("", "run", "modes", "campbell", "response", "check", "explain", "cost", "sweep", "compare", "import")

#: Sequences that steer a terminal; those of them that colour.
CONTROL, COLOUR = re.compile(r"\x1b\[[?\d;]*[A-Za-z]"), re.compile(r"\x1b\[[\d;]*3[1-8][\d;]*m")

#: Words of the program's own, which an engineer has not met.
PRIVATE = re.compile(
    r"dofs|fastest wanted|integrals in|puts? (?:it )?off|pursu|patience|\bbeside\b|comes out|is off by|is unknown"
)


class Shown(NamedTuple):
    """What a command wrote to its terminal, when (s) each part of it came, and its exit status."""

    text: str
    parts: list[tuple[float, str]]
    status: int

    @property
    def lines(self) -> list[str]:
        """Lines as they were seen, each state of a bar too."""
        return re.split(r"[\r\n]+", CONTROL.sub("", self.text))


Terminal = Callable[..., Shown]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the scenes."""
    path = tmp_path_factory.mktemp("terminal")
    for name, text in (("blade.toml", BLADE), ("arm.toml", ARM), ("Blade.st", blade_decks.hawc2(False))):
        (path / name).write_text(text)
    return path


@pytest.fixture(scope="module")
def alone(folder: Path) -> Terminal:
    """Return a function that runs `rotfem …` there as a process."""

    def run(*arguments: str, **more: str) -> Shown:
        began, text, parts = time.monotonic(), "", []
        ours, theirs = os.openpty()
        process = subprocess.Popen(
            [sys.executable, "-m", "rotfem", *arguments],
            cwd=folder,
            env=environment() | {"TERM": "xterm-256color", "COLUMNS": str(COLUMNS), **more},
            stdin=theirs,
            stdout=theirs,
            stderr=theirs,
        )
        os.close(theirs)
        while data := _read(ours):
            text += data
            parts.append((time.monotonic() - began, data))
        os.close(ours)
        return Shown(text, parts, process.wait(60))

    return run


@pytest.fixture
def terminal(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """Return a function that runs `rotfem …` there in this process, at a terminal."""
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("COLUMNS", str(COLUMNS))
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.chdir(folder)

    def run(*arguments: str) -> Shown:
        ours, theirs = os.openpty()
        with ThreadPoolExecutor() as pool:
            reader = pool.submit(lambda: "".join(iter(lambda: _read(ours), "")))
            screen = open(theirs, "w", encoding="utf-8")  # noqa: SIM115
            with screen, redirect_stdout(screen), redirect_stderr(screen), pytest.raises(SystemExit) as end:
                app(list(arguments), prog_name="rotfem")
            text = reader.result()
        os.close(ours)
        return Shown(text, [], int(end.value.code or 0))

    return run


def _read(descriptor: int) -> str:
    try:
        return os.read(descriptor, 1 << 16).decode(errors="replace")
    except OSError:  # the other end is closed
        return ""


@pytest.mark.parametrize("name", VERBS)
def test_what_a_verb_prints(name: str, terminal: Terminal, folder: Path) -> None:
    """No line is longer than the terminal, no number is round-off, no word the program's own; bad ends say so."""
    arguments = VERBS[name]
    where = () if arguments[0] in ("import", "--version") else ("-o", f"out {name}".replace(" ", "-"))
    at = arguments.index("--") if "--" in arguments else len(arguments)
    shown = terminal(*arguments[:at], *where, *arguments[at:])
    assert shown.status == {"unknown key": 2, "no theory": 2, "failure": 3}.get(name, 0), shown.text
    assert "Traceback" not in shown.text
    assert [line for line in shown.lines if len(line) > COLUMNS] == []
    assert re.findall(r"\d+(?:\.\d+)?e-(?:1\d|[2-9]\d)", "\n".join(shown.lines)) == []
    assert PRIVATE.findall("\n".join(shown.lines)) == []


@pytest.mark.parametrize("verb", HELPS)
def test_help(verb: str, alone: Terminal) -> None:
    shown = alone(*verb.split(), "--help")
    assert shown.status == 0
    assert "Usage: rotfem" in shown.text
    assert "\\[" not in shown.text
    assert "..." not in shown.text.replace("[ARGS]...", "").replace("VERB...", ""), "a sentence that is cut"
    assert [line for line in shown.lines if len(line) > COLUMNS] == []


def test_speeds_in_rpm_are_answered_in_rpm(terminal: Terminal) -> None:
    """The scene says 30 rpm; a speed that a warning has in rad/s is there in rpm too."""
    modes = terminal("modes", "blade.toml", "--set", "model.theory=linear", "-o", "out-linear")
    assert "state at 30 rpm" in modes.text
    sweep = terminal("campbell", "blade.toml", "--speeds", "0:60:4rpm", "-o", "out-campbell")
    assert "rad/s at 60 rpm" in sweep.text
    assert "critical speed (rpm)" in sweep.text
    fast = terminal("run", "arm.toml", "--set", "model.theory=linear", "--set", "motion.speed=80 rpm", "-o", "out-fast")
    said = " ".join(CONTROL.sub("", fast.text).split())
    assert "stiffness at 3.8 rad/s (36.3 rpm); the scene reaches 8.38 rad/s (80 rpm)" in said


def test_no_colour(terminal: Terminal, alone: Terminal) -> None:
    assert COLOUR.search(terminal("modes", "blade.toml", "-o", "out-colour").text)
    plain = alone("modes", "blade.toml", "-o", "out-colour", NO_COLOR="1")
    assert "blade: modes" in plain.text, "the bar is there all the same"
    assert not COLOUR.search(plain.text)


def test_compilation_is_said_with_a_bar_that_moves(alone: Terminal, tmp_path: Path) -> None:
    """With an empty cache of forms: a bar from the start on, which says so as soon as something is compiled."""
    shown = alone("modes", "blade.toml", "-o", "out-cold", XDG_CACHE_HOME=str(tmp_path))
    whole = shown.parts[-1][0]
    frames = [(when, text) for when, text in shown.parts if "compiling (first run only)" in text]
    assert shown.parts[0][0] < 0.5 * whole, "the bar is there long before the result"
    assert len({text for _, text in frames}) > 3, "it moves"
    assert frames[-1][0] - frames[0][0] > 0.3 * (whole - frames[0][0]), "it is seen for as long as that takes"
    warm = alone("modes", "blade.toml", "-o", "out-cold", XDG_CACHE_HOME=str(tmp_path))
    assert "compiling" not in warm.text
