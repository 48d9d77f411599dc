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


BY = ("--load", "extensions.load")


def summary(
    rotfem: Rotfem, by: str, file: str, verb: str, *changes: str, scene: str = "beam.toml", folder: str = "out"
) -> dict[str, Any]:
    """Return the summary of a command with a file of demos/extensions loaded and some keys changed."""
    options = [word for change in changes for word in ("--set", change)]
    path, before = str(FILES / f"{file}.py"), ["--load", str(FILES / f"{file}.py")]
    if by != "--load":
        options.append("--trust")
        text = Path(scene).read_text().split("[extensions]")[0]
        Path(scene).write_text(text + f'[extensions]\nload = ["{path}"]\n')
        before = []
    done = rotfem(*before, verb, scene, *options, "--json", "--no-plots", "-o", folder)
    assert done.status == 0, done.err
    found: dict[str, Any] = json.loads(done.out)
    return found


def column(name: str, folder: str = "out") -> list[float]:
    """Return a column of the history."""
    head, *rows = [line.split(",") for line in (Path(folder) / "history.csv").read_text().splitlines()]
    return [float(row[head.index(name)]) for row in rows]


#: A beam at rest, the state of which is an equilibrium.
STILL = ("motion.type=constant", "motion.speed=0")


def at_rest(path: Path) -> None:
    """Write the scene of a beam at rest, without a history."""
    path.write_text(SCENE.replace("duration = 2.0\n", "").split("[time]")[0])


def test_section(rotfem: Rotfem) -> None:
    """Mass and centre of mass: ρ A L; the centroid of a channel is off the line that the web stands on."""
    shape, dimensions = "channel", "web = 0.2\nflange = 0.1\nthickness = 0.01\n"
    head, tail = SCENE.replace("planar_beam", "spatial_beam").split("EA =")[0], SCENE[SCENE.index("[motion]") :]
    Path("beam.toml").write_text(f'{head}E = 7e10\nnu = 0.3\nrho = 2700.0\nshape = "{shape}"\n{dimensions}{tail}')
    found = summary(rotfem, "--load", shape, "check")
    assert found["mass"] == pytest.approx(2700 * 4e-3 * 10)
    assert found["center_of_mass"] == pytest.approx([5.0, 0.01 / 0.4, 0.0], abs=1e-12)


@pytest.mark.parametrize("by", BY)
def test_importer(rotfem: Rotfem, folder: Path, by: str) -> None:
    """The mass of a blade that tapers; `import` writes a scene, `section.from` reads the file where it is."""
    rows = [
        "# x, EA, GA, GJ, EI flap, EI lag, mass",
        "0, 2e7, 1e7, 1e3, 1e4, 2e4, 1.2",
        "8, 1e7, 5e6, 5e2, 5e3, 1e4, 0.6",
    ]
    (folder / "blade.csv").write_text("\n".join(rows))
    if by == "--load":
        done = rotfem("--load", str(FILES / "blade_csv.py"), "import", "blade.csv", "-o", "blade.toml")
        assert done.status == 0, done.err
    else:
        text = '[structure]\ntype = "spatial_beam"\n[structure.section]\nfrom = "blade.csv"\n'
        (folder / "blade.toml").write_text(text + '[motion]\ntype = "constant"\nspeed = 0.0\n')
    assert summary(rotfem, by, "blade_csv", "check", scene="blade.toml")["mass"] == pytest.approx(0.9 * 8)


@pytest.mark.parametrize("by", BY)
def test_motion_law(rotfem: Rotfem, folder: Path, by: str) -> None:
    text = SCENE.split("[motion]")[0] + '[motion]\ntype = "wobble"\nmean = 2.0\namplitude = 0.5\n[mesh]\nelements = 2\n'
    (folder / "law.toml").write_text(text + "[time]\nend = 0.1\nstep = 0.05\n")
    summary(rotfem, by, "wobble", "run", scene="law.toml")
    assert column("psi_dot")[-1] == pytest.approx(2.0 + 0.5 * sin(2 * pi * 0.1), rel=1e-12)
    refused = rotfem("run", "law.toml", "--set", "motion.frequency=-1")
    assert (refused.status, "motion.frequency = -1" in refused.err) == (2, True)
    refused = rotfem("run", "law.toml", "--set", "motion.amplitud=1")
    assert (refused.status, 'did you mean "amplitude"?' in refused.err) == (2, True)


