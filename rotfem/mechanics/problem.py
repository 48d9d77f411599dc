"""The problem: structure, theory, effects, motion and loads, between the scene and the equations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from rotfem.errors import InputError
from rotfem.mechanics.effects import INERTIA, INTERNAL, LOADS, Effect, Work
from rotfem.mechanics.loads import Load, Loads, is_moment
from rotfem.mechanics.motion import Motion
from rotfem.mechanics.theories import Theory
from rotfem.mechanics.unbalance import Unbalance, pushed, unbalances
from rotfem.registry import Registry, damping_models, resolved, structures
from rotfem.registry import outputs as registered
from rotfem.short import short_fields

Array = npt.NDArray[np.float64]

#: Relative component across an axis up to which a vector counts as along it.
ALONG = 1e-6

#: mechanics ↦ functional of the motion, a UFL form without arguments; see `rotfem.mechanics.work.Mechanics`.
Functional = str | Callable[..., Any]


@dataclass(frozen=True)
class Output:
    """One output functional; `[output] quantities` of a scene names those that are wanted.

    Attributes:
        name: what a scene calls it, and the column of history.csv.
        form: mechanics ↦ its value as a UFL form.
        unit: of its value.
    """

    registry: ClassVar[Registry[Output]] = registered

    name: str
    form: Functional
    unit: str = ""


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A structure with a theory, effects, a motion, and loads. Immutable; `replace` makes variants.

    Attributes:
        structure: what moves: its type, dimensions, section and damping (`PlanarBeam`, `SpatialBeam`, `Plate`).
        motion: how the frame turns and moves.
        mesh: elements, degree and integration.
        theory: strain measures, a `Theory`; may be given by its name in the registry.
        effects: names of the effects that may be in; None for all. Those without data are left out.
        loads: gravity and applied loads, as sums; may be given as [loads] of a scene (`rotfem.Loads` of a script).
        frame: "rotating"; "fixed", the frame of a round shaft that spins about its own axis; or "inertial" (translates
            with the hub, does not rotate). "auto" becomes "fixed" for such a shaft, else "rotating".
        terms: further terms of the residual by name, (mechanics, variation) ↦ UFL form, as of an `Effect`.
        outputs: functionals that are recorded, by name, mechanics ↦ UFL form, as of an `Output`.
        prestress: "axial" or "all", whose geometric stiffness the prestressed linear theories have; None for what is
            usual for the structure: that of forces and moments of a spatial beam, else of axial and membrane forces.
        inactive: names of the components that are zero at all times and no unknowns (`inactive_unknowns`).
    """

    structure: Any
    motion: Motion
    mesh: Any
    theory: Any = "reissner"
    effects: tuple[str, ...] | None = None
    loads: Loads = field(default_factory=Loads)
    frame: str = "auto"
    terms: Mapping[str, Work] = field(default_factory=dict)
    outputs: Mapping[str, Functional] = field(default_factory=dict)
    prestress: str | None = None
    inactive: tuple[str, ...] = ()
    __repr__ = short_fields

    def __post_init__(self) -> None:
        given: Any = self.loads
        if not isinstance(given, Loads):
            made = Loads.of(given, self.structure, self.motion.angle).pitched(self.motion.pitch)
            object.__setattr__(self, "loads", made)
        if isinstance(self.theory, str):
            if self.theory not in Theory.registry:
                raise InputError("model.theory", self.theory, f"allowed: {', '.join(Theory.registry.names)}")
            object.__setattr__(self, "theory", Theory.registry[self.theory])
        for name in ("terms", "outputs"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))
        object.__setattr__(self, "mesh", self.mesh.suited(self.structure))
        if not self.theory.holds_for(self.structure.type):
            why = f"has strains for {', '.join(self.theory.strains)}, none for a {self.structure.type}"
            raise InputError("model.theory", self.theory.name, why)
        if self.frame == "auto":
            object.__setattr__(self, "frame", "fixed" if self.is_shaft else "rotating")
        if self.frame not in ("rotating", "inertial", "fixed"):
            raise InputError("model.frame", self.frame, "allowed: auto, rotating, inertial, fixed")
        if self.frame == "rotating":
            self._check_supports()
        if self.frame == "fixed" and not self.is_shaft:
            why = "needs a straight, round spatial_beam that spins about its own axis"
            raise InputError("model.frame", self.frame, why)
        is_planar = getattr(self.structure, "is_planar", False)  # a structure of a user's own need not say it
        flat_and_exact = is_planar and self.theory.exact and self.motion.hub is None
        if self.frame == "inertial" and not flat_and_exact:
            exact = " or ".join(theory.name for theory in Theory.registry if theory.exact)
            why = f"needs a planar_beam, a theory that holds for any displacement ({exact}), and a prescribed rotation"
            raise InputError("model.frame", self.frame, why)
        if self.frame == "inertial" and (self.structure.damping.mass_rate or self.structure.damping.has_modal):
            why = "by mass would brake the revolution itself in the inertial frame, and modes at rest turn there"
            raise InputError("structure.damping", None, f'{why}; use model.frame = "rotating"')
        if self.motion.hub is not None and getattr(self.structure, "pitches", False):
            raise InputError("structure.root.pitch", None, "over time needs a speed that is prescribed, no torque")
        if self.prestress not in (None, "axial", "all"):
            raise InputError("model.prestress", self.prestress, "allowed: axial, all")
        for name in self.terms:
            if name in (*Effect.registry.names, INTERNAL.name, INERTIA.name, LOADS.name):
                raise InputError("terms", name, "is the name of an effect already; a term needs one of its own")
        for name in self.effects or ():
            if name not in Effect.registry:
                raise InputError("model.effects", name, f"is no effect; allowed: {', '.join(Effect.registry.names)}")

    def replace(self, **changes: Any) -> Self:
        """Return a variant with other values of some attributes."""
        return replace(self, **changes)

    @property
    def unbalances(self) -> tuple[Unbalance, ...]:
        """The unbalances of a shaft that are no part of its mass in the frame of the problem."""
        if abs(self.motion.axis[0]) != 1.0 or not getattr(self.structure, "is_straight", False):
            return ()
        found = unbalances(self.structure, self.loads.unbalance)
        return found if self.frame == "fixed" else found[len(found) - len(self.loads.unbalance) :]

    def turning(self) -> Self:
        """Return the problem in the rotating frame where it is in the inertial one, else as it is."""
        return self.replace(frame="rotating") if self.frame == "inertial" else self

    def pushed(self, motion: Motion) -> Self:
        """Return the problem of a history, in which unbalances push as they turn with a motion."""
        found = self.unbalances
        return self.replace(loads=pushed(self.loads, found, motion, self.frame != "fixed")) if found else self

    def _check_supports(self) -> None:
        """Refuse bearings that differ by direction where the shaft does, too: periodic coefficients in any frame."""
        standing = [s for s in getattr(self.structure, "supports", ()) if s.frame != "rotating"]
        if abs(self.motion.axis[0]) == 1.0 and self.motion.is_spinning and not all(s.isotropic for s in standing):
            why = "differ by direction, and so does the shaft: periodic coefficients in every frame are not solved"
            raise InputError("structure.supports", None, why)

    @property
    def is_shaft(self) -> bool:
        """Whether the structure is a round shaft, which spins about its own axis."""
        return bool(abs(self.motion.axis[0]) == 1.0 and getattr(self.structure, "is_round", False))

    def effective_effects(self) -> tuple[str, ...]:
        """Return the names of the effects that are in the equations: wanted, and with data."""
        there = (e for e in Effect.registry if self.frame != "inertial" or not e.of_rotation)
        names = (e.name for e in there if e.present(self))
        return tuple(name for name in names if self.effects is None or name in self.effects)

    @property
    def gravity_turns(self) -> bool:
        """Whether gravity has a component across the spin axis, which turns in the rotating frame."""
        if self.frame == "fixed":
            return False
        g = np.array(self.loads.gravity)
        across = np.linalg.norm(np.cross(g, self.motion.axis)) > ALONG * np.linalg.norm(g)
        return bool(across and self.motion.is_spinning and "gravity" in self.effective_effects())

    def spinning(self) -> Self:
        """Return the problem of a structure that spins at a speed to be given, as in a sweep over speeds."""
        return self.replace(motion=replace(self.motion, is_spinning=True))


