"""`rotfem …` with options of any kind ends with 0, 2 or 3, says why, and shows no traceback."""

from __future__ import annotations

import contextlib
import io
import json
import os
import tempfile
from pathlib import Path
from typing import Any

import hypothesis.strategies as st
import pytest
import tomli_w
from hypothesis import given, settings

from rotfem.commands.cli import app
from tests.fuzz.mutants import misproportioned, numbers, texts, values
from tests.fuzz.seeds import COMPUTED, SEEDS
from tests.fuzz.trying import COMPUTATION, within

SPEEDS = ["", *["0:6:3", "0:1e300:3", "6:0:3", "0:6", "0:6:3:4", "1", "1,2", "nan,1", "0:6:-3", "0:6:1e2"]]
SETTINGS = ["nothing", "=", "a=", "mesh=3", "mesh.elements=1", "structure.length=-1", "structure.section.EA=1e60"]
SETTINGS += ["model.theory=linear", "model.theory=lenear", "time.step=0.25", "time.end=0", "motion.speed=1e99"]
setting = st.one_of(st.sampled_from(SETTINGS), st.builds("{}={}".format, texts, st.one_of(values, texts)), texts)
speeds = st.one_of(st.sampled_from(SPEEDS), st.builds("{}:{}:{}".format, numbers, numbers, numbers), texts)
shared = st.one_of(
    st.builds(lambda text: ["--set", text], setting),
    st.builds(
        lambda text: ["-o", text], st.one_of(st.sampled_from(["", "out", "beam.toml", "/proc/x", "a\0b"]), texts)
    ),
    st.sampled_from([["-q"], ["--json"], ["--no-advice"], ["--debugg"], ["-x"], ["--set"], ["--"], ["more.toml"]]),
)
own = {
    "run": st.nothing(),
    "modes": st.sampled_from(
        [["--state-space"], ["--matrices"], ["--sensitivities"], ["--animate", "1"], ["--animate", "x"]]
    ),
    "campbell": st.one_of(
        st.builds(lambda text: ["--speeds", text], speeds),
        st.sampled_from([["--per-rev", "-1"], ["--per-rev", "2"], ["--per-rev", "9" * 30]]),
    ),
    # Only what is refused: the rest takes long.
    "cost": st.builds(lambda option, text: [option, text], st.sampled_from(["--theories", "--of"]), texts),
}


@st.composite
def commands(draw: st.DrawFn) -> tuple[list[str], Any]:
    """Return the arguments of a command, and the tables of its scene beam.toml."""
    verb = draw(st.sampled_from(list(own)))
    wanted = [*draw(st.lists(shared, max_size=2)), *([] if verb == "run" else draw(st.lists(own[verb], max_size=2)))]
    if verb == "cost" and not any(option in ("--theories", "--of") for option, *_ in wanted):
        wanted.append(["--theories", "x"])
    scene = draw(st.sampled_from(["beam.toml"] * 12 + ["", ".", "none.toml", "/dev/null", "a\0b"]))
    arguments = [verb, scene, "--no-plots", *(part for option in draw(st.permutations(wanted)) for part in option)]
    return arguments, draw(st.one_of(st.sampled_from(SEEDS["small"]), misproportioned("small", most=1)))


def ended(arguments: list[str]) -> tuple[int, str, str]:
    """Return exit status, stdout and stderr of a command in this process."""
    out, err = io.StringIO(), io.StringIO()
    streams = contextlib.redirect_stdout(out), contextlib.redirect_stderr(err)
    with streams[0], streams[1], within(COMPUTATION), pytest.raises(SystemExit) as end:
        app(arguments)
    return int(end.value.code or 0), out.getvalue(), err.getvalue()


@settings(max_examples=15)
@given(commands())
def test_commands_of_any_kind(command: tuple[list[str], Any]) -> None:
    arguments, tables = command
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        Path("beam.toml").write_text(written(tables))
        before = set(os.listdir())
        status, out, err = ended(arguments)
        assert status in (0, 2, 3), (status, err)
        assert "Traceback" not in err
        if status:
            assert err.strip(), "nothing is said"
        if status == 2:
            assert {name for name in os.listdir() if not name.startswith("results")} == before
        if status == 0 and "--json" in arguments and "--help" not in arguments:
            assert json.loads(out)["status"] == "done"


def written(tables: Any) -> str:
    """Return a scene as TOML; what TOML cannot hold is left out."""
    try:
        return tomli_w.dumps(tables)
    except (TypeError, ValueError):
        return tomli_w.dumps(next(iter(COMPUTED.values())))
