"""`rotfem --load FILE` and `[extensions] load`: one outside file for each kind of what can be registered."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from math import pi, sin
from pathlib import Path
from typing import Any

import pytest

from rotfem import registry
from rotfem.scene import extensions
from tests.cli.conftest import Done

FILES = Path(__file__).resolve().parents[2] / "demos" / "extensions"
SCENE = """
[structure]
type = "planar_beam"
length = 10.0
[structure.section]
EA = 2.8e7
GA = 1.0e7
EI = 1.4e4
mass_per_length = 1.2
rotary_inertia = 6.0e-4
[motion]
type = "spin_up"
speed = 0.4
duration = 2.0
[mesh]
elements = 4
[time]
end = 0.1
step = 0.05
"""

Rotfem = Callable[..., Done]


@pytest.fixture(autouse=True)
def _own_registries() -> Iterator[None]:
    """Take back what a test has registered."""
    before = [(kind, kind.names) for kind in registry.ALL]
    yield
    extensions._LOADED.clear()
    for kind, names in before:
        for name in set(kind.names) - set(names):
            kind.remove(name)


def summary(rotfem: Rotfem, file: str, verb: str, *changes: str, scene: str = "beam.toml") -> dict[str, Any]:
    """Return the summary of a command with a file of demos/extensions loaded and some keys changed."""
    options = [word for change in changes for word in ("--set", change)]
    done = rotfem("--load", str(FILES / f"{file}.py"), verb, scene, *options, "--json", "--no-plots", "-o", "out")
    assert done.status == 0, done.err
    found: dict[str, Any] = json.loads(done.out)
    return found


def test_theory(rotfem: Rotfem) -> None:
    assert summary(rotfem, "half_square_theory", "run", "model.theory=half_square")["theory"] == "half_square"


def test_effect(rotfem: Rotfem) -> None:
    assert "drag" in summary(rotfem, "linear_drag", "run", "model.theory=consistent_linear")["effects"]


def test_scheme(rotfem: Rotfem) -> None:
    assert summary(rotfem, "bdf2", "run", "time.scheme=bdf2")["scene"]["time"]["scheme"] == "bdf2"


def test_section_and_its_mass(rotfem: Rotfem, folder: Path) -> None:
    """ρ π a b L of an ellipse; a channel's shear centre and centroid are those of the table of `check`."""
    material = "E = 7e10\nnu = 0.3\nrho = 2700.0\n"
    text = SCENE.replace("planar_beam", "spatial_beam")
    head, tail = text.split("EA =")[0], text[text.index("[motion]") :]
    ellipse = head + material + 'shape = "ellipse"\nsemi_axis_2 = 0.02\nsemi_axis_3 = 0.01\n' + tail
    (folder / "ellipse.toml").write_text(ellipse)
    assert summary(rotfem, "ellipse", "check", scene="ellipse.toml")["mass"] == pytest.approx(2700 * pi * 2e-4 * 10)
    channel = head + material + 'shape = "channel"\nweb = 0.2\nflange = 0.1\nthickness = 0.01\n' + tail
    (folder / "channel.toml").write_text(channel)
    center = summary(rotfem, "channel", "check", scene="channel.toml")["center_of_mass"]
    assert center == pytest.approx([5.0, 0.01 / 0.4, 0.0], abs=1e-12)


def test_output(rotfem: Rotfem, folder: Path) -> None:
    summary(rotfem, "root_moment", "run", "output.quantities=['root_moment']")
    assert (folder / "out" / "history.csv").read_text().splitlines()[0].endswith(",root_moment")


def test_importer(rotfem: Rotfem, folder: Path) -> None:
    rows = [
        "# x, EA, GA, GJ, EI flap, EI lag, mass",
        "0, 2e7, 1e7, 1e3, 1e4, 2e4, 1.2",
        "8, 1e7, 5e6, 5e2, 5e3, 1e4, 0.6",
    ]
    (folder / "blade.csv").write_text("\n".join(rows))
    done = rotfem("--load", str(FILES / "blade_csv.py"), "import", "blade.csv", "-o", "blade.toml")
    assert done.status == 0, done.err
    assert rotfem("check", "blade.toml", "--json", "--no-plots", "-o", "out").status == 0
    assert json.loads((folder / "out" / "summary.json").read_text())["mass"] == pytest.approx(0.9 * 8)


