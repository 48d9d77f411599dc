"""What an accuracy allows of each error, and the settings that follow from one that was missed."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rotfem.commands.accuracy import coarsened, models_of
from rotfem.errors import SceneError
from rotfem.scene import Scene
from rotfem.selection.accuracy import AIM, SAFETY, SHARES, Settings, finer, shares
from tests.beams import STRUCTURE

SETTINGS = Settings(
    ({"theory": "consistent_linear"}, {"theory": "reissner"}), 6, 3, "generalised_alpha", tolerance=1e-3
)


@pytest.mark.parametrize(
    "error", [{}, {"time": 1.0}, {"time": 1e-4, "space": 1e-9}, {"time": 3, "space": 2, "model": 1}]
)
def test_shares_are_never_more_than_the_whole(error: dict[str, float]) -> None:
    given = shares(error, 1e-3)
    assert set(given) == set(SHARES)
    assert sum(given.values()) <= SAFETY * 1e-3 * (1 + 1e-12)


def test_what_one_does_not_need_is_the_others() -> None:
    """Steps alone have an error, so they may have all of it; all three alike have their own shares."""
    assert shares({"time": 1.0}, 1e-2)["time"] == pytest.approx(SAFETY * 1e-2)
    assert shares({"time": 1.0, "space": 1.0, "model": 1.0}, 1e-2) == pytest.approx(
        {name: SAFETY * 1e-2 * share for name, share in SHARES.items()}
    )


def test_a_tolerance_shrinks_as_its_error_must() -> None:
    better = SETTINGS.better({"time": 1e-2, "space": 0.0, "model": 0.0}, 1e-3)
    assert better is not None
    assert better.tolerance == pytest.approx(1e-3 * AIM * SAFETY * 1e-3 / 1e-2)
    assert (better.elements, better.models) == (6, SETTINGS.models)


def test_a_step_shrinks_by_the_order_of_its_scheme() -> None:
    fixed = replace(SETTINGS, scheme="esdirk4", step=0.1, tolerance=None)
    better = fixed.better({"time": 16 * AIM * SAFETY * 1e-3, "space": 0.0, "model": 0.0}, 1e-3)
    assert better is not None
    assert better.step == pytest.approx(0.05)


def test_elements_grow_by_the_order_of_their_degree() -> None:
    """Sixteen times too large an error of cubic elements: twice as many of them, and no other time step."""
    allowed = AIM * SAFETY * 1e-3
    better = SETTINGS.better({"time": 0.0, "space": 16 * allowed, "model": 0.0}, 1e-3)
    assert better is not None
    assert (better.elements, better.tolerance) == (12, 1e-3)
    assert finer((4, 1), 1.25) == (5, 2)


def test_a_poor_model_gives_way_to_the_next_one() -> None:
    better = SETTINGS.better({"time": 1e-4, "space": 1e-9, "model": 0.2}, 1e-3)
    assert better is not None
    assert better.models == ({"theory": "reissner"},)
    assert better.better({"time": 0.0, "space": 0.0, "model": 0.2}, 1e-3) is None


def test_a_mesh_file_has_no_finer_elements() -> None:
    given = Settings(({"theory": "reissner"},), None, 2)
    assert given.better({"space": 0.5}, 1e-3) is None
    assert "mesh.elements" not in given.changes()


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
    changed = scene.replace(SETTINGS.changes())
    assert (changed.mesh.elements, changed.model.theory) == (6, "consistent_linear")
    with pytest.raises(SceneError, match="exactly one of step"):
        scene.replace({"accuracy": None})
    for key, value in (("accuracy", 0.9), ("accuracy", 0), ("accuracy", "fine"), ("accuracy_of", "root")):
        with pytest.raises(SceneError, match=key):
            scene.replace({key: value})
    with pytest.raises(SceneError, match="cannot be combined with accuracy"):
        scene.replace({"model.tolerance": 1e-3})


def test_a_plate_begins_with_few_cells_of_its_proportions() -> None:
    """24 nodes along the longer edge, no fewer than three cells along the other, and never more than the scene has."""
    assert coarsened((24, 12), 2) == (12, 6)
    assert coarsened((8, 40), 2) == (3, 12)
    assert coarsened((60, 1), 3) == (8, 1)
    assert coarsened((10, 2), 2) == (10, 2)


def test_a_torque_by_a_controller_has_no_reduced_model() -> None:
    """It depends on the motion, which a reduced model is not told: the first answer is by the scene's own theory."""
    tables = {"structure": STRUCTURE, "accuracy": 1e-3, "time": {"end": 1.0, "step": 0.01}}
    hub = {"type": "torque", "hub_inertia": 50.0}
    controlled = {**tables, "motion": {**hub, "function": lambda t, psi, psi_dot, tip: 5.0 - psi_dot}}
    given = {**tables, "motion": {**hub, "pulses": [[0.0, 0.5, 10.0]]}}
    models = [models_of(Scene.from_dict(scene), moving=True) for scene in (controlled, given)]
    assert [[bool(model["reduced"]) for model in each] for each in models] == [[False], [True, False]]
