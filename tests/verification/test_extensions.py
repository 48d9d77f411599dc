"""What a user adds from one file, by `register`: each holds to a theorem or a closed form, and nothing else changes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib.util import module_from_spec, spec_from_file_location
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import ufl

import rotfem
from rotfem import registry
from rotfem.errors import SceneError
from tests.beams import STRUCTURE

FILES = Path(__file__).resolve().parents[2] / "demos" / "extensions"
KINDS = (registry.theories, registry.effects, registry.schemes, registry.shapes, registry.outputs)

#: The beam of Kane, Ryan & Banerjee 1987 as Simo & Vu-Quoc 1986 have it.
KRB = STRUCTURE["section"]


@pytest.fixture
def extension() -> Iterator[Callable[[str], ModuleType]]:
    """Return what loads a file of demos/extensions; what it registers goes when the test ends."""
    before = [kind.names for kind in KINDS]

    def load(name: str) -> ModuleType:
        spec = spec_from_file_location(name, FILES / f"{name}.py")
        assert spec is not None
        assert spec.loader is not None
        module = module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    yield load
    for kind, names in zip(KINDS, before, strict=True):
        for name in set(kind.names) - set(names):
            kind.remove(name)


def beam(changes: dict[str, Any] | None = None) -> rotfem.Scene:
    """Return the beam in a spin-up, on a mesh coarse enough for tests."""
    tables: dict[str, Any] = {
        "structure": {"type": "planar_beam", "length": 10.0, "section": KRB},
        "motion": {"type": "spin_up", "speed": 0.4, "duration": 2.0},
        "mesh": {"elements": 4},
        "time": {"end": 2.0, "step": 0.02},
    }
    return rotfem.Scene.from_dict(tables).replace(changes or {})


def free_hub(changes: dict[str, Any] | None = None) -> rotfem.Scene:
    """Return the beam on a free hub under a smooth torque."""
    torque = [[0.05 * i, 400.0 * np.sin(np.pi * i / 20) ** 2] for i in range(21)]
    motion = {"type": "torque", "hub_inertia": 200.0, "table": torque}
    return beam({"motion": motion, "time": {"end": 1.0, "step": 0.01}} | (changes or {}))


# --- a theory ---------------------------------------------------------------------------------------------------------


def test_theory(extension: Callable[[str], ModuleType]) -> None:
    """½ u₂'² against the stretch: they differ by u₁' u₂'² and higher, so by the square of the deflection over L."""
    extension("half_square_theory")
    other, own = (rotfem.run(beam({"model.theory": name})).history["tip_u2"] for name in ("von_karman", "half_square"))
    size = np.max(np.abs(other))
    assert 0.01 < size / 10.0 < 0.1
    assert 0.0 < np.max(np.abs(own - other)) <= (size / 10.0) ** 2 * size


# --- an effect --------------------------------------------------------------------------------------------------------


def test_effect_on_a_free_hub(extension: Callable[[str], ModuleType]) -> None:
    """Impulse = momentum with drag, by the trapezoidal rule in both: the error is of the second order of the step."""
    extension("linear_drag")
    theory, errors = "reissner", []
    for step in (0.01, 0.005):
        done = rotfem.run(free_hub({"model.theory": theory, "time.step": step}))
        assert "drag" in done.summary["effects"]
        h = done.history
        errors.append(np.max(np.abs(h["angular_momentum"] - h["impulse"])) / np.max(np.abs(h["impulse"])))
    without = rotfem.run(free_hub({"model.theory": theory, "model.effects": ["coriolis", "centrifugal", "euler"]}))
    torque = np.trapezoid(h["torque"], h["t"])
    assert h["impulse"][-1] < 0.99 * torque  # the drag takes more than a hundredth of it
    assert without.history["psi_dot"][-1] > 1.01 * h["psi_dot"][-1]
    assert errors[1] <= 2e-5
    assert errors[1] < 0.3 * errors[0]


def test_effect_damps_modes_and_is_explained(extension: Callable[[str], ModuleType]) -> None:
    """At rest the first mode of ρ ẍ + c ẋ + … has λ = −c/2ρ + iω."""
    drag = extension("linear_drag").DRAG
    still = beam({"motion": {"type": "constant", "speed": 0.0}, "time": None, "structure.section.rotary_inertia": 0.0})
    for theory in ("reissner", "consistent_linear"):
        row = rotfem.modes(still.replace({"model.theory": theory})).rows[0]
        assert row["growth"] == pytest.approx(-drag / 2 / 1.2, rel=1e-9)
    rows = rotfem.explain(still).rows
    assert next(row for row in rows if row["name"] == "drag")["why"].startswith("there is air")


