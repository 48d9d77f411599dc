"""What a killed compiler leaves behind, and two programs that compile the same form."""

from __future__ import annotations

import importlib.metadata
import subprocess
import sys
from pathlib import Path
from typing import Any

import dolfinx.jit
import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

from rotfem.numerics import forms
from tests.launch import environment

COMPILE = """
import sys, time
from pathlib import Path
import dolfinx.jit, ffcx.codegeneration.jit as ffcx_jit, ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from rotfem.numerics import forms
from tests.launch import environment

cache = Path(sys.argv[1])
dolfinx.jit.DOLFINX_DEFAULT_JIT_OPTIONS["cache_dir"] = (cache, "")
real = ffcx_jit._compile_objects

def slow(*args, **kwargs):
    with (cache / "compiled.txt").open("a") as log:
        log.write("once\\n")
    time.sleep(3)
    return real(*args, **kwargs)

ffcx_jit._compile_objects = slow
domain = mesh.create_unit_interval(MPI.COMM_SELF, 2)
v = ufl.TestFunction(fem.functionspace(domain, ("Lagrange", 1)))
print(fem.assemble_vector(forms.form(v * ufl.dx)).array.sum())
"""


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache of compiled forms."""
    monkeypatch.setitem(dolfinx.jit.DOLFINX_DEFAULT_JIT_OPTIONS, "cache_dir", (tmp_path, ""))
    return tmp_path


def mass() -> ufl.Form:
    domain = mesh.create_unit_interval(MPI.COMM_SELF, 3)
    V = fem.functionspace(domain, ("Lagrange", 2))
    return ufl.inner(ufl.TrialFunction(V), ufl.TestFunction(V)) * ufl.dx


def test_form_left_behind_is_made_anew(cache: Path) -> None:
    forms.form(mass())
    (source,) = cache.glob("libffcx_forms_*.c")
    for path in cache.glob("libffcx_forms_*"):
        path.unlink()
    source.touch()  # all that a compiler leaves which was killed at once
    assert fem.assemble_matrix(forms.form(mass())).to_dense().sum() == pytest.approx(1.0, rel=1e-14)
    assert source.with_suffix(".c.cached").exists()


def test_integrals_are_counted_once(cache: Path) -> None:
    """The second time nothing is differentiated; a note that is no number is counted anew."""
    assert forms.integral_count(mass()) == 1
    (note,) = (cache / "rotfem-counts").iterdir()
    note.write_text("2")
    assert forms.integral_count(mass()) == 2
    note.write_text("two")
    assert forms.integral_count(mass()) == 1


def test_errors_of_the_compiler_are_errors(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(dolfinx.jit.DOLFINX_DEFAULT_JIT_OPTIONS, "cffi_libraries", (["no_such_library"], ""))
    with pytest.raises(Exception, match=r"[Ll]inkError|failed"):
        forms.form(mass())


def test_plug_ins_are_looked_for_once(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the second form setuptools looks through no package; others find plug-ins as before, after an error too."""
    forms.form(mass())
    entry_points, distributions = importlib.metadata.entry_points, importlib.metadata.distributions
    looked = []

    def counted(**which: Any) -> Any:
        looked.append(which)
        return distributions(**which)

    monkeypatch.setattr(importlib.metadata, "distributions", counted)
    forms.form(2 * mass())
    assert looked == []
    monkeypatch.setitem(dolfinx.jit.DOLFINX_DEFAULT_JIT_OPTIONS, "cffi_libraries", (["no_such_library"], ""))
    with pytest.raises(Exception, match=r"[Ll]inkError|failed"):
        forms.form(3 * mass())
    assert importlib.metadata.entry_points is entry_points


def test_two_programs_want_one_form(tmp_path: Path) -> None:
    """Both get it, the second after the first has made it: it is compiled once."""
    command = [sys.executable, "-c", COMPILE, str(tmp_path)]
    both = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    out = [program.communicate(timeout=120)[0] for program in both]
    assert [float(text) for text in out] == pytest.approx([1.0, 1.0], rel=1e-14)
    assert (tmp_path / "compiled.txt").read_text() == "once\n"


def library(cache: Path) -> Path:
    (path,) = cache.glob("libffcx_forms_*.so")
    return path


SOUND = """
import sys
from pathlib import Path
import dolfinx.jit
from tests.unit.test_jit import forms, mass, fem
dolfinx.jit.DOLFINX_DEFAULT_JIT_OPTIONS["cache_dir"] = (Path(sys.argv[1]), "")
print(fem.assemble_matrix(forms.form(mass())).to_dense().sum())
"""


def in_a_process(cache: Path) -> subprocess.CompletedProcess[str]:
    """Assemble the form in a process of its own: a damaged library ends it."""
    command = [sys.executable, "-c", SOUND, str(cache)]
    return subprocess.run(command, env=environment(), capture_output=True, text=True, check=False, timeout=120)


@pytest.mark.parametrize("damage", ["half", "nothing", "one bit", "no library", "no note", "all"])
def test_a_damaged_cache_is_made_anew(cache: Path, damage: str) -> None:
    assert float(in_a_process(cache).stdout) == pytest.approx(1.0, rel=1e-14)
    path = library(cache)
    whole = path.read_bytes()
    if damage == "half":
        path.write_bytes(whole[: len(whole) // 2])
    elif damage == "nothing":
        path.write_bytes(b"")
    elif damage == "one bit":
        path.write_bytes(whole[:-1] + bytes([whole[-1] ^ 1]))
    elif damage == "no library":
        path.unlink()
    elif damage == "no note":  # as another program leaves it, cut short at the head
        next(cache.glob("*.c.cached")).write_text("")
        path.write_bytes(whole[:30])
    else:
        for file in cache.glob("libffcx*"):
            file.write_bytes(b"\x7fELFspoilt")
    done = in_a_process(cache)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) == pytest.approx(1.0, rel=1e-14)
    assert done.stderr == ""
    assert library(cache).stat().st_size == len(whole), "for ever"


def test_a_cache_that_cannot_be_written_is_replaced_by_a_temporary_one(tmp_path: Path) -> None:
    """A file in its place refuses everybody, root too."""
    (tmp_path / "cache").write_text("")
    done = in_a_process(tmp_path / "cache")
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) == pytest.approx(1.0, rel=1e-14)
    assert done.stderr.count("cannot be written") == 1
    assert "Traceback" not in done.stderr
