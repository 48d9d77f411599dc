"""What is refused on several processes is refused by all of them, told once, and none waits for another."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.bad_meshes import GROUPS, POINTS, refusal, write_bad
from tests.launch import MPIRUN, of_rotfem, ranks_of, rotfem
from tests.plate_mesh_files import PLATE_SCENE, grid, write_msh

pytestmark = [pytest.mark.mpi, pytest.mark.skipif(MPIRUN is None, reason="there is no mpirun")]

BEAM = """\
[structure]
type = "planar_beam"
length = 1.0
section = { EA = 1e6, GA = 4e5, EI = 1e2, mass_per_length = 1.0, rotary_inertia = 1e-4 }
[motion]
type = "constant"
speed = 5.0
[mesh]
elements = 1
"""
TIME = "[time]\nend = 0.01\nstep = 0.005\n"

#: Meshes of fewer cells than processes: name ↦ number of processes, shape, mesh, and the key that is to blame.
FEW = {
    "one cell": (2, "length = 1.0\nwidth = 0.6", "elements = [1, 1]", "mesh.elements = [1, 1]: "),
    "a file of one cell": (2, 'mesh = "one.msh"', "", 'structure.mesh = "one.msh": '),
}


def refused(folder: Path, ranks: int, *arguments: str, broken: str = "", parts: Sequence[str]) -> None:
    """Check that all processes end with status 2 and no results, and that the first alone says why, in one line."""
    done = ranks_of(ranks)(folder, list(arguments), of_rotfem(), broken, timeout=60)
    assert {ended.status for ended in done} == {2}, done
    first, *others = ([line for line in ended.err.splitlines() if line.startswith("rotfem:")] for ended in done)
    assert len(first) == 1, done
    assert not any(others), done
    for part in parts:
        assert part in first[0]
    assert not any("Traceback" in ended.err for ended in done)
    assert not (folder / "results").exists()


def test_bad_meshes(tmp_path: Path) -> None:
    name = "nodes not shared"
    refused(tmp_path, 2, "modes", write_bad(tmp_path, name), parts=refusal(name))


def test_any_failure_of_the_reader_is_told_by_all(tmp_path: Path) -> None:
    """What nobody foresaw fails on rank 0 alone, and ends the other too."""
    write_msh(tmp_path / "good.msh", POINTS, GROUPS)
    (tmp_path / "good.toml").write_text(PLATE_SCENE.format(shape='mesh = "good.msh"', mesh=""))
    message = "cannot be used as the mesh of a plate (ZeroDivisionError: on purpose)"
    refused(tmp_path, 2, "modes", "good.toml", broken="gmsh.option.setNumber", parts=[message])


@pytest.mark.parametrize(("name", "command"), zip(FEW, ("modes", "run"), strict=True))
def test_more_processes_than_cells(tmp_path: Path, name: str, command: str) -> None:
    ranks, shape, mesh, key = FEW[name]
    write_msh(tmp_path / "one.msh", *grid(1, 1))
    (tmp_path / "few.toml").write_text(PLATE_SCENE.format(shape=shape, mesh=mesh) + TIME)
    refused(tmp_path, ranks, command, "few.toml", parts=[key, f"cannot be shared by {ranks} processes"])


def test_beams_of_fewer_cells_than_processes(tmp_path: Path) -> None:
    """Their modes cannot be computed; their histories and steady states can."""
    (tmp_path / "beam.toml").write_text(BEAM)
    message = "mesh.elements = 1: the mesh (cells: 1) cannot be shared by 2 processes"
    refused(tmp_path, 2, "modes", "beam.toml", parts=[message])
    done = rotfem(tmp_path, 2, "run", "beam.toml", "-q", "--no-plots", "-o", "beam")
    assert done.returncode == 0, done.stderr