def test_motion_law(rotfem: Rotfem, folder: Path) -> None:
    text = SCENE.split("[motion]")[0] + '[motion]\ntype = "wobble"\nmean = 2.0\namplitude = 0.5\n[mesh]\nelements = 2\n'
    (folder / "law.toml").write_text(text + "[time]\nend = 0.1\nstep = 0.05\n")
    summary(rotfem, "wobble", "run", scene="law.toml")
    head, *rows = [line.split(",") for line in (folder / "out" / "history.csv").read_text().splitlines()]
    speed = float(rows[-1][head.index("psi_dot")])
    assert speed == pytest.approx(2.0 + 0.5 * sin(2 * pi * 0.1), rel=1e-12)
    refused = rotfem("run", "law.toml", "--set", "motion.frequency=-1")
    assert (refused.status, "motion.frequency = -1" in refused.err) == (2, True)
    refused = rotfem("run", "law.toml", "--set", "motion.amplitud=1")
    assert (refused.status, 'did you mean "amplitude"?' in refused.err) == (2, True)


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
def test_damping(rotfem: Rotfem, theory: str) -> None:
    """ζ = ηω/2 of modes that bend, but for shear, and 0 of those that stretch, in linear and nonlinear theories."""
    changes = ("motion.type=constant", "motion.speed=0", "motion.duration", "time", "modes.count=8")
    keys = [change if "=" in change else "" for change in changes]
    eta = 1e-3
    text = Path("beam.toml").read_text().replace("duration = 2.0\n", "").split("[time]")[0]
    Path("beam.toml").write_text(text)
    found = summary(
        rotfem,
        "bending_damping",
        "modes",
        *filter(None, keys),
        f"model.theory={theory}",
        f"structure.damping.bending_damping={eta}",
    )
    for row in found["modes"]:
        expected = eta * row["frequency"] / 2 * (row["share_lag"] > 0.5)
        assert row["damping"] == pytest.approx(expected, rel=0.04, abs=1e-9)
    assert {"axial 1", "lag 1"} <= {row["label"] for row in found["modes"]}


def test_design(rotfem: Rotfem, folder: Path) -> None:
    """A propeller is a spatial beam of the diameter; its parameters are keys that --set changes."""
    text = '[structure]\ntype = "propeller"\ndiameter = 0.2\npitch = 0.1\nE = 6e10\nrho = 1600.0\n'
    (folder / "prop.toml").write_text(text + '[motion]\ntype = "constant"\nspeed = 0.0\n')
    assert summary(rotfem, "propeller", "check", scene="prop.toml")["length"] == pytest.approx(0.085)
    found = summary(rotfem, "propeller", "check", "structure.diameter=0.4", scene="prop.toml")
    assert found["length"] == pytest.approx(0.17)
    refused = rotfem("check", "prop.toml", "--set", "structure.diametr=1")
    assert (refused.status, 'did you mean "diameter"?' in refused.err) == (2, True)


# --- scenes that load, and what goes wrong ----------------------------------------------------------------------------


def test_scene_loads_a_file_beside_it(rotfem: Rotfem, folder: Path) -> None:
    (folder / "mine.py").write_text((FILES / "linear_drag.py").read_text())
    (folder / "beam.toml").write_text(SCENE + '[extensions]\nload = ["mine.py"]\n')
    done = rotfem("run", "beam.toml", "--json", "--no-plots", "-o", "out")
    assert "drag" in json.loads(done.out)["effects"]
    assert not (folder / "__pycache__").exists()
    done = rotfem(
        "--load", "mine.py", "check", "beam.toml", "-q", "--no-plots", "-o", "out"
    )  # once, though named twice
    assert done.status == 0, done.err


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "no such file"),
        ("x = 1\ny = 1 / 0\n", "failed: line 2: ZeroDivisionError: division by zero"),
        ("def f(:\n", "failed: line 1: SyntaxError"),
        ("import rotfem\nrotfem.register(rotfem.Effect('gravity'))\n", "failed: line 2: ValueError: 'gravity' is the"),
        ("raise SystemExit(0)\n", "failed: line 1: SystemExit"),
    ],
)
@pytest.mark.parametrize("by", ["--load", "extensions.load"])
def test_files_that_fail(rotfem: Rotfem, folder: Path, by: str, content: str | None, message: str) -> None:
    """One line, exit status 2, nothing written, and nothing stays registered."""
    if content is not None:
        (folder / "mine.py").write_text(
            "import rotfem\nrotfem.register(rotfem.Effect('half'))\n".replace("\n", ";") + content
        )
    if by == "--load":
        done = rotfem("--load", "mine.py", "run", "beam.toml", "-o", "out")
    else:
        (folder / "beam.toml").write_text(SCENE + '[extensions]\nload = "mine.py"\n')
        done = rotfem("run", "beam.toml", "-o", "out")
    assert done.status == 2
    where = 'command line: --load = "mine.py"' if by == "--load" else 'beam.toml: extensions.load = "mine.py"'
    assert done.err.startswith(f"rotfem: {where}: {message}")
    assert done.err.count("\n") == 1
    assert not (folder / "out").exists()
    assert "half" not in registry.effects