# --- unknowns that stay zero by symmetry ------------------------------------------------------------------------------

# A reflection S at a plane takes motions of a structure that is symmetric about it to motions,
#
#     F(S q, S v, S a) = S F(q, v, a)    where    S f = f    for loads, spin and base acceleration.
#
# So a motion that starts with q = S q keeps it: the components that S turns round, displacements across the plane and
# rotations about axes in it, stay zero in every theory. A plate is symmetric about its middle surface. Without spin,
# under dead forces across it, for which S f = −f, a linear theory has S q = −q: displacements in its plane stay zero.
#
# Whether this holds is read from the data: a plane that a structure is symmetric about is one of its `planes` and
# passes its `is_symmetric`. What a script registers or adds may be of any shape, so with it all unknowns stay.


def inactive_unknowns(problem: Problem) -> tuple[str, ...]:
    """Return the unknowns that stay zero in a history that starts undeformed or in balance, as far as known."""
    structure: Any = resolved(structures[problem.structure.type].discretised)
    if not _is_built_in(problem) or problem.frame == "inertial" or problem.motion.pitch is not None:
        return ()
    if problem.structure.damping.has_modal:  # the modes at rest that have the ratios are those of all unknowns
        return ()
    polar, axial = directions(problem)
    for normal, within in structure.planes.items():
        if not structure.is_symmetric(problem.structure, normal):
            continue
        across = np.arange(3) == normal
        if not np.any(polar & across) and not np.any(axial & ~across):
            return tuple(name for i, name in enumerate(structure.components) if i not in within)
        if structure.is_flat and _bends_only(problem) and not np.any(polar & ~across) and not np.any(axial & across):
            return tuple(structure.components[i] for i in within)
    return ()


