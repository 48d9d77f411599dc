"""The cache of compiled forms: what is loaded from it, what is made anew, and who may steer that."""

from __future__ import annotations

import importlib.metadata
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

from rotfem.numerics import form_cache, forms
from tests.launch import environment

PROGRAM = """
import sys, time
import ffcx.codegeneration.jit as ffcx_jit
from rotfem.numerics import forms
from tests.unit.test_jit import fem, mass

real = ffcx_jit._compile_objects

def slow(*args, **kwargs):
    with open("compiled.txt", "a") as log:
        log.write("once\\n")
    time.sleep(float(sys.argv[1]))
    return real(*args, **kwargs)

ffcx_jit._compile_objects = slow
print(fem.assemble_matrix(forms.form(mass())).to_dense().sum(), flush=True)
for _ in sys.stdin:
    print(fem.assemble_matrix(forms.form(mass())).to_dense().sum(), flush=True)
"""


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache of compiled forms."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "rotfem" / "forms"


def mass() -> ufl.Form:
    domain = mesh.create_unit_interval(MPI.COMM_SELF, 3)
    V = fem.functionspace(domain, ("Lagrange", 2))
    return ufl.inner(ufl.TrialFunction(V), ufl.TestFunction(V)) * ufl.dx


def assembled() -> float:
    total: float = fem.assemble_matrix(forms.form(mass())).to_dense().sum()
    return total


def start(folder: Path, wait: float = 0.0) -> subprocess.Popen[str]:
    """Start a process that assembles the form in a folder, where compiled.txt counts what it compiles.

    It does so again for each line that it is given.
    """
    command = [sys.executable, "-c", PROGRAM, str(wait)]
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    return subprocess.Popen(command, cwd=folder, env=environment(), text=True, **pipes)  # type: ignore[call-overload,no-any-return]


def in_a_process(folder: Path) -> tuple[int, str]:
    """Return (forms compiled so far, stderr) after the form was assembled: a damaged library would end the process."""
    with start(folder) as program:
        out, err = program.communicate(timeout=120)
    assert program.returncode == 0, err
    assert float(out) == pytest.approx(1.0, rel=1e-14)
    return len((folder / "compiled.txt").read_text().split()), err


def library(cache: Path) -> Path:
    (path,) = cache.glob("libffcx_forms_*.so")
    return path


def test_what_a_killed_compiler_leaves_is_no_obstacle(cache: Path) -> None:
    assert assembled() == pytest.approx(1.0, rel=1e-14)
    work = library(cache).with_suffix(".work")
    (cache / form_cache.INDEX).unlink()
    work.mkdir()
    (work / f"{work.stem}.c").touch()  # which FFCx would take for one that another process compiles
    assert assembled() == pytest.approx(1.0, rel=1e-14)
    assert not work.exists()


def test_integrals_are_counted_once(cache: Path) -> None:
    """The second time nothing is differentiated; a note that is no number is counted anew."""
    assert forms.integral_count(mass()) == 1
    (note,) = (cache / "counts").iterdir()
    note.write_text("2")
    assert forms.integral_count(mass()) == 2
    note.write_text("two")
    assert forms.integral_count(mass()) == 1


def test_errors_of_the_compiler_are_errors(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forms, "FLAGS", ("-no-such-flag",))
    with pytest.raises(Exception, match=r"[Cc]ompileError|failed"):
        forms.form(mass())
    assert sorted(path.name for path in cache.iterdir()) == ["counts", "lock"]


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
    monkeypatch.setattr(forms, "FLAGS", ("-no-such-flag",))
    with pytest.raises(Exception, match=r"[Cc]ompileError|failed"):
        forms.form(3 * mass())
    assert importlib.metadata.entry_points is entry_points


def test_two_programs_want_one_form(cache: Path, tmp_path: Path) -> None:
    """Both get it, the second after the first has made it: it is compiled once."""
    both = [start(tmp_path, wait=1.5) for _ in range(2)]
    out = [program.communicate(timeout=120)[0] for program in both]
    assert [float(text) for text in out] == pytest.approx([1.0, 1.0], rel=1e-14)
    assert (tmp_path / "compiled.txt").read_text() == "once\n"


def put(path: Path, content: bytes) -> None:
    """Write another file in the place of one, which a process may have loaded."""
    path.unlink()
    path.write_bytes(content)


