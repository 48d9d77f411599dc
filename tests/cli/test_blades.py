"""`rotfem import` and `rotfem check` as a user calls them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests import blade_decks as decks
from tests import blade_main_decks as mains
from tests.blade_scenes import RIGID

SCENE = """\
[structure]
type = "planar_beam"
length = 2.0
[structure.section]
EA = 1.0
GA = 1.0
EI = 1.0
mass_per_length = [[0, 3], [2, 1]]
[motion]
type = "constant"
speed = 1.0
"""


def test_import_and_check(rotfem: Callable[..., Any], folder: Path) -> None:
    (folder / "Blade.st").write_text(decks.hawc2(False))
    done = rotfem("import", "Blade.st", "-o", "blade.toml", "--set", "motion.speed=1.5")
    assert (done.status, done.err) == (0, "")
    assert "spatial_beam of Blade.st" in done.out
    done = rotfem("check", "blade.toml", "-o", "out")
    assert done.status == 0
    summary = json.loads((folder / "out" / "summary.json").read_text())
    # m = 300 − 13 x over 20 m.
    assert summary["mass"] == pytest.approx(3400.0, rel=1e-9)
    assert "mass (kg) 3400" in " ".join(done.out.split())
    assert {path.name for path in (folder / "out").iterdir()} >= {"check.csv", "check.png", "summary.json"}


def test_import_says_what_it_leaves_out(rotfem: Callable[..., Any], folder: Path) -> None:
    (folder / "blade.dat").write_text(decks.elastodyn())
    (folder / "main.dat").write_text(mains.elastodyn_main() + "12.0 RotSpeed - (rpm)\n")
    given = [part for key in RIGID for part in ("--set", f"structure.section.{key}=1e12")]
    done = rotfem("import", "main.dat", "-o", "blade.toml", *given)
    assert done.status == 0
    assert done.err == ("hint: main.dat: left out: RotSpeed = 12 rpm = 1.25664 rad/s; motion.speed is the key for it\n")


def test_check_of_a_beam_as_json(rotfem: Callable[..., Any]) -> None:
    done = rotfem("check", "beam.toml", "--json", "--no-plots")
    assert json.loads(done.out)["mass"] == pytest.approx(4.0, rel=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("none.dat", "-o", "x.toml"), "section.from"),
        (("beam.toml", "-o", "x.toml"), "does not say which format it has"),
        (("Blade.dat", "-o", "x.toml"), "structure.section: must have EA, GA2, GA3, GJ"),
        (("Blade.dat", "-o", "x.toml", "--format", "hawk2"), 'did you mean "hawc2"'),
        (("Blade.st", "-o", "none/x.toml"), "there is no folder"),
        (("Blade.dat", "-o", "x.toml", "--set", "structure"), "must have the form"),
    ],
)
def test_what_cannot_be_imported(
    rotfem: Callable[..., Any], folder: Path, arguments: tuple[str, ...], message: str
) -> None:
    (folder / "Blade.dat").write_text(decks.elastodyn())
    (folder / "Blade.st").write_text(decks.hawc2(False))
    done = rotfem("import", *arguments)
    assert done.status == 2
    assert message in done.err
    assert not (folder / "x.toml").exists()
