"""What a killed compiler leaves behind, and two programs that compile the same form."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import dolfinx.jit
import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

from rotfem.numerics import forms

COMPILE = """
import sys, time
from pathlib import Path
import dolfinx.jit, ffcx.codegeneration.jit as ffcx_jit, ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from rotfem.numerics import forms

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


def test_errors_of_the_compiler_are_errors(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(dolfinx.jit.DOLFINX_DEFAULT_JIT_OPTIONS, "cffi_libraries", (["no_such_library"], ""))
    with pytest.raises(Exception, match=r"[Ll]inkError|failed"):
        forms.form(mass())


def test_two_programs_want_one_form(tmp_path: Path) -> None:
    """Both get it, the second after the first has made it: it is compiled once."""
    command = [sys.executable, "-c", COMPILE, str(tmp_path)]
    both = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    out = [program.communicate(timeout=120)[0] for program in both]
    assert [float(text) for text in out] == pytest.approx([1.0, 1.0], rel=1e-14)
    assert (tmp_path / "compiled.txt").read_text() == "once\n"