# --- schemes ----------------------------------------------------------------------------------------------------------


def values(make: Callable[..., rotfem.Scene], scheme: str, column: str, steps: tuple[float, ...]) -> list[float]:
    """Return the last value of a column for every step."""
    scenes = (make({"time.step": step, "time.scheme": scheme}) for step in steps)
    return [float(rotfem.run(scene).history[column][-1]) for scene in scenes]


@pytest.mark.parametrize(("kind", "column"), [("inertial", "tip_u2"), ("free hub", "psi_dot")])
def test_schemes_of_second_order(extension: Callable[[str], ModuleType], kind: str, column: str) -> None:
    frame = {"model.frame": "inertial"} if kind == "inertial" else {}
    base = free_hub if kind == "free hub" else beam
    steps = (0.01, 0.005, 0.0025) if kind == "free hub" else (0.02, 0.01, 0.005)

    def make(changes: dict[str, Any]) -> rotfem.Scene:
        return base({"mesh.elements": 2, **frame, **changes})

    coarse, fine = values(make, "newmark", column, steps[1:])
    for scheme in ("bdf2", "sdirk2"):
        extension(scheme)
        a, b, c = values(make, scheme, column, steps)
        assert np.log2(abs((b - a) / (c - b))) == pytest.approx(2.0, abs=0.2), scheme
        assert c + (c - b) / 3 == pytest.approx(fine + (fine - coarse) / 3, rel=2e-4), scheme


