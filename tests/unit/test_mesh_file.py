"""Mesh files of plates: what gmsh writes is read, and no file makes gmsh run what stands in it or beside it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rotfem.structures.meshes.gmsh_file import BadMesh, read
from tests.launch import rotfem
from tests.plate_mesh_files import grid, write_msh

gmsh: Any = pytest.importorskip("gmsh")

POINTS, GROUPS = grid(2, 2)
FORMAT = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"
SCENE = """\
[structure]
type = "plate"
mesh = "bad.msh"
thickness = 0.02
E = 70.0e9
nu = 0.3
rho = 2700.0
[motion]
type = "constant"
speed = 60.0
"""


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


def nodes_read(path: Path) -> int:
    """Return how many nodes are left of a file that is read."""
    read(gmsh, path, ["plate"])
    return len(gmsh.model.mesh.getNodes()[0])


@pytest.mark.parametrize(("version", "binary"), [(2.2, 0), (2.2, 1), (3, 0), (3, 1), (4.0, 0), (4.1, 0), (4.1, 1)])
def test_what_gmsh_writes_is_read(good: Path, tmp_path: Path, version: float, binary: int) -> None:
    gmsh.initialize([], False, False, False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.merge(str(good))
    gmsh.option.setNumber("Mesh.MshFileVersion", version)
    gmsh.option.setNumber("Mesh.Binary", binary)
    gmsh.write(str(tmp_path / "written.msh"))
    gmsh.finalize()
    assert (b"\0" in (tmp_path / "written.msh").read_bytes()) == bool(binary)
    assert nodes_read(tmp_path / "written.msh") == len(POINTS)
    x = gmsh.model.mesh.getNodes()[1].reshape(-1, 3)[:, :2]
    np.testing.assert_allclose(sorted(x.tolist()), sorted(POINTS.tolist()), atol=1e-15)


@pytest.mark.parametrize("version", ["2.1", "2.2"])
def test_older_versions_and_other_line_ends_are_read(good: Path, version: str) -> None:
    good.write_bytes(good.read_bytes().replace(b"2.2 0 8", version.encode() + b" 0 8").replace(b"\n", b"\r\n"))
    assert nodes_read(good) == len(POINTS)


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
    "version 1 with a head": "$MeshFormat\n1 0 8\n$EndMeshFormat\n",
    "version 2.0": "$MeshFormat\n2 0 8\n$EndMeshFormat\n",
    "version 5": "$MeshFormat\n5 0 8\n$EndMeshFormat\n",
    "no file type": "$MeshFormat\n2.2 2 8\n$EndMeshFormat\n",
    "no data size": "$MeshFormat\n2.2 0 4\n$EndMeshFormat\n",
    "no end": "$MeshFormat\n2.2 0 8\n",
    "binary without its integer": "$MeshFormat\n4.1 1 8\n$EndMeshFormat\n",
    "text with the integer of binary": "$MeshFormat\n4.1 0 8\n\1\0\0\0\n$EndMeshFormat\n",
    "post-processing": "$PostFormat\n1.4 0 8\n$EndPostFormat\n",
    "view": "$View\n",
    "solid": "solid plate\n",
}


@pytest.mark.parametrize("name", list(HEADS))
def test_no_other_head_reaches_gmsh(good: Path, ran: Path, name: str) -> None:
    good.write_text(HEADS[name] + script(ran) + good.read_text())
    with pytest.raises(BadMesh, match=r"must be \$MeshFormat, without anything before") as caught:
        read(gmsh, good, ["plate"])
    assert "\n" not in str(caught.value)
    assert not ran.exists()
    assert not gmsh.isInitialized()


@pytest.mark.parametrize("content", [b"", b"\x89HDF\r\n\x1a\n" + bytes(range(256)), b"x" * 10_000_000])
def test_files_without_lines_are_refused_briefly(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "bad.msh").write_bytes(content)
    with pytest.raises(BadMesh, match="is no mesh of gmsh") as caught:
        read(gmsh, tmp_path / "bad.msh", ["plate"])
    assert len(str(caught.value)) < 600


SECTIONS = {
    "after": FORMAT + "{mesh}{script}",
    "between": FORMAT + "{script}{mesh}",
    "unknown section": FORMAT + "$Script\n{script}$EndScript\n{mesh}",
    "section of post-processing": FORMAT + '{mesh}$View\n"run" {{\n}};\n{script}$EndView\n',
}


@pytest.mark.parametrize("name", list(SECTIONS))
def test_text_between_and_after_the_sections_is_not_run(good: Path, ran: Path, name: str) -> None:
    mesh = good.read_text().removeprefix(FORMAT)
    good.write_text(SECTIONS[name].format(mesh=mesh, script=script(ran)))
    assert nodes_read(good) == len(POINTS)
    assert not ran.exists()


def test_a_script_with_the_head_of_a_mesh_is_not_run(good: Path, ran: Path) -> None:
    good.write_text(FORMAT + script(ran))
    with pytest.raises(BadMesh, match="holds no mesh"):
        read(gmsh, good, ["plate"])
    assert not ran.exists()


def test_a_broken_mesh_is_named_by_its_own_name(good: Path) -> None:
    good.write_text(good.read_text().split("$EndNodes")[0].rsplit(" ", 3)[0])
    with pytest.raises(BadMesh, match=r"gmsh cannot read it: .*good\.msh") as caught:
        read(gmsh, good, ["plate"])
    assert "rotfem-" not in str(caught.value)


SCRIPTS = {
    "SystemCall": 'SystemCall "touch {ran}";\n',
    "Save": 'Point(1) = {{0, 0, 0}};\nMesh.SaveAll = 1;\nMesh 0;\nSave "{ran}.msh";\n',
}


@pytest.mark.parametrize("name", list(SCRIPTS))
def test_rotfem_refuses_a_script(tmp_path: Path, ran: Path, name: str) -> None:
    (tmp_path / "bad.msh").write_text(SCRIPTS[name].format(ran=ran))
    (tmp_path / "plate.toml").write_text(SCENE)
    before = sorted(tmp_path.iterdir())
    done = rotfem(tmp_path, 1, "modes", "plate.toml", timeout=120)
    told = [text for text in done.stderr.splitlines() if text.startswith("rotfem:")]
    assert done.returncode == 2, done.stderr
    assert len(told) == 1, done.stderr
    for part in (
        "plate.toml",
        'structure.mesh = "bad.msh"',
        "must be $MeshFormat",
        "version (2.1, 2.2, 3, 4, 4.0 or 4.1)",
    ):
        assert part in told[0]
    assert sorted(tmp_path.iterdir()) == before


def test_rotfem_leaves_the_options_beside_a_mesh_alone(good: Path, tmp_path: Path, ran: Path) -> None:
    """gmsh would run bad.msh.opt after bad.msh."""
    good.rename(tmp_path / "bad.msh")
    (tmp_path / "bad.msh.opt").write_text(script(ran) + "Mesh.ScalingFactor = 2;\n")
    (tmp_path / "plate.toml").write_text(SCENE)
    done = rotfem(tmp_path, 1, "modes", "plate.toml", "--json", "--no-plots", timeout=300)
    assert done.returncode == 0, done.stderr
    assert not ran.exists()
