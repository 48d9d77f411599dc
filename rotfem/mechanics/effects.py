"""Effects: the terms of the equations that can be switched on and off.

An effect has virtual work for any variation: that of the unknowns gives the equations of motion, a rigid turn about the
axis the row of a free hub. Effects without work of their own add bodies, on which all others act, add to strains, or
couple the hub. UFL is not imported here: the work of an effect is imported when a form needs it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from rotfem.mechanics.pitch import is_beside
from rotfem.registry import Registry, damping_models, register, resolved
from rotfem.registry import effects as registered

#: (mechanics, variation) ↦ term of the residual, a UFL form (0 if there is none); see `rotfem.mechanics.work`.
Work = str | Callable[..., Any]

#: mechanics ↦ potential energy, a UFL form.
Potential = str | Callable[..., Any]


@dataclass(frozen=True)
class Effect:
    """One effect.

    Attributes:
        name: what a scene calls it.
        work: (mechanics, variation) ↦ its term of the residual F = 0 for a variation of the motion: + ∫ ρ a·δx of an
            acceleration, − ∫ f·δx of a force. None if the effect only adds bodies, adds to strains, or couples
            the hub.
        present: problem ↦ whether it has data; `model.effects = "auto"` takes all that have.
        reasons: why it is in a model, and why not, in a few words.
        constants: names of the constants ("w", "dw", "a_o", "gravity" of the frame, "loads" for those of all
            loads) that its work is a product of; () if it has none of them, None if it may be any polynomial of second
            degree in them.
        of_rotation: whether it is by the rotation of the frame, and absent in a frame that does not rotate.
        internal: whether its forces act between structure and frame, so that they do no work in a rigid turn.
        momentum: whether its work in a rigid turn is a change of angular momentum; the moments of all others are the
            impulse that hub and structure are given.
        at_root: whether its forces act between the hub and the root only.
        kinetic: its part of the kinetic energy, "T1" or "T0".
        potential: mechanics ↦ its potential energy (J), a UFL form; None if it has none.
    """

    registry: ClassVar[Registry[Effect]] = registered

    name: str
    work: Work | None = None
    present: Callable[[Any], bool] = lambda problem: True
    reasons: tuple[str, str] = ("it is registered", "there are no data for it")
    constants: tuple[str, ...] | None = None
    of_rotation: bool = False
    internal: bool = False
    momentum: bool = False
    at_root: bool = False
    kinetic: str = ""
    potential: Potential | None = None

    def term(self, mechanics: Any, variation: Any) -> Any:
        """Return its term of the residual for a variation; 0 if it has none."""
        if self.work is None or (self.internal and not variation.within_frame):
            return 0
        return resolved(self.work)(mechanics, variation)


@dataclass(frozen=True)
class DampingModel:
    """A damping of the structure itself; a scene gives its coefficient as a key of [structure.damping].

    Attributes:
        name: the key.
        work: (mechanics, variation, coefficient) ↦ its term of the residual, + the work of the damping forces. They act
            between parts of the structure and depend on rates relative to the frame; the coefficient is a constant.
        what: description, with the unit of its coefficient.
    """

    registry: ClassVar[Registry[DampingModel]] = damping_models

    name: str
    work: Work
    what: str = ""


def _work(name: str) -> str:
    return f"rotfem.mechanics.work:{name}"


def hinges_of(problem: Any) -> list[Any]:
    """Return the hinges at the root of a problem's structure."""
    return list(getattr(problem.structure, "hinges", {}).values())


def supports_of(problem: Any) -> Any:
    """Return the supports of a problem's structure."""
    return getattr(problem.structure, "supports", ())


def couplings_of(problem: Any) -> Any:
    """Return the couplings of a problem's structure."""
    return getattr(problem.structure, "couplings", ())


def pitches(problem: Any) -> bool:
    """Return whether the frame of a problem turns with a pitch over time too."""
    return getattr(problem.structure, "pitches", False) or getattr(problem.motion, "pitch", None) is not None


def turns(problem: Any) -> bool:
    """Return whether the frame turns."""
    return problem.motion.is_spinning or pitches(problem)


