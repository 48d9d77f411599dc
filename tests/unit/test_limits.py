"""How much a scene may ask for, how large its files may be, and what of other files a message shows."""

from __future__ import annotations

import json
import os
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rotfem
from rotfem.errors import InputError, Problem, SceneError, printable, show
from rotfem.scene import Scene, load_scene
from rotfem.scene.files import DEEPEST, Unreadable, read_bytes
from rotfem.structures.structure import check_memory

SECTION = {"EA": 2.8e7, "GA": 1.0e7, "EI": 1.4e4, "mass_per_length": 1.2, "rotary_inertia": 6e-4}
TABLES: dict[str, Any] = {
    "structure": {"type": "planar_beam", "length": 10.0, "section": SECTION},
    "motion": {"type": "constant", "speed": 6.0},
    "time": {"end": 1.0, "step": 0.1},
}
MOVING = 'structure = {{type="planar_beam", length=1.0, section={{EA=1.0, GA=1.0, EI=1.0, mass_per_length=1.0}}}}\n{}'


def changed(**changes: Any) -> Scene:
    return Scene.from_dict(TABLES).replace({key.replace("__", "."): value for key, value in changes.items()})


@pytest.mark.parametrize(
    ("name", "changes", "key"),
    [
        ("steps", {"time__end": 1e9, "time__step": 1e-3}, "time.step"),
        ("steps", {"time__step": 1e-99}, "time.step"),
        ("modes", {"modes__count": 1001}, "modes.count"),
        ("rows", {"motion": {"type": "table", "table": [[t, 1.0] for t in range(101)]}, "limits__rows": 100}, "table"),
    ],
)
def test_too_much_is_refused_with_the_way_to_allow_it(name: str, changes: dict[str, Any], key: str) -> None:
    with pytest.raises(SceneError) as caught:
        changed(**changes)
    assert caught.value.key.endswith(key)
    assert f"more than limits.{name} = " in str(caught.value)


def test_limits_can_be_raised() -> None:
    assert changed(modes__count=1001, limits__modes=1001).modes.count == 1001
    assert "limits" not in changed().to_dict()
    assert changed(limits__modes=7).to_dict()["limits"]["modes"] == 7
    with pytest.raises(SceneError, match=r"limits.modes = 0: must be an integer at least 1"):
        changed(limits__modes=0)


def test_a_motion_is_stopped_at_the_limit_of_its_steps() -> None:
    """Fixed steps are known before; of adaptive ones the limit is met on the way, and what there is is kept."""
    tables = TABLES | {"mesh": {"elements": 1}, "model": {"theory": "linear"}}
    tables |= {"time": {"end": 5.0, "tolerance": 1e-5}, "limits": {"steps": 20}, "initial": {"state": "undeformed"}}
    with pytest.raises(rotfem.ComputationError, match=r"more than limits.steps = 20") as caught:
        rotfem.run(tables)
    assert len(caught.value.result.t) == 21


def test_numbers_have_a_size() -> None:
    for value in (1e-101, -1e101, 10**101, 5e-324):
        with pytest.raises(SceneError, match=r"must be from 1e-100 to 1e\+100 in size"):
            changed(motion__speed=value)
    assert changed(motion__speed=-0.0).motion.speed == 0.0


def test_a_section_that_comes_to_nothing_is_refused() -> None:
    tube = {"shape": "rectangle", "height": 1e-90, "width": 1e-90, "E": 1.0, "nu": 0.3, "rho": 1.0}
    with pytest.raises(SceneError, match=r"structure.section: its EA comes out as 1e-180"):
        changed(structure__section=tube)
    plate = {"type": "plate", "length": 1.0, "width": 1.0, "thickness": 1e60, "E": 1e11, "nu": 0.3, "rho": 1.0}
    with pytest.raises(SceneError, match=r"structure.thickness: its E h³ comes out as 1e\+191"):
        Scene.from_dict({"structure": plate, "motion": TABLES["motion"]})


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


# --- files that are no scene and no table ----------------------------------------------------------------------------


def test_reading_is_bounded(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"x" * 100)
    assert read_bytes(tmp_path / "file", 100) == b"x" * 100
    for path, most in ((tmp_path / "file", 99), (Path("/dev/zero"), 10**6)):
        with pytest.raises(Unreadable, match=f"is larger than {most} bytes"):
            read_bytes(path, most)
    with pytest.raises(SceneError, match="is larger than"):
        load_scene("/dev/zero")


def test_a_scene_may_come_from_a_pipe_but_is_not_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pipe = tmp_path / "pipe.toml"
    os.mkfifo(pipe)
    monkeypatch.setattr("rotfem.scene.files.PATIENCE", 0.1)
    with pytest.raises(SceneError, match=r"no byte came in 0.1 s"):
        load_scene(pipe)
    monkeypatch.setattr("rotfem.scene.files.PATIENCE", 10.0)
    text = MOVING.format('motion = {type="constant", speed=1}')
    writer = threading.Thread(target=pipe.write_text, args=(text,))
    writer.start()
    assert load_scene(pipe).structure.length == 1.0
    writer.join()


@pytest.mark.parametrize("content", ["root:x:0:0:root:/root:/bin/bash\n" * 3, "secret-of-13ch\n" * 3, "\x1b[2J\n" * 3])
def test_no_message_shows_the_content_of_another_file(tmp_path: Path, content: str) -> None:
    (tmp_path / "other").write_text(content)
    (tmp_path / "beam.toml").write_text(MOVING.format('motion = {type="table", table="other"}'))
    with pytest.raises(SceneError, match="must be a finite number") as caught:
        load_scene(tmp_path / "beam.toml")
    assert content.strip().splitlines()[0] not in str(caught.value)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    "text",
    [
        "[{}]\n".format(".".join("a" * 5000)),
        ".".join("a" * 5000) + " = 1\n",
        "a = " + "[" * 40 + "]" * 40,
        "a = " + "[" * 5000,
    ],
)
def test_what_is_nested_without_end_is_refused_in_words(tmp_path: Path, text: str) -> None:
    (tmp_path / "beam.toml").write_text(text)
    with pytest.raises(SceneError, match=f"nested more than {DEEPEST} deep"):
        load_scene(tmp_path / "beam.toml")


def test_tables_of_a_script_are_not_nested_without_end_either() -> None:
    nested: dict[str, Any] = {}
    for _ in range(5000):
        nested = {"a": nested}
    with pytest.raises(SceneError, match=f"structure: is nested more than {DEEPEST} deep"):
        Scene.from_dict({"structure": nested})


def test_values_are_shown_briefly_and_in_one_line() -> None:
    nested: list[Any] = []
    for _ in range(5000):
        nested = [nested]
    for value in ("x" * 10**6, [[1.0, 2.0]] * 10**5, nested, {"a": nested}, 10**5000, "\x1b[2J\u202e\n"):
        assert len(show(value)) <= 200
        assert show(value).isprintable()
    assert printable("a\nb\tc") == "a\\nb\\tc"
    error = SceneError("a.toml", "key", 1, "no", [Problem(f"key\n{i}", None, "no") for i in range(1000)])
    assert len(str(error).splitlines()) == 22
