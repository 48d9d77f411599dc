"""Unknowns that stay zero by symmetry, decided before anything is compiled.

A reflection S at a plane takes motions of a structure that is symmetric about it to motions,

    F(S q, S v, S a) = S F(q, v, a)    where    S f = f    for loads, spin and base acceleration.

So a motion that starts with q = S q keeps it: the components that S turns round, displacements across the plane and
rotations about axes in it, stay zero in every theory. A plate is symmetric about its middle surface. Without spin,
under dead forces across it, for which S f = −f, a linear theory has S q = −q: displacements in its plane stay zero.

Whether this holds is read from the data: a plane that a structure is symmetric about is one of its `planes` and passes
its `is_symmetric`. What a script registers or adds may be of any shape, so with it all unknowns stay.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.mechanics.effects import Effect
from rotfem.mechanics.loads import Load, is_moment
from rotfem.mechanics.problem import Problem
from rotfem.registry import damping_models, resolved, structures

Array = npt.NDArray[np.float64]


def inactive_unknowns(problem: Problem) -> tuple[str, ...]:
    """Return the names of the unknowns that stay zero at all times of a history; empty where none is known to.

    The history starts undeformed, or in balance with what acts at t = 0.
    """
    structure: Any = resolved(structures[problem.structure.type].discretised)
    if not _is_built_in(problem) or problem.frame != "rotating" or problem.motion.pitch is not None:
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
    polar = (_of_base(motion) != 0.0) | (np.array((*loads.gravity, 0.0, 0.0)[:3]) != 0.0)
    axial = (np.asarray(motion.axis) != 0.0) & moved
    for name, load in loads.named.items():
        which = _of_load(load) != 0.0
        polar, axial = (polar, axial | which) if is_moment(name) else (polar | which, axial)
    return polar, axial


def _of_load(load: Load) -> Array:
    """Return the largest size of each component of a load over all times, shape (3,); infinite where it is unknown."""
    values = np.zeros(3) if load.is_zero else load.sizes()
    if values is None:
        return np.full(3, np.inf)
    if len(values) == 1:  # about axis 3, or along it
        return np.array([0.0, 0.0, values[0]])
    return np.concatenate([values, np.zeros(3 - len(values))])


def _of_base(motion: Any) -> Array:
    """Return the same of the base acceleration, which is linear between its knots."""
    if not motion.is_accelerated:
        return np.zeros(3)
    times = (0.0,) if motion.constant else motion.base_knots
    if times is None:
        return np.full(3, np.inf)
    return np.asarray(np.abs([motion.base_acceleration(t) for t in (0.0, *times)]).max(axis=0))