def test_damping(rotfem: Rotfem) -> None:
    """ζ = ηω/2 of modes that bend, but for shear, and 0 of those that stretch, in linear and nonlinear theories."""
    at_rest(Path("beam.toml"))
    eta = 1e-3
    keys = ("model.theory=consistent_linear", f"structure.damping.bending_damping={eta}", "modes.count=8")
    found = summary(rotfem, "--load", "bending_damping", "modes", *STILL, *keys)
    for row in found["modes"]:
        expected = eta * row["frequency"] / 2 * (row["share_lag"] > 0.5)
        assert row["damping"] == pytest.approx(expected, rel=0.04, abs=1e-9)
    assert {"1st axial", "1st edgewise"} <= {row["label"] for row in found["modes"]}


def test_design(rotfem: Rotfem, folder: Path) -> None:
    """A propeller is a spatial beam of the diameter; its parameters are keys that --set changes."""
    text = '[structure]\ntype = "propeller"\ndiameter = 0.2\npitch = 0.1\nE = 6e10\nrho = 1600.0\n'
    (folder / "prop.toml").write_text(text + '[motion]\ntype = "constant"\nspeed = 0.0\n')
    assert summary(rotfem, "--load", "propeller", "check", scene="prop.toml")["length"] == pytest.approx(0.085)
    found = summary(rotfem, "--load", "propeller", "check", "structure.diameter=0.4", scene="prop.toml")
    assert found["length"] == pytest.approx(0.17)
    refused = rotfem("check", "prop.toml", "--set", "structure.diametr=1")
    assert (refused.status, 'did you mean "diameter"?' in refused.err) == (2, True)


# --- scenes that load, and what goes wrong ----------------------------------------------------------------------------


def test_scene_loads_a_file_beside_it(rotfem: Rotfem, folder: Path) -> None:
    (folder / "mine.py").write_text((FILES / "linear_drag.py").read_text())
    (folder / "beam.toml").write_text(SCENE + '[extensions]\nload = ["mine.py"]\n')
    for verb in ("check", "run"):  # neither runs code of a scene that is not trusted
        done = rotfem(verb, "beam.toml", "-o", "out")
        assert (done.status, "drag" in registry.effects) == (2, False)
        assert done.err.startswith("rotfem: beam.toml: extensions.load: is Python of the scene that would run: mine.py")
        assert done.err.count("\n") == 1
    done = rotfem("run", "beam.toml", "--trust", "--json", "--no-plots", "-o", "out")
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
        ("import rotfem\nrotfem.register(rotfem.Effect('gravity'))\n", "failed: line 2: ValueError: 'gravity' is the"),
    ],
)
@pytest.mark.parametrize("by", BY)
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
        done = rotfem("run", "beam.toml", "--trust", "-o", "out")
    assert done.status == 2
    where = 'command line: --load = "mine.py"' if by == "--load" else 'beam.toml: extensions.load = "mine.py"'
    assert done.err.startswith(f"rotfem: {where}: {message}")
    assert done.err.count("\n") == 1
    assert not (folder / "out").exists()
    assert "half" not in registry.effects


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("lambda m, delta: m.velocty(delta)", "mine.py: line 2: AttributeError: 'Mechanics' object has no attribute"),
        ("lambda m: 0", "what mine.py registers may not fit: TypeError: <lambda>() takes 1 positional argument but 2"),
    ],
)
def test_what_is_registered_fails_later(rotfem: Rotfem, folder: Path, content: str, message: str) -> None:
    """One line as well, which names the file, and its line where the error is there."""
    (folder / "mine.py").write_text(f"import rotfem\nrotfem.register(rotfem.Effect('half', {content}))\n")
    done = rotfem("--load", "mine.py", "run", "beam.toml", "-o", "out")
    assert done.status == 2
    assert done.err.startswith(f"rotfem: {message}")
    assert done.err.count("\n") == 1
