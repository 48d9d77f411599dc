"""Every demo runs as it stands and gives the one number it is about; every demo scene is valid."""

from __future__ import annotations

import importlib.util
import math
import re
import runpy
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import rotfem
from tests.launch import MPIRUN, environment

DEMOS = Path(__file__).parents[2] / "demos"
TUTORIALS = sorted((DEMOS.parent / "docs" / "tutorials").glob("*.py"))

# Peaks of the spin-up: converged Legendre–Galerkin values, which share nothing with the finite elements. The error of
# the demos is that of their step, 0.004 s: 1.3e-6 m.
NUMBERS = [
    # demo, its number, tolerance
    ("linear", 3.79773, 2e-4),  # rad/s: 1.8751² √(EI/A_ρL⁴); shear lowers it by 1.2e-4
    ("consistent_linear", -0.574448569, 3e-6),  # m
    ("von_karman_linear", -0.574448568, 3e-6),  # m
    ("second_order", -0.571431088, 3e-6),  # m
    ("von_karman", -0.575336642, 3e-6),  # m
    ("reissner", -0.573834759, 3e-6),  # m
    ("theory_ladder", 0.106966, 1e-4),  # %: 0.574448569/0.573834759 − 1
    ("iccia_hub_beam", -0.66008, 2e-4),  # m: Legendre–Ritz, known to about 3e-5; the demo gives −0.66003
    ("torque_pulse", -0.0143691, 1e-5),  # m: Legendre–Ritz with 10 and 13 functions differ by 2e-7
    ("campbell", 8.8572904, 1e-6),  # rad/s: Legendre–Galerkin in (u1, u2, alpha) about the exact stretched state
    ("iccia_precise_model", 25.88822, 2e-3),  # %: Legendre–Ritz without shear, 8.079190/6.417749 − 1
    ("steady_state", 0.145349355577063, 1e-12),  # m: sin(kL)/(k cos kL) − L at 100 rad/s
    # rad/s: Legendre–Ritz with 22 functions a field, without shear and stretch, which make −1.9e-5
    ("pretwisted_blade", 11.8603317, 5e-5),
    ("work_precision", 0.032757, 0.03),  # Legendre–Galerkin histories of both theories: 0.032757 at 7 s
    ("dropped_effects", 12.7404784, 1e-6),  # %: Legendre–Galerkin, 4.8570240429/4.30814567538 − 1
    ("explain", 0.01433888, 1e-5),  # Legendre–Galerkin frequencies, 1 − 46.9538176323/47.636876692
    # m: the beam's; Green's strains make 1.2e-5, the step of 0.01 s −8e-6
    ("rotating_plate", -0.573834759, 1e-5),
    # The origin of the frame is a matter of words; the kinks of the table of one description are landed on, those of
    # the function in the other are not, which is a matter of the step's error.
    ("satellite_boom", 0.0, 1e-6),
    ("overview", 2.4494897, 2e-3),  # √6 of a string that its spin holds; the clamp's layer is thinner than an element
]


def load(name: str) -> ModuleType:
    """Return a demo, imported from its file."""
    spec = importlib.util.spec_from_file_location(f"demo_{name}", DEMOS / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(autouse=True)
def as_a_script(monkeypatch: pytest.MonkeyPatch) -> None:
    """A script finds its neighbours."""
    monkeypatch.syspath_prepend(DEMOS)


@pytest.mark.demos
@pytest.mark.parametrize(("name", "number", "tolerance"), NUMBERS, ids=[row[0] for row in NUMBERS])
def test_number(name: str, number: float, tolerance: float, capsys: pytest.CaptureFixture[str]) -> None:
    demo = load(name)
    # What the demo prints as its reference is the number asserted here.
    assert math.isclose(demo.REFERENCE, number, rel_tol=1e-5)
    assert demo.main() == pytest.approx(number, rel=0, abs=tolerance)
    assert "reference" in capsys.readouterr().out


@pytest.mark.parametrize("script", TUTORIALS, ids=lambda path: path.stem)
def test_tutorial_asserts_one_number(script: Path) -> None:
    assert len(re.findall(r"^assert abs\(.*\) < ", script.read_text(encoding="utf-8"), re.MULTILINE)) == 1


@pytest.mark.demos
@pytest.mark.parametrize("script", TUTORIALS, ids=lambda path: path.stem)
def test_tutorial(script: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A tutorial runs where it stands, as for the documentation site."""
    monkeypatch.chdir(script.parent)
    runpy.run_path(str(script))


@pytest.mark.demos
def test_command_line_saves_the_figure(tmp_path: Path) -> None:
    figure = tmp_path / "new" / "steady_state.png"
    command = [sys.executable, str(DEMOS / "steady_state.py"), "--figure", str(figure)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert figure.read_bytes().startswith(b"\x89PNG")
    assert [path.name for path in tmp_path.iterdir()] == ["new"]


@pytest.mark.mpi
@pytest.mark.skipif(MPIRUN is None, reason="there is no mpirun")
def test_plate_mpi() -> None:
    """The script of the plate under MPI, on two processes with 6 × 1 elements."""
    command = [str(DEMOS / "plate_mpi.sh"), "2", "6", "1", "0.1"]
    done = subprocess.run(command, env=environment(), capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 process(es)" in done.stdout


@pytest.mark.parametrize("path", sorted(DEMOS.glob("*.toml")), ids=lambda path: path.name)
def test_scene_is_valid(path: Path) -> None:
    """It can be run, a script that asserts a number uses it, and what it says of itself is the same scene again."""
    loaded = rotfem.load_scene(path)
    loaded.check_run()
    scripts = [*(DEMOS / f"{name}.py" for name, _, _ in NUMBERS), *TUTORIALS]
    assert any(path.name in script.read_text(encoding="utf-8") for script in scripts)
    again = rotfem.Scene.from_dict(loaded.to_dict(), name=loaded.name, directory=loaded.directory)
    assert again.to_dict() == loaded.to_dict()


def test_every_demo_is_covered() -> None:
    scripts = {path.stem for path in DEMOS.glob("*.py") if not path.name.startswith("_")}
    assert scripts == {name for name, _, _ in NUMBERS}
