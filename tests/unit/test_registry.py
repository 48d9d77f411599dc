"""What is registered is what a scene may name: theories, effects, schemes, section shapes and outputs."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import rotfem.scene
from rotfem import registry
from rotfem.analysis.schemes import Array, Scheme, Stage, State
from rotfem.errors import SceneError
from rotfem.mechanics.effects import Effect
from rotfem.mechanics.problem import Output
from rotfem.mechanics.theories import Theory
from rotfem.registry import register
from rotfem.scene import Scene
from rotfem.scene.section_shapes import Geometry, Shape

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
        rotfem.register(entry)
        added.append(entry)
        return entry

    yield add_one
    for entry in added:
        if entry.name in entry.registry:
            entry.registry.remove(entry.name)


def scene(kind: str = "planar_beam", /, **tables: Any) -> Scene:
    motion = {"type": "constant", "speed": 3.0}
    return Scene.from_dict({"structure": STRUCTURES[kind], "motion": motion} | tables, "test.toml")


def refusal(kind: str = "planar_beam", /, **tables: Any) -> str:
    with pytest.raises(SceneError) as caught:
        rotfem.Problem.of(scene(kind, **tables))
    return str(caught.value)


class OneStage(Scheme):
    """What the schemes of these tests share."""

    order: ClassVar[int] = 1

    def stage(self, i: int, state: State, h: float, end: float, done: Sequence[Stage]) -> Stage:
        return Stage(end, state.q.copy(), state.v.copy(), state.a.copy(), 1 / h, 1 / h**2)

    def finish(self, state: State, h: float, done: Sequence[Stage]) -> State:
        return State(done[0].t, done[0].q, done[0].v, done[0].a)


@dataclass(frozen=True)
class Damped(OneStage):
    """A scheme without an estimate of its error, with a parameter that must be given and one with a default."""

    name: ClassVar[str] = "damped"

    decay: float
    gamma: float = 0.75

    @classmethod
    def check(cls, parameters: dict[str, Any]) -> dict[str, str]:
        return {} if parameters["decay"] < parameters["gamma"] else {"decay": "must be less than gamma"}


class Estimated(OneStage):
    """A scheme without parameters that estimates its error."""

    name: ClassVar[str] = "estimated"

    def local_error(self, new: State, old: State) -> Array:
        return new.q - old.q


def square(nu: Array, side: Array) -> Geometry:
    second = side**4 / 12
    return Geometry(side**2, second, second, 0.1406 * side**4, 10 * (1 + nu) / (12 + 11 * nu))


def ellipse(nu: Array, semi_axis_2: Array, semi_axis_3: Array) -> Geometry:
    a, b = semi_axis_2, semi_axis_3
    area = np.pi * a * b
    return Geometry(area, area * b**2 / 4, area * a**2 / 4, np.pi * (a * b) ** 3 / (a**2 + b**2), 0.9 + 0 * nu)


def beam(kind: str = "planar_beam", /, **section: Any) -> dict[str, Any]:
    """Returns the table of a beam of a material and a shape."""
    return {"type": kind, "length": 2.0, "section": {"E": 210e9, "nu": 0.25, "rho": 7800.0} | section}


def value_at(tables: Any, key: str) -> Any:
    for part in key.split("."):
        tables = tables[part]
    return tables


def strains(q: Any) -> tuple[Any, ...]:
    return ()


# --- registries -----------------------------------------------------------------------------------------------------


def test_the_classes_share_the_registries_of_the_ground() -> None:
    assert (Theory.registry, Effect.registry) == (registry.theories, registry.effects)
    assert (Scheme.registry, Output.registry) == (registry.schemes, registry.outputs)
    assert registry.schemes.names == ("generalised_alpha", "newmark", "energy_conserving", "esdirk4")


def test_a_name_is_given_once(add: Add) -> None:
    add(Theory("mine", 9, {}))
    with pytest.raises(ValueError, match="'mine' is the name of another theory already"):
        register(Theory("mine", 10, {}))
    assert registry.theories["mine"].rank == 9
    with pytest.raises(ValueError, match="'gravity' is the name of another effect already"):
        register(Effect("gravity"))


def test_names_are_valid_values_until_they_are_removed(add: Add) -> None:
    """One entry of each kind, where it is named in a scene, and what the scene is told when it is gone."""
    entries: list[tuple[Any, dict[str, Any], str]] = [
        (Theory("mine", 9, {"planar_beam": strains}), {"model": {"theory": "mine"}}, "model.theory"),
        (Effect("mine"), {"model": {"effects": ["mine"]}}, "model.effects"),
        (Damped, {"time": {"end": 1, "step": 0.1, "scheme": "damped", "decay": 0.5}}, "time.scheme"),
        (Shape("mine", ("side",), square), {"structure": beam(shape="mine", side=1)}, "structure.section.shape"),
        (Output("mine", strains), {"output": {"quantities": ["mine"]}}, "output.quantities"),
    ]
    for entry, tables, key in entries:
        assert f"{key} = " in refusal(**tables)
        add(entry)
        assert value_at(scene(**tables).to_dict(), key) in (entry.name, [entry.name])
        entry.registry.remove(entry.name)
        message = refusal(**tables)
        assert message.startswith(f"test.toml: {key} = ")
        assert "allowed: " in message or "none are registered" in message


def test_a_scene_is_validated_without_fenicsx() -> None:
    """The registries are read then; what their entries compute with is not."""
    code = (
        "import sys, rotfem; rotfem.load_scene('tests/scenes/iccia_hub_beam.toml').check_run();"
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


def test_the_inertial_frame_takes_every_exact_theory(add: Add) -> None:
    add(Theory("other_exact", 9, {"planar_beam": strains}, exact=True))
    add(Theory("inexact", 10, {"planar_beam": strains}))
    scene(model={"theory": "other_exact", "frame": "inertial"})
    message = refusal(model={"theory": "inexact", "frame": "inertial"})
    assert "reissner or other_exact" in message


def effects_of(scene: Scene) -> tuple[str, ...]:
    """Return the names of the effects that are in the equations of a scene."""
    return rotfem.Problem.of(scene).effective_effects()


# --- effects --------------------------------------------------------------------------------------------------------


def test_an_effect_is_in_a_scene_that_has_data_for_it(add: Add) -> None:
    add(Effect("lift", present=lambda problem: problem.motion.is_spinning and problem.structure.length > 5))
    assert effects_of(scene()) == ("coriolis", "centrifugal", "lift")
    assert effects_of(scene(motion={"type": "constant", "speed": 0.0})) == ()
    assert effects_of(scene(model={"effects": ["coriolis"]})) == ("coriolis",)
    assert effects_of(scene(model={"effects": ["lift", "gravity"]})) == ("lift",)


def test_an_effect_of_rotation_is_none_of_the_inertial_frame(add: Add) -> None:
    add(Effect("drift", of_rotation=True))
    inertial = {"frame": "inertial"}
    assert "drift" in effects_of(scene())
    assert effects_of(scene(model=inertial)) == ()


# --- schemes --------------------------------------------------------------------------------------------------------


def test_the_fields_of_a_scheme_are_keys_of_its_table(add: Add) -> None:
    add(Damped)
    time = scene(time={"end": 1, "step": 0.1, "scheme": "damped", "decay": 0.5}).time
    assert time is not None
    assert time.parameters == {"decay": 0.5, "gamma": 0.75}
    assert registry.schemes[time.scheme](**time.parameters) == Damped(0.5, 0.75)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({}, 'time.decay: required key is missing; scheme = "damped" needs it'),
        ({"decay": 0.8}, "time.decay = 0.8: must be less than gamma"),
        ({"decay": "little"}, 'time.decay = "little": must be a number'),
        ({"decay": float("nan")}, "time.decay = nan: must be a finite number"),
        ({"decay": 0.5, "beta": 0.3}, 'time.beta = 0.3: has no meaning with scheme = "damped"'),
        ({"decay": 0.5, "decai": 0.3}, 'time.decai: unknown key; did you mean "decay"? allowed: end, step, '),
    ],
)
def test_bad_parameters_of_a_scheme(add: Add, changes: dict[str, Any], message: str) -> None:
    add(Damped)
    assert message in refusal(time={"end": 1, "step": 0.1, "scheme": "damped"} | changes)


def test_adaptive_steps_need_an_estimate_of_the_error(add: Add) -> None:
    add(Damped)
    add(Estimated)
    table = {"end": 1, "tolerance": 1e-3}
    adaptive = scene(time=table | {"scheme": "estimated"}).time
    assert adaptive is not None
    assert adaptive.parameters == {}
    message = refusal(time=table | {"scheme": "damped", "decay": 0.5})
    assert 'time.scheme = "damped": does not estimate its error' in message
    assert message.endswith('no tolerance (adaptive steps: "esdirk4", "estimated")')
    wanted = refusal(time={"end": 1, "scheme": "damped", "decay": 0.5}, accuracy=1e-3)
    assert wanted == message, "the tolerance is none that was given"


# --- section shapes -------------------------------------------------------------------------------------------------

ELLIPSE = Shape("ellipse", dimensions=("semi_axis_2", "semi_axis_3"), geometry=ellipse)
AXES = {"shape": "ellipse", "semi_axis_2": 0.2, "semi_axis_3": 0.1}


def test_a_shape_of_ones_own_in_both_sections(add: Add) -> None:
    add(ELLIPSE)
    planar: Any = scene(structure=beam(**AXES)).structure
    area, second = np.pi * 0.02, np.pi * 0.02 * 0.1**2 / 4
    values = planar.section.at([0.0, 2.0])
    for name, expected in {
        "EA": 210e9 * area, "GA": 0.9 * 84e9 * area, "EI": 210e9 * second,
        "mass_per_length": 7800 * area, "rotary_inertia": 7800 * second,
    }.items():  # fmt: skip
        np.testing.assert_allclose(values[name], [expected, expected])
    spatial: Any = scene(structure=beam("spatial_beam", **AXES, mass_center=[0.0, 0.0])).structure
    stiffness = np.diag(spatial.section.at(0.0)["stiffness"])
    torsion = 84e9 * np.pi * 0.02**3 / 0.05
    np.testing.assert_allclose(stiffness[3:], [torsion, 210e9 * second, 210e9 * 4 * second])


def test_a_shape_may_have_alternatives_and_a_check_of_its_own(add: Add) -> None:
    def box(nu: Array, side: Array, **wall: Array) -> Geometry:
        return square(nu, side * (1 - wall["ratio"]) if wall else side)

    def check(side: Array, **wall: Array) -> dict[str, str]:
        return {name: "must be less than 1 everywhere" for name, value in wall.items() if np.any(value >= 1)}

    add(Shape("box", ("side",), box, (("side", "ratio"),), check))
    half: Any = scene(structure=beam(shape="box", side=2, ratio=0.5)).structure
    whole: Any = scene(structure=beam(shape="box", side=1)).structure
    assert half.section.at(0.0)["EA"] == whole.section.at(0.0)["EA"] == 210e9
    message = refusal(structure=beam(shape="box", side=2, ratio=[[0, 0.5], [1, 1.5], [2, 0.5]]))
    assert "structure.section.ratio = " in message
    assert "must be less than 1 everywhere" in message


# --- outputs --------------------------------------------------------------------------------------------------------


def test_outputs_are_named_in_their_table(add: Add) -> None:
    assert scene().output.quantities == ()
    assert "output" not in scene().to_dict()
    assert '"lift" is not an output; allowed: a list of N, Q, M, ' in refusal(output={"quantities": ["lift"]})
    add(Output("root_moment", strains, "N·m"))
    asked = scene(output={"quantities": ["root_moment"]})
    assert asked.output.quantities == ("root_moment",)
    assert asked.to_dict()["output"]["quantities"] == ["root_moment"]
    assert Scene.from_dict(asked.to_dict()).output == asked.output
    message = refusal(output={"quantities": ["rot_moment"]})
    assert 'is not an output; did you mean "root_moment"? allowed: a list of root_moment' in message
    assert "allowed: a list of root_moment" in refusal(output={"quantities": "root_moment"})
    assert "unknown key" in refusal(output={"names": []})
