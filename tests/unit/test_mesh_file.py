"""Mesh files of plates: what gmsh writes is read, and no file makes gmsh run what stands in it or beside it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rotfem.structures.mesh import BadMesh, read
from tests.launch import rotfem
from tests.plate_mesh_files import PLATE_SCENE, grid, write_msh

gmsh: Any = pytest.importorskip("gmsh")

POINTS, GROUPS = grid(2, 2)
FORMAT = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"


@pytest.fixture(autouse=True)
def _closed() -> Iterator[None]:
    yield
    if gmsh.isInitialized():
        gmsh.finalize()


@pytest.fixture
def good(tmp_path: Path) -> Path:
    return write_msh(tmp_path / "good.msh", POINTS, GROUPS)


@pytest.fixture
def ran(tmp_path: Path) -> Path:
    """Return the file that a script makes if it is run."""
    return tmp_path / "ran.txt"


def script(ran: Path) -> str:
    return f'SystemCall "touch {ran}";\nPrintf("run") > "{ran}";\n'


def check_read(path: Path) -> None:
    """Check that the nodes of a file that is read are those of the plate."""
    assert read(gmsh, path, ["plate"])[1].keys() == {"clamped", "tip"}
    x = gmsh.model.mesh.getNodes()[1].reshape(-1, 3)[:, :2]
    np.testing.assert_allclose(sorted(x.tolist()), sorted(POINTS.tolist()), atol=1e-15)


@pytest.mark.parametrize(("version", "binary"), [(2.2, 0), (2.2, 1), (4.0, 0), (4.1, 0), (4.1, 1)])
def test_what_gmsh_writes_is_read(good: Path, tmp_path: Path, version: float, binary: int) -> None:
    gmsh.initialize([], False, False, False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.merge(str(good))
    gmsh.option.setNumber("Mesh.MshFileVersion", version)
    gmsh.option.setNumber("Mesh.Binary", binary)
    gmsh.write(str(tmp_path / "written.msh"))
    gmsh.finalize()
    assert (b"\0" in (tmp_path / "written.msh").read_bytes()) == bool(binary)
    check_read(tmp_path / "written.msh")


HEADS = {
    "script": "",
    "blank lines": "\n\n",
    "comments of a script": "// a mesh\n/* $MeshFormat */\n",
    "a blank line, then a mesh": "\n" + FORMAT,
    "a space, then a mesh": " " + FORMAT,
    "mark of the order of bytes": "\ufeff" + FORMAT,
    "comments before the mesh": "$Comments\nnone\n$EndComments\n" + FORMAT,
    "more on the first line": "$MeshFormat;\n2.2 0 8\n$EndMeshFormat\n",
    "zero byte": "$MeshFormat\0\n2.2 0 8\n$EndMeshFormat\n",
    "version 1": "$NOD\n0\n$ENDNOD\n",
    "solid": "solid plate\n",
}


@pytest.mark.parametrize("name", list(HEADS))
def test_no_other_head_reaches_gmsh(good: Path, ran: Path, name: str) -> None:
    good.write_text(HEADS[name] + script(ran) + good.read_text())
    with pytest.raises(BadMesh, match=r"its first line must be \$MeshFormat"):
        read(gmsh, good, ["plate"])
    assert not ran.exists()
    assert not gmsh.isInitialized()


@pytest.mark.parametrize("text", [FORMAT + "{mesh}{script}", FORMAT + "{script}{mesh}"])
def test_text_between_and_after_the_sections_is_not_run(good: Path, ran: Path, text: str) -> None:
    good.write_text(text.format(mesh=good.read_text().removeprefix(FORMAT), script=script(ran)))
    check_read(good)
    assert not ran.exists()


def test_a_broken_mesh_is_named_by_its_own_name(good: Path) -> None:
    good.write_text(good.read_text().split("$EndNodes")[0].rsplit(" ", 3)[0])
    with pytest.raises(BadMesh, match=r"gmsh cannot read it: .*good\.msh") as caught:
        read(gmsh, good, ["plate"])
    assert "rotfem-" not in str(caught.value)


def test_options_beside_a_mesh_are_left_alone(good: Path, tmp_path: Path, ran: Path) -> None:
    """gmsh would run good.msh.opt after good.msh."""
    (tmp_path / "good.msh.opt").write_text(script(ran) + "Mesh.ScalingFactor = 2;\n")
    (tmp_path / "plate.toml").write_text(PLATE_SCENE.format(shape='mesh = "good.msh"', mesh=""))
    done = rotfem(tmp_path, 1, "modes", "plate.toml", "--json", "--no-plots", timeout=300)
    assert done.returncode == 0, done.stderr
    assert not ran.exists()