def spoil(cache: Path, damage: str) -> None:
    """Damage a cache of one form in one way."""
    path, index = library(cache), cache / form_cache.INDEX
    whole = path.read_bytes()
    if damage == "half":
        put(path, whole[: len(whole) // 2])
    elif damage == "nothing":
        put(path, b"")
    elif damage == "one bit":
        put(path, whole[:-1] + bytes([whole[-1] ^ 1]))
    elif damage == "no library":
        path.unlink()
    elif damage == "no index":
        index.unlink()
    elif damage == "other sum":
        index.write_text(f"{index.read_text()[:-2]}\n")
    elif damage == "index elsewhere":
        index.symlink_to(index.rename(cache.parent / "elsewhere"))
    elif damage == "index of others":
        index.chmod(0o666)
    else:
        for file in cache.iterdir():
            if file.is_file():
                put(file, b"\x7fELFspoilt")


DAMAGES = ["half", "nothing", "one bit", "no library", "no index", "other sum"]
DAMAGES += ["index elsewhere", "index of others", "all"]


def test_a_damaged_cache_is_made_anew(cache: Path, tmp_path: Path) -> None:
    """Once and for ever, and only the user's own index is believed."""
    program = start(tmp_path)
    assert program.stdin is not None
    assert program.stdout is not None
    assert float(program.stdout.readline()) == pytest.approx(1.0, rel=1e-14)
    path, index = library(cache), cache / form_cache.INDEX
    size = path.stat().st_size
    for compiled, damage in enumerate(DAMAGES, start=2):
        spoil(cache, damage)
        program.stdin.write("again\n")
        program.stdin.flush()
        assert float(program.stdout.readline() or "nan") == pytest.approx(1.0, rel=1e-14), damage
        assert len((tmp_path / "compiled.txt").read_text().split()) == compiled, damage
        assert library(cache).stat().st_size == size, damage
        assert index.stat().st_mode & 0o777 == 0o600, damage
        assert not index.is_symlink(), damage
        made = path.stat().st_mtime_ns
        assert assembled() == pytest.approx(1.0, rel=1e-14)
        assert path.stat().st_mtime_ns == made, f"{damage}: compiled once more"
    assert program.communicate(timeout=120)[1] == ""


def test_a_cache_that_cannot_be_written_is_replaced_by_a_temporary_one(cache: Path, tmp_path: Path) -> None:
    """A file in its place refuses everybody, root too."""
    (tmp_path / "rotfem").write_text("")
    _, err = in_a_process(tmp_path)
    assert err.count("cannot be written") == 1
    assert "Traceback" not in err


def test_only_a_folder_of_the_user_alone_is_trusted(cache: Path) -> None:
    assert form_cache.unusable() == ""
    assert cache.stat().st_mode & 0o777 == 0o700
    for mode in (0o720, 0o702, 0o777):
        cache.chmod(mode)
        assert form_cache.unusable() == "can be written by others"
    cache.chmod(0o700)
    cache.parent.chmod(0o777)
    assert form_cache.unusable() == f"can be replaced by others, who can write to {cache.parent}"
    cache.parent.chmod(0o1777)  # where only its owner can replace a folder
    assert form_cache.unusable() == ""


def test_a_folder_of_somebody_else_is_not_trusted(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert form_cache.unusable() == ""
    uid = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: uid + 1)
    assert form_cache.unusable() == "belongs to another user"


def test_files_of_the_current_folder_have_no_effect(cache: Path, tmp_path: Path) -> None:
    """Nor have those of the user's configuration: options of dolfinx, of FFCx and of PETSc."""
    here, config = tmp_path / "here", tmp_path / "config"
    for name, options in (
        ("dolfinx_jit_options.json", {"cache_dir": "sent", "cffi_extra_compile_args": ["-no-such"], "unknown": 1}),
        ("ffcx_options.json", {"table_atol": 0.05, "table_rtol": 0.05, "scalar_type": "float32", "unknown": 1}),
    ):
        for folder in (here, config / "dolfinx", config / "ffcx"):
            folder.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(json.dumps(options))
    (here / ".petscrc").write_text("-log_view\n-dll_append sent/libsent.so\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CONFIG_HOME", str(config))
        assert in_a_process(here) == (1, "")
    assert library(cache).exists(), "where it always is"
    assert not (here / "sent").exists()
    assert assembled() == pytest.approx(1.0, rel=1e-14)
    assert len(list(cache.glob("*.so"))) == 1, "the same form"