def moves_origin(problem: Any) -> bool:
    """Return whether a pitch over time moves the origin of the frame, which is not on its axis."""
    return pitches(problem) and is_beside(problem.structure.root_position, problem.structure.root_axis)


# What every model has.
INTERNAL = Effect("internal", _work("internal"), constants=(), internal=True)
INERTIA = Effect("inertia", _work("inertia"), constants=(), momentum=True)
LOADS = Effect("loads", _work("loads"), constants=("loads",), potential=_work("potential_of_loads"))

_SPINS = ("the structure spins", "nothing spins")
_OF_ROTATION: dict[str, Any] = {"of_rotation": True, "momentum": True}
_AT_ROOT: dict[str, Any] = {"constants": (), "internal": True, "at_root": True}

for _effect in (
    Effect("coriolis", _work("coriolis"), turns, _SPINS, ("w",), kinetic="T1", **_OF_ROTATION),
    Effect("centrifugal", _work("centrifugal"), turns, _SPINS, ("w", "w"), kinetic="T0", **_OF_ROTATION),
    Effect(
        "euler",
        _work("euler"),
        lambda problem: problem.motion.changes_speed or pitches(problem),
        ("the speed or the pitch changes", "the speed is constant"),
        ("dw",),
        **_OF_ROTATION,
    ),
    Effect(
        "rotary_inertia",
        present=lambda problem: problem.structure.has_rotary_inertia,
        reasons=("the section has rotary inertia", "the section has no rotary inertia"),
    ),
    Effect(
        "base",
        _work("base"),
        lambda problem: problem.motion.is_accelerated or moves_origin(problem),
        ("the origin is accelerated", "no base_acceleration"),
        ("a_o",),
        potential=_work("potential_of_base"),
    ),
    Effect(
        "gravity",
        _work("gravity"),
        lambda problem: any(problem.loads.gravity),
        ("loads.gravity is not zero", "no gravity"),
        ("gravity",),
        potential=_work("potential_of_gravity"),
    ),
    Effect(
        "damping",
        _work("damping"),
        lambda problem: not problem.structure.damping.is_zero,
        ("there is a damping coefficient", "no damping"),
        (),
        internal=True,
    ),
    Effect(
        "root_springs",
        _work("root_springs"),
        lambda problem: bool(hinges_of(problem)),
        ("the root has hinges or springs", "the root is rigid"),
        potential=_work("potential_of_root_springs"),
        **_AT_ROOT,
    ),
    Effect(
        "root_dampers",
        _work("root_dampers"),
        lambda problem: any(hinge.damping > 0.0 for hinge in hinges_of(problem)),
        ("the root has dampers", "the root has no dampers"),
        **_AT_ROOT,
    ),
    Effect(
        "supports",
        _work("supports"),
        lambda problem: bool(supports_of(problem)),
        ("a shaft has supports", "no supports"),
        ("supports",),
        potential=_work("potential_of_supports"),
    ),
    Effect(
        "support_dampers",
        _work("support_dampers"),
        lambda problem: any(s.feeds for s in supports_of(problem)),
        ("supports have dampers or cross-coupling", "supports have no dampers"),
        ("supports",),
    ),
    Effect(
        "couplings",
        _work("couplings"),
        lambda problem: bool(couplings_of(problem)),
        ("the beam has couplings", "no couplings"),
        ("supports",),
        internal=True,
        potential=_work("potential_of_couplings"),
    ),
    Effect(
        "coupling_dampers",
        _work("coupling_dampers"),
        lambda problem: any(c.feeds for c in couplings_of(problem)),
        ("couplings have dampers", "couplings have no dampers"),
        ("supports",),
        internal=True,
    ),
    Effect(
        "trapeze",
        present=lambda problem: getattr(problem.structure, "has_fibers", False),
        reasons=("twist stretches the fibers away from its axis", "no section twists"),
    ),
    Effect(
        "tip_mass",
        present=lambda problem: problem.structure.has_tip_mass,
        reasons=("there is a tip mass", "no tip mass"),
    ),
    Effect(
        "hub_coupling",
        present=lambda problem: problem.motion.hub is not None and problem.motion.hub.coupled,
        reasons=("the hub is free and coupled", "the structure does not act on the hub"),
    ),
):
    register(_effect)
