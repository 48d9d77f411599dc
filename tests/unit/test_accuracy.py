"""Scenes that ask for an accuracy, and the settings that they are first computed with."""

from __future__ import annotations

import pytest

from rotfem.commands.accuracy import coarsened
from rotfem.errors import SceneError
from rotfem.refinement.refine import Setting
from rotfem.scene import Scene
from tests.beams import STRUCTURE

SETTING = Setting(({"theory": "consistent_linear"}, {"theory": "reissner"}), 6, 3, "esdirk4", 1e-3)


def test_scenes_ask_for_an_accuracy() -> None:
    """Steps need not be given then; what an accuracy chooses by itself, or leaves no choice, is refused."""
    tables = {
        "accuracy": 1e-3,
        "structure": STRUCTURE,
        "motion": {"type": "spin_up", "speed": 6.0, "duration": 15.0},
        "time": {"end": 1.0},
    }
    scene = Scene.from_dict(tables)
    assert scene.time is not None
    assert (scene.time.step, scene.time.tolerance) == (None, 1e-3)
    changed = scene.replace(SETTING.changes())
    assert (changed.mesh.elements, changed.model.theory) == (6, "consistent_linear")
    with pytest.raises(SceneError, match="exactly one of step"):
        scene.replace({"accuracy": None})
    for key, value in (("accuracy", 0.9), ("accuracy", 0), ("accuracy", "fine"), ("accuracy_of", "root")):
        with pytest.raises(SceneError, match=key):
            scene.replace({key: value})


def test_a_plate_begins_with_few_cells_of_its_proportions() -> None:
    """24 nodes along the longer edge, no fewer than three cells along the other, and never more than the scene has."""
    assert coarsened((24, 12), 2) == (12, 6)
    assert coarsened((8, 40), 2) == (3, 12)
    assert coarsened((60, 1), 3) == (8, 1)
    assert coarsened((10, 2), 2) == (10, 2)