def test_a_scheme_of_fifth_order_with_coupled_stages(extension: Callable[[str], ModuleType]) -> None:
    """Of a section so soft in every way that these steps resolve all motions, on a free hub under a smooth torque."""
    extension("radau5")
    soft = {"EA": 20.0, "GA": 20.0, "EI": 1.0, "mass_per_length": 1.0, "rotary_inertia": 0.5}
    torque = {"type": "torque", "hub_inertia": 1.0, "table": [[0.0, 0.0], [1.0, 0.5], [2.0, -0.5]]}
    tables: dict[str, Any] = {
        "structure": {"type": "planar_beam", "length": 1.0, "section": soft},
        "motion": torque,
        "mesh": {"elements": 1, "degree": 2},
        "solver": {"increment_tolerance": 1e-11},
    }
    last = []
    for number in (20, 40, 80, 160):
        time = {"end": 2.0, "step": 2.0 / number, "output_every": number // 20, "scheme": "radau5"}
        last.append(rotfem.run({**tables, "time": time}).history["tip_u2"])
    change = [np.max(np.abs(b - a)) for a, b in pairwise(last)]
    assert np.log2(change[-2] / change[-1]) > 4.6


# --- a section --------------------------------------------------------------------------------------------------------


def test_section(extension: Callable[[str], ModuleType]) -> None:
    """An ellipse of equal axes is the circle; another one has the first bending frequencies of its two axes."""
    extension("ellipse")
    material = {"E": 7e10, "nu": 0.3, "rho": 2700.0}

    def frequencies(structure: str, section: dict[str, Any]) -> Any:
        tables = {
            "structure": {"type": structure, "length": 2.0, "section": {**material, **section}},
            "motion": {"type": "constant", "speed": 0.0},
            "model": {"theory": "consistent_linear"},
            "modes": {"count": 2},
        }
        return rotfem.modes(tables).frequencies

    circle = frequencies("planar_beam", {"shape": "circle", "radius": 0.02})
    ellipse = {"shape": "ellipse", "semi_axis_2": 0.02, "semi_axis_3": 0.02}
    np.testing.assert_allclose(frequencies("planar_beam", ellipse), circle, rtol=1e-8)
    lag, flap = frequencies("spatial_beam", {**ellipse, "semi_axis_2": 0.015, "semi_axis_3": 0.03})
    assert flap / lag == pytest.approx(2.0, rel=2e-3)  # √(I₂/I₃) but for shear and rotary inertia


# --- an output --------------------------------------------------------------------------------------------------------


def test_output(extension: Callable[[str], ModuleType]) -> None:
    """EI α' at the clamp under a tip force across: F L in the first-order theory, F (L + u₁) in the exact one."""
    extension("root_moment")
    loads = {"loads.tip_force": [0.0, 100.0], "motion": {"type": "constant", "speed": 0.0}, "time": None}
    for theory in ("linear", "reissner"):
        scene = beam({**loads, "model.theory": theory, "output.quantities": ["root_moment"], "mesh.elements": 16})
        h = rotfem.run(scene).history
        arm = 10.0 + (h["tip_u1"][0] if theory == "reissner" else 0.0)
        assert h["root_moment"][0] == pytest.approx(100.0 * arm, rel=1e-6)


def test_outputs_and_terms_of_a_call(extension: Callable[[str], ModuleType]) -> None:
    """The same from a script, without a name in the scene."""
    form, work = extension("root_moment").form, extension("linear_drag").work
    registry.effects.remove("drag")
    scene = beam({"time.end": 0.4})
    done = rotfem.run(scene, terms={"air": work}, outputs={"root_M": form})
    assert list(done.history)[-1] == "root_M"
    still = rotfem.run(scene, outputs={"root_M": form})
    assert "air" not in done.summary["effects"]
    assert np.max(np.abs(done.history["root_M"] - still.history["root_M"])) > 1e-6


@pytest.mark.parametrize("name", ["tip_u1", "M"])
def test_output_needs_a_name_of_its_own(extension: Callable[[str], ModuleType], name: str) -> None:
    """Neither a call nor a registered output replaces a column of the history or of the stations."""
    form = extension("root_moment").form
    scene = beam({"time.end": 0.02, "output.stations": 3})
    with pytest.raises(SceneError, match=f'output.quantities = "{name}": is the name of a column already'):
        rotfem.run(scene, outputs={name: form})
    rotfem.register(rotfem.Output(name, form))
    with pytest.raises(SceneError, match="is the name of a column already"):
        rotfem.run(scene.replace({"output.quantities": [name]}))


@pytest.mark.parametrize(
    ("motion", "theory"),
    [
        ({"type": "constant", "speed": 0.0}, "consistent_linear"),
        ({"type": "spin_up", "speed": 3.0, "duration": 1.0}, "reissner"),
    ],
)
def test_a_term_without_a_derivative_at_rest_is_refused(motion: dict[str, Any], theory: str) -> None:
    """|v| has none where v = 0: without a spin UFL divides by zero, at the start of one the numbers are not finite."""

    def quadratic(m: Any, delta: Any) -> Any:
        v = [(m.velocity(body), body) for body in m.positions()]
        return sum(0.05 * ufl.sqrt(ufl.inner(x, x)) * ufl.inner(x, delta.of(body)) * body.measure for x, body in v)

    with pytest.raises(SceneError, match='terms = "air": has no derivative to the velocities at rest'):
        rotfem.run(beam({"motion": motion, "model.theory": theory}), terms={"air": quadratic})


@pytest.mark.estimated
@pytest.mark.parametrize("constants", [None, ("w",)])
def test_linear_theories_refuse_what_is_no_polynomial_of_the_speed(constants: tuple[str, ...] | None) -> None:
    """Quadratic drag c |v| v: |w| w is odd as w, and 1 at 1 as w and w²; linear drag with a wrong declaration."""

    def quadratic(m: Any, delta: Any) -> Any:
        v = [m.velocity(body) for body in m.positions()]
        size = [ufl.sqrt(ufl.inner(x, x) + 1e-12) for x in v]
        bodies = zip(v, size, m.positions(), strict=True)
        return sum(0.05 * s * ufl.inner(x, delta.of(body)) * body.measure for x, s, body in bodies)

    rotfem.register(rotfem.Effect("drag", quadratic, constants=constants))
    try:
        for theory in ("linear", "consistent_linear"):
            with pytest.raises(SceneError, match='model.effects = "drag": is no polynomial'):
                rotfem.run(beam({"model.theory": theory}))
        answered = rotfem.run(beam({"accuracy": 1e-2, "time.end": 0.2, "time.step": None}))
        assert answered.summary["theory"] == "reissner"
    finally:
        registry.effects.remove("drag")
    with pytest.raises(SceneError, match='terms = "air": is no polynomial'):
        rotfem.modes(beam({"model.theory": "linear"}), terms={"air": quadratic})
