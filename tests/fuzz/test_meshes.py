"""A mesh file is the mesh of a plate or refused in one line, whatever stands in it: nothing crashes, hangs or runs."""

from __future__ import annotations

import os
import re
import resource
import signal
import tempfile
import traceback
from pathlib import Path

import hypothesis.strategies as st
import pytest

from rotfem.structures.meshes.gmsh_file import BadMesh, read
from tests.fuzz.trying import sized
from tests.plate_mesh_files import grid, write_msh

gmsh = pytest.importorskip("gmsh")

#: Seconds and bytes that a mesh of four cells may take.
SECONDS, MEMORY = 60, 6 * 10**9


def seeds() -> list[bytes]:
    """Return files of one small mesh: version 2.2 as text, and what gmsh makes of it in versions 2.2 to 4.1."""
    out = []
    with tempfile.TemporaryDirectory() as folder:
        path = write_msh(Path(folder) / "plate.msh", *grid(2, 2))
        out.append(path.read_bytes())
        gmsh.initialize([], False, False, False)
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.merge(str(path))
        for version, binary in ((2.2, 1), (4.1, 0), (4.1, 1)):
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            gmsh.write(str(path))
            out.append(path.read_bytes())
        gmsh.finalize()
    return out


SEEDS = seeds()
NUMBER = re.compile(rb"-?\d[\d.e+-]*")
NUMBERS = [
    b"0",
    b"-1",
    b"1",
    b"2",
    b"7",
    b"99",
    b"1000000000",
    b"4294967297",
    b"9" * 19,
    b"9" * 400,
    b"nan",
    b"inf",
    b"1e308",
]
PIECES = [
    b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n",
    b"$Nodes\n",
    b"$EndNodes\n",
    b"$Elements\n",
    b"$EndElements\n",
    b"\0",
]
PIECES += [
    b'SystemCall "touch ran";\n',
    b'Include "x.geo";\n',
    b'$PhysicalNames\n1\n2 1 "a\n$EndPhysicalNames\n',
    b"\xff" * 9,
]
PIECES += [
    b"$Entities\n0 0 99999999 0\n",
    b"$Periodic\n1\n",
    b'$NodeData\n1\n"x"\n1\n0\n3\n0\n1\n9\n',
    b"$Parametrizations\n9 9\n",
]


@st.composite
def meshes(draw: st.DrawFn) -> bytes:
    """Return a mesh file with numbers changed, pieces put in, taken out or doubled, or the end missing."""
    text = draw(st.sampled_from(SEEDS))
    for _ in range(draw(st.integers(1, 3))):
        found = list(NUMBER.finditer(text, text.find(b"$EndMeshFormat")))
        what = draw(st.integers(0, 4))
        here = draw(st.integers(0, len(text)))
        if what <= 1 and found:
            hit = draw(st.sampled_from(found))
            text = text[: hit.start()] + draw(st.sampled_from(NUMBERS)) + text[hit.end() :]
        elif what == 2:
            text = text[:here] + draw(st.sampled_from(PIECES)) + text[here:]
        elif what == 3:
            text = text[:here] + draw(st.binary(max_size=8)) + text[here + draw(st.integers(0, 40)) :]
        else:
            text = text[:here]
    return text


def reading(path: Path) -> str:
    """Return how a process ends that reads the file: "mesh", "refused", or what else became of it."""
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        signal.alarm(SECONDS)
        status = 3
        try:
            read(gmsh, path, ["plate"])
            status = 0
        except BadMesh as error:
            status = 2 if str(error).isprintable() and len(str(error)) < 1000 else 4
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(status)
    _, code = os.waitpid(child, 0)
    if os.WIFSIGNALED(code):
        return signal.Signals(os.WTERMSIG(code)).name
    return {0: "mesh", 2: "refused", 3: "traceback", 4: "message"}[os.WEXITSTATUS(code)]


@sized(meshes(), core=40, nightly=1500)
def test_files_of_any_kind(content: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plate.msh"
        path.write_bytes(content)
        assert reading(path) in ("mesh", "refused")
        assert os.listdir(folder) == ["plate.msh"]
