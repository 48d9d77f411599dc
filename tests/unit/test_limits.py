"""How much memory a scene may ask for, and what of long values and tables messages and summaries show."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rotfem
from rotfem.errors import Fault, InputError, SceneError, printable, show
from rotfem.scene import Scene, load_scene
from rotfem.structures.structure import check_memory
from tests.beams import STRUCTURE

SECTION = STRUCTURE["section"]
TABLES: dict[str, Any] = {
    "structure": {"type": "planar_beam", "length": 10.0, "section": SECTION},
    "motion": {"type": "constant", "speed": 6.0},
    "time": {"end": 1.0, "step": 0.1},
}
MOVING = 'structure = {{type="planar_beam", length=1.0, section={{EA=1.0, GA=1.0, EI=1.0, mass_per_length=1.0}}}}\n{}'


def changed(**changes: Any) -> Scene:
    return Scene.from_dict(TABLES).replace({key.replace("__", "."): value for key, value in changes.items()})


def test_memory_is_asked_for_before_the_mesh_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    for kind in (rotfem.run, rotfem.modes):
        with pytest.raises(SceneError, match=r"mesh.elements = 1000000000: makes 9e\+09 unknowns.*ROTFEM_MEMORY"):
            kind(changed(mesh__elements=10**9))
    from mpi4py import MPI

    monkeypatch.setenv("ROTFEM_MEMORY", "1")
    with pytest.raises(InputError, match="there are 1 GB"):
        check_memory("mesh.elements", 0, 1e6, 3, 1, MPI.COMM_SELF)
    monkeypatch.setenv("ROTFEM_MEMORY", "20")
    check_memory("mesh.elements", 0, 1e6, 3, 1, MPI.COMM_SELF)
    monkeypatch.setenv("ROTFEM_MEMORY", "much")
    with pytest.raises(InputError, match='ROTFEM_MEMORY = "much": must be a number of GB'):
        check_memory("mesh.elements", 0, 1e6, 3, 1, MPI.COMM_SELF)


def test_histories_of_linear_theories_are_counted_with_what_their_pieces_take(monkeypatch: pytest.MonkeyPatch) -> None:
    plate = {"type": "plate", "length": 2.0, "width": 1.0, "thickness": 0.01, "E": 7e9, "nu": 0.3, "rho": 2700.0}
    model = {"theory": "consistent_linear"}
    scene = {"structure": plate, "motion": TABLES["motion"], "model": model, "mesh": {"elements": [100, 50]}}
    scene["loads"] = {"pressure": 1.0}
    monkeypatch.setenv("ROTFEM_MEMORY", "1")  # modes would take 0.6 GB
    with pytest.raises(SceneError, match=r"mesh.elements = \[100, 50\]: makes 1.02e\+05 unknowns, which need 1.22 GB"):
        rotfem.run({**scene, "time": {"end": 0.1, "step": 0.1}})


def test_what_a_script_makes_is_checked_as_a_scene_is() -> None:
    with pytest.raises(InputError, match=r"PlanarBeamStructure: length = -1: must be greater than 0"):
        rotfem.PlanarBeam(length=-1, section=SECTION)
    with pytest.raises(InputError, match=r"BeamMesh: elements = true: must be an integer"):
        rotfem.BeamMesh(elements=True)


# --- long tables -----------------------------------------------------------------------------------------------------


def test_a_summary_refers_to_a_long_table(tmp_path: Path) -> None:
    t = np.linspace(0.0, 20.0, 5001)
    np.savetxt(tmp_path / "speed.csv", np.column_stack([t, np.sin(t)]), delimiter=",", header="t,w", comments="")
    (tmp_path / "beam.toml").write_text(MOVING.format('motion = {type="table", table="speed.csv"}'))
    scene = load_scene(tmp_path / "beam.toml")
    told = scene.digest()["motion"]["table"]
    assert {key: told[key] for key in ("file", "rows", "columns")} == {"file": "speed.csv", "rows": 5001, "columns": 2}
    assert len(json.dumps(scene.digest())) < 3000
    inline = Scene.from_dict(scene.to_dict())  # in full, so that it can be read again
    assert inline.motion == scene.motion
    assert inline.digest()["motion"]["table"] == {key: told[key] for key in ("rows", "columns", "sha256")}
    other = inline.replace({"motion.table": [*inline.to_dict()["motion"]["table"][:-1], [20.0, 0.5]]})
    assert other.digest()["motion"]["table"]["sha256"] != told["sha256"]
    assert changed().digest() == changed().to_dict()


# --- messages --------------------------------------------------------------------------------------------------------


def test_values_are_shown_briefly_and_in_one_line() -> None:
    for value in ("x" * 10**6, [[1.0, 2.0]] * 10**5, "\x1b[2J\u202e\n"):
        assert len(show(value)) <= 200
        assert show(value).isprintable()
    assert printable("a\nb\tc") == "a\\nb\\tc"
    error = SceneError("a.toml", "key", 1, "no", [Fault(f"key\n{i}", None, "no") for i in range(1000)])
    assert len(str(error).splitlines()) == 21