def _is_built_in(problem: Problem) -> bool:
    """Return whether all that the equations are made of is the program's own, which keeps every symmetry."""
    theory, structure = problem.theory, problem.structure
    works = [Effect.registry[name].work for name in problem.effective_effects()]
    works += [damping_models[name].work for name in structure.damping.models]
    named_in = (*works, structures[structure.type].discretised, *theory.strains.values(), *theory.prestress.values())
    ours = all(work is None or (isinstance(work, str) and work.startswith("rotfem.")) for work in named_in)
    return ours and not problem.terms and not problem.outputs


def _bends_only(problem: Problem) -> bool:
    """Return whether nothing but forces across a plate could stretch it: no spin, no second order, no follower."""
    at_rest = not (problem.motion.is_spinning or problem.motion.hub is not None)
    dead = all(load.is_zero or load.kind == "dead" for load in problem.loads.named.values())
    return problem.theory.linear and problem.prestress != "all" and at_rest and dead


def directions(problem: Problem) -> tuple[Array, Array]:
    """Return in which directions (3,) polar and axial vectors may drive a problem at any time, frame components."""
    motion, loads = problem.motion, problem.loads
    moved = motion.is_spinning or motion.hub is not None
    polar = (_of_load(motion.base) != 0.0) | (np.array((*loads.gravity, 0.0, 0.0)[:3]) != 0.0)
    axial = (np.asarray(motion.axis) != 0.0) & moved
    for name, load in loads.named.items():
        which = _of_load(load) != 0.0
        polar, axial = (polar, axial | which) if is_moment(name) else (polar | which, axial)
    return polar, axial


def _of_load(load: Load | None) -> Array:
    """Return the largest size of each component of a load over all times, shape (3,); infinite where it is unknown."""
    values = np.zeros(3) if load is None or load.is_zero else load.sizes()
    if values is None:
        return np.full(3, np.inf)
    if len(values) == 1:  # about axis 3, or along it
        return np.array([0.0, 0.0, values[0]])
    return np.concatenate([values, np.zeros(3 - len(values))])
