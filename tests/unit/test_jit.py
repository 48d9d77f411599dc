"""The cache of compiled forms: who may write to it, whose options count, and what a killed compilation leaves."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

from rotfem.numerics import form_cache, forms
from tests.launch import environment

PROGRAM = "import rotfem.numerics; from tests.unit.test_jit import assembled; print(assembled())"


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty cache of compiled forms, not made yet."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    kept = (form_cache.folder, form_cache.part)
    for function in kept:
        function.cache_clear()
    yield tmp_path / "rotfem" / "forms"
    for function in kept:
        function.cache_clear()


def assembled() -> float:
    """Return the sum of the entries of a mass matrix: the length 1."""
    V = fem.functionspace(mesh.create_unit_interval(MPI.COMM_SELF, 3), ("Lagrange", 2))
    form = forms.form(ufl.inner(ufl.TrialFunction(V), ufl.TestFunction(V)) * ufl.dx)
    return float(fem.assemble_matrix(form).to_dense().sum())


def in_a_process(folder: Path) -> subprocess.CompletedProcess[str]:
    """Assemble in a process of its own, in a folder."""
    command = [sys.executable, "-c", PROGRAM]
    return subprocess.run(command, cwd=folder, env=environment(), text=True, capture_output=True, timeout=120)


def test_what_a_killed_compilation_leaves_is_removed(cache: Path) -> None:
    """FFCx would wait for it: at the start of a program, and after an interrupt; not while another one compiles."""
    assert assembled() == pytest.approx(1.0, rel=1e-14)
    [part] = (path for path in cache.iterdir())
    left = part / "libffcx_forms_0.c"
    left.touch()
    form_cache.part.cache_clear()
    assert assembled() == pytest.approx(1.0, rel=1e-14)
    assert not left.exists()
    with form_cache.in_use(part):
        left.touch()
        form_cache.clear(part)
        assert left.exists()
    with pytest.raises(KeyboardInterrupt), form_cache.in_use(part):
        raise KeyboardInterrupt
    assert [path.suffix for path in part.glob("*.c")] == [".c"], "the form that was compiled"


def test_errors_of_the_compiler_are_errors(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forms, "FLAGS", ("-no-such-flag",))
    with pytest.raises(Exception, match=r"[Cc]ompileError|failed"):
        assembled()
    monkeypatch.undo()
    assert assembled() == pytest.approx(1.0, rel=1e-14)


def test_only_a_folder_of_the_user_alone_is_trusted(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert form_cache.folder() == cache
    assert cache.stat().st_mode & 0o777 == 0o700
    for mode in (0o720, 0o702, 0o777):
        cache.chmod(mode)
        assert form_cache.unsafe(cache) == "can be written by others"
    cache.chmod(0o700)
    for mode, why in ((0o777, f"can be replaced by others, who can write to {cache.parent}"), (0o1777, "")):
        cache.parent.chmod(mode)  # where the folder's owner alone can replace it, it is safe
        assert form_cache.unsafe(cache) == why
    uid = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: uid + 1)
    assert form_cache.unsafe(cache) == "belongs to another user"


@pytest.mark.parametrize("spoilt", ["others can write", "a file"])
def test_another_folder_is_not_used(cache: Path, caplog: pytest.LogCaptureFixture, spoilt: str) -> None:
    if spoilt == "a file":
        cache.parent.write_text("")
    else:
        cache.mkdir(parents=True)
        cache.chmod(0o777)
    assert assembled() == pytest.approx(1.0, rel=1e-14)
    assert cache not in (form_cache.folder(), *form_cache.folder().parents)
    assert form_cache.folder().stat().st_mode & 0o777 == 0o700
    assert spoilt == "a file" or list(cache.iterdir()) == []
    assert [record.getMessage() for record in caplog.records if "all forms are compiled anew" in record.getMessage()]


def test_options_in_files_have_no_effect(cache: Path, tmp_path: Path) -> None:
    """Those of dolfinx, FFCx and PETSc, of the working folder and of the user; what has no meaning is refused."""
    here, config = tmp_path / "here", tmp_path / "config"
    for folder in (here, config / "dolfinx", config / "ffcx"):
        folder.mkdir(parents=True)
        jit = {"cache_dir": "sent", "cffi_extra_compile_args": ["-no-such"], "cffi_libraries": ["sent"], "timeout": 0}
        (folder / "dolfinx_jit_options.json").write_text(json.dumps(jit))
        (folder / "ffcx_options.json").write_text(json.dumps({"table_atol": 0.05, "scalar_type": "float32"}))
    (here / ".petscrc").write_text("-log_view\n-dll_append sent/libsent.so\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CONFIG_HOME", str(config))
        done = in_a_process(here)
        assert (float(done.stdout), done.stderr) == (pytest.approx(1.0, rel=1e-14), "")
        assert not (here / "sent").exists()
        for text in ('{"unknown": 1}', "{"):
            (here / "dolfinx_jit_options.json").write_text(text)
            assert "InputError: dolfinx_jit_options.json" in in_a_process(here).stderr.splitlines()[-1]
    assert assembled() == pytest.approx(1.0, rel=1e-14)
    assert len(list(cache.glob("*/*.so"))) == 1, "the same form"
