"""Unknowns that are zero at all times, because nothing moves them: they are left out of a history.

Two kinds are looked for. A structure, its loads and its spin may be symmetric to a plane: motions in it never leave it,
in any theory. And in a linear theory bending under loads across a structure that does not spin goes without stretching.
Which components these are the structure says (`Structure.planes`, `Structure.across`); what drives it is looked at
here, and the rest, whether the structure itself is symmetric, is told by its equations (`rotfem.equations.beside`).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.analysis.constant_conditions import are_constant
from rotfem.equations.beside import Beside
from rotfem.equations.compiled import compile_system
from rotfem.mechanics.loads import Load, is_moment, named
from rotfem.mechanics.problem import Problem
from rotfem.structures import STRUCTURES

Array = npt.NDArray[np.float64]


#: Steps times unknowns from which looking for what can be left out takes less time than it saves; under constant
#: conditions, whose equilibrium has its stability in all directions said, the forms of all are made too.
WORTH, WORTH_CONSTANT = 5e4, 3e5

#: Steps that a history of adaptive steps is taken to have.
ADAPTIVE = 1000


def worth_a_look(problem: Problem, time: Any) -> bool:
    """Return whether a history is so long that leaving unknowns out may save time, by its [time]."""
    if getattr(problem.structure, "mesh", None) is not None:  # cells are in a file
        return True
    cells = np.array(problem.mesh.elements, dtype=float)
    nodes = float(np.prod(cells * (problem.mesh.degree or 2)))
    structure: Any = STRUCTURES[problem.structure.type]
    unknowns = nodes * len(structure.components)
    steps = time.end / time.step if time.step else ADAPTIVE
    return unknowns * steps >= (WORTH_CONSTANT if are_constant(problem) else WORTH)


def without(problem: Problem, names: tuple[str, ...], comm: MPI.Comm) -> tuple[Problem, Any]:
    """Return the problem without unknowns that are known to stay zero, and the equations of these; None of none."""
    if not names:
        return problem, None
    reduced = problem.replace(left_out=names)
    return reduced, Beside(reduced, comm)


def with_all(system: Any) -> Any:
    """Return a system, or under constant conditions, whose equilibrium is looked at, that of all unknowns."""
    problem = system.model.problem
    if not (problem.left_out and are_constant(problem)):
        return system
    return compile_system(problem.replace(left_out=()), system.comm, moving=False)


def leave_out(problem: Problem, comm: MPI.Comm = MPI.COMM_WORLD, released: bool = False) -> tuple[Problem, Any]:
    """Return (the problem of a history without unknowns that stay zero, the equations of these; None of none).

    Args:
        problem: what is to be computed.
        comm: MPI communicator.
        released: whether it starts from a static shape, bent in direction 2.
    """
    structure: Any = STRUCTURES[problem.structure.type]
    # Ratios by mode are counted among the modes of all unknowns.
    if problem.terms or problem.frame != "rotating" or problem.structure.damping.has_modal:
        return problem, None
    if problem.motion.pitch is not None:  # which turns about an axis that is in every plane of symmetry
        return problem, None
    driven = Driven(problem)
    for kept, constants in driven.candidates(structure):
        if released and 1 not in kept:
            continue
        names = tuple(name for i, name in enumerate(structure.components) if i not in kept)
        reduced = problem.replace(left_out=names)
        try:
            beside = Beside(reduced, comm)
            beside.model.outputs()
        except ValueError:  # what a script has registered asks for the derivative of what is left out
            continue
        if beside.stays_zero(constants):
            return reduced, beside
    return problem, None


class Driven:
    """Directions in which a problem is driven over all times.

    Args:
        problem: what is to be computed.

    Attributes:
        known: whether all of them are known.
        polar: name ↦ directions of forces and accelerations, 1 where there are any.
        axial: the same of moments and of the axis of the spin.
    """

    def __init__(self, problem: Problem):
        motion, loads = problem.motion, problem.loads
        self.problem, self.linear = problem, problem.theory.linear
        self.moved = motion.is_spinning or motion.hub is not None
        values: dict[str, Array | None] = {}
        turning: dict[str, Array | None] = {}
        for name, load in named(loads).items():
            (turning if is_moment(name) else values)[name] = of_load(load)
        values |= {"a_o": of_base(motion), "gravity": _padded(np.abs(np.array(loads.gravity, dtype=float)))}
        turning |= dict.fromkeys(("w", "dw"), np.abs(motion.axis) if self.moved else np.zeros(3))
        self.known = all(value is not None for value in (*values.values(), *turning.values()))
        self.polar = {n: np.sign(v) for n, v in values.items() if v is not None}
        self.axial = {n: np.sign(v) for n, v in turning.items() if v is not None}

    def candidates(self, structure: Any) -> Iterator[tuple[tuple[int, ...], dict[str, Array]]]:
        """Yield (components that may be the only ones to move, what drives them as the constants have it)."""
        if not self.known:
            return
        for normal, kept in structure.planes.items():
            normals, others = np.eye(3)[normal], 1 - np.eye(3)[normal]
            if self._within(others, normals):
                yield kept, {**self.polar, **self.axial}
        if not self.linear or self.moved or self._sheared(structure):
            return
        for normal, kept in structure.across.items():
            if self._within(np.eye(3)[normal], 1 - np.eye(3)[normal]):
                yield kept, {**self.polar, **self.axial}

    def _sheared(self, structure: Any) -> bool:
        """Return whether forces across the structure make geometric stiffness, which moves it along too."""
        problem = self.problem
        return bool(problem.theory.prestress) and (problem.prestress or structure.prestress) == "all"

    def _within(self, polar: Array, axial: Array) -> bool:
        """Return whether forces have these directions only, and moments and spin those."""
        forces = all(np.all(value <= polar) for value in self.polar.values())
        return forces and all(np.all(value <= axial) for value in self.axial.values())


def _padded(values: Array) -> Array:
    return np.concatenate([values, np.zeros(3 - len(values))])


def of_load(load: Load) -> Array | None:
    """Return the largest size of each component of a load over all times, shape (3,); None where that is not known."""
    values = np.zeros(3) if load.is_zero else load.sizes()
    if values is not None and len(values) == 1:  # about axis 3, or along it
        return np.array([0.0, 0.0, values[0]])
    return None if values is None else _padded(values)


def of_base(motion: Any) -> Array | None:
    """Return the largest size of each component of the base acceleration; None where that is not known."""
    if not motion.is_accelerated:
        return np.zeros(3)
    if motion.constant:
        return np.asarray(np.abs(motion.base_acceleration(0.0)))
    if motion.base_knots is None:
        return None
    times = [0.0, *motion.base_knots]
    return np.asarray(np.abs([motion.base_acceleration(t) for t in times]).max(axis=0))
