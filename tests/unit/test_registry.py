"""What is registered is what a scene may name: theories, effects, schemes, section shapes and outputs."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import rotfem.scene
from rotfem import registry
from rotfem.errors import SceneError
from rotfem.mechanics.effects import Effect, present_effects
from rotfem.mechanics.theories import Theory, ladder
from rotfem.registry import Entry, Registry, register
from rotfem.scene import Scene

ROOT = Path(__file__).resolve().parents[2]
SECTION = {"EA": 2.8e7, "GA": 1.0e7, "EI": 1.4e4, "mass_per_length": 1.2}
SPATIAL_SECTION = {"EA": 3.0, "GA2": 1.0, "GA3": 2.0, "GJ": 5.0, "EI2": 7.0, "EI3": 11.0, "mass_per_length": 13.0}
STRUCTURES = {
    "planar_beam": {"type": "planar_beam", "length": 10.0, "section": SECTION},
    "spatial_beam": {"type": "spatial_beam", "length": 10.0, "section": SPATIAL_SECTION},
}

Add = Callable[[Any], Any]


@pytest.fixture
def add() -> Iterator[Add]:
    """Registers for the length of a test."""
    added: list[Any] = []

    def add_one(entry: Any) -> Any:
        register(entry)
        added.append(entry)
        return entry

    yield add_one
    for entry in added:
        if entry.name in entry.registry:
            entry.registry.remove(entry.name)


def scene(structure: str = "planar_beam", **tables: Any) -> Scene:
    motion = {"type": "constant", "speed": 3.0}
    return Scene.from_dict({"structure": STRUCTURES[structure], "motion": motion} | tables, "test.toml")


def refusal(structure: str = "planar_beam", **tables: Any) -> str:
    with pytest.raises(SceneError) as caught:
        scene(structure, **tables)
    return str(caught.value)


def strains(q: Any) -> tuple[Any, ...]:
    return ()


# --- registries -----------------------------------------------------------------------------------------------------


def test_the_classes_share_the_registries_of_the_ground() -> None:
    assert (Theory.registry, Effect.registry) == (registry.theories, registry.effects)
    assert ladder()[0] == "linear" and set(ladder()) == set(registry.theories.names)
    assert registry.schemes.names == ("generalised_alpha", "newmark")


@pytest.mark.parametrize("name", ["", "two words", "2nd", "a-b", "a.b", None])
def test_bad_names_are_refused(name: Any) -> None:
    with pytest.raises(ValueError, match="cannot be the name of a theory"):
        register(Theory(name, 9, {}))
    assert name not in registry.theories


def test_a_name_is_given_once(add: Add) -> None:
    add(Theory("mine", 9, {}))
    with pytest.raises(ValueError, match="'mine' is the name of another theory already"):
        register(Theory("mine", 10, {}))
    assert registry.theories["mine"].rank == 9
    with pytest.raises(ValueError, match="'gravity' is the name of another effect already"):
        register(Effect("gravity"))


@pytest.mark.parametrize("thing", ["reissner", object(), Registry])
def test_only_entries_are_registered(thing: Any) -> None:
    with pytest.raises(TypeError, match="cannot be registered"):
        register(thing)


def test_names_are_valid_values_until_they_are_removed(add: Add) -> None:
    """One entry of each kind, where it is named in a scene, and what the scene is told when it is gone."""
    entries: list[tuple[Entry, dict[str, Any], str]] = [
        (Theory("mine", 9, {"planar_beam": strains}), {"model": {"theory": "mine"}}, "model.theory"),
        (Effect("mine"), {"model": {"effects": ["mine"]}}, "model.effects"),
    ]
    for entry, tables, key in entries:
        assert key in refusal(**tables)
        add(entry)
        assert scene(**tables).to_dict()[key.split(".")[0]][key.split(".")[1]] in ("mine", ["mine"])
        entry.registry.remove("mine")
        message = refusal(**tables)
        assert message.startswith(f"test.toml: {key} = ") and "allowed: " in message


def test_what_a_user_registered_is_suggested(add: Add) -> None:
    add(Theory("cubic_curvature", 3.5, {"planar_beam": strains}))
    message = refusal(model={"theory": "cubic_curvatur"})
    assert 'did you mean "cubic_curvature"? allowed: "linear", ' in message
    assert message.endswith(', "reissner", "cubic_curvature"')


def test_names_of_the_scene_are_those_of_now(add: Add) -> None:
    before = rotfem.scene.THEORIES
    assert before == ladder()
    add(Theory("mine", 0.5, {}))
    assert (before[0], "mine", *before[1:]) == rotfem.scene.THEORIES
    add(Effect("lift"))
    assert (*registry.effects.names[:-1], "lift") == rotfem.scene.EFFECTS
    with pytest.raises(AttributeError, match="no attribute 'SHAPES'"):
        _ = rotfem.scene.SHAPES  # type: ignore[attr-defined]


def test_a_scene_is_validated_without_fenicsx() -> None:
    """The registries are read then; what their entries compute with is not."""
    code = (
        "import sys, rotfem; rotfem.load_scene('tests/scenes/iccia_hub_beam.toml').effective_effects();"
        "print(*sorted({'dolfinx', 'ufl', 'basix', 'ffcx', 'petsc4py', 'slepc4py', 'mpi4py'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert done.stdout.split() == []


# --- theories -------------------------------------------------------------------------------------------------------


def test_a_theory_is_refused_for_a_structure_it_has_no_strains_for(add: Add) -> None:
    add(Theory("flat", 9, {"planar_beam": strains}))
    scene("planar_beam", model={"theory": "flat"})
    message = refusal("spatial_beam", model={"theory": "flat"})
    assert 'model.theory = "flat": has strains for planar_beam, none for a spatial_beam' in message
    assert message.endswith('allowed there: "linear", "consistent_linear", "von_karman_linear", "second_order", '
                            '"von_karman", "reissner"')  # fmt: skip


def test_the_inertial_frame_takes_every_exact_theory(add: Add) -> None:
    add(Theory("other_exact", 9, {"planar_beam": strains}, exact=True))
    add(Theory("inexact", 10, {"planar_beam": strains}))
    scene(model={"theory": "other_exact", "frame": "inertial"})
    message = refusal(model={"theory": "inexact", "frame": "inertial"})
    assert 'model.theory = "reissner" or "other_exact"' in message


# --- effects --------------------------------------------------------------------------------------------------------


def test_an_effect_is_in_a_scene_that_has_data_for_it(add: Add) -> None:
    add(Effect("lift", present=lambda problem: problem.motion.is_spinning and problem.structure.length > 5))
    assert scene().effective_effects() == ("coriolis", "centrifugal", "lift")
    assert scene(motion={"type": "constant", "speed": 0.0}).effective_effects() == ()
    at_rest = scene(motion={"type": "constant", "speed": 0.0})
    assert at_rest.effective_effects(spinning=True) == ("coriolis", "centrifugal", "lift")
    assert scene(model={"effects": ["coriolis"]}).effective_effects() == ("coriolis",)
    assert scene(model={"effects": ["lift", "gravity"]}).effective_effects() == ("lift",)


def test_an_effect_of_rotation_is_none_of_the_inertial_frame(add: Add) -> None:
    add(Effect("drift", of_rotation=True))
    inertial = {"frame": "inertial"}
    assert "drift" in scene().effective_effects()
    assert scene(model=inertial).effective_effects() == ()
    assert '"drift" is not a separate effect' in refusal(model=inertial | {"effects": ["drift"]})


@pytest.mark.parametrize("path", sorted((ROOT / "tests" / "scenes").glob("*.toml")), ids=lambda path: path.stem)
def test_scene_and_mechanics_agree_about_what_is_present(path: Path) -> None:
    auto = rotfem.load_scene(path, ["model.effects=auto"])
    assert auto.effective_effects() == present_effects(auto)
