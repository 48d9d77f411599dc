"""What rotations are counted from: the undeformed structure, or a shape it has had, so that they have no limit.

A rotation vector stands for a rotation one to one up to a full turn, and the two angles of a plate's director have a
pole. Neither is a limit of the structure. Before rotations come there they are counted afresh from the shape reached,
the *reference*: with its orientation R(X) the section is turned by exp(θ) R, the director is R t(alpha), and θ or alpha
start again at zero. Displacements do not change. R lies as polynomials in every cell, of a degree so much above that of
the unknowns that the strains are the same before and after; at their nodes R is exact, so errors do not add up. It is
known, exactly, at the nodes of the unknowns too. A beam also keeps the curvature of the reference, axial(Rᵀ R').
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from inspect import signature
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt
from basix.ufl import element
from dolfinx import fem
from mpi4py import MPI

from rotfem.errors import ComputationError
from rotfem.mechanics import rotations as turned
from rotfem.mechanics.theories import richest

Array = npt.NDArray[np.float64]


class BeyondReach(ComputationError):
    """Rotations have come farther from their reference than they may: what led there was too long a step."""


@dataclass(frozen=True, eq=False)
class ReferenceRotation:
    """The orientations that rotations are counted from; arrays of this process, which are not changed.

    Attributes:
        nodes: R at the nodes of the unknowns, shape (nodes, 3, 3).
        total: what the rotations are there, counted from the undeformed structure, (nodes, 3 or 2), rad.
        rotation: R at the nodes of its polynomials, cell by cell, shape (cells, points, 3, 3).
        curvature: axial(Rᵀ R') there (1/m), (cells, points, 3); of a beam.
    """

    nodes: Array
    total: Array
    rotation: Array
    curvature: Array


class Turns:
    """The rotations of a structure, and the reference they are counted from.

    Attributes:
        reference: None as long as rotations are counted from the undeformed structure.
        rotation, curvature: the functions that hold R and its curvature in the forms; None until there is a reference.
        before: a function of the unknowns' space, the total rotations of the reference; None until there is one.
    """

    #: The unknowns that are rotations.
    components: ClassVar[slice]
    #: By how much the polynomials of R are of higher degree than the unknowns: over a cell of a beam that is bent by
    #: 1.5 rad, or of a plate by 0.8 rad, they are then good to 1e-11.
    finer: ClassVar[int]
    #: Largest rotation (rad) that may be reached, and up to which a step may start.
    limit: ClassVar[float]
    enough: ClassVar[float]
    #: Rotations (n, …) ↦ how far they have come, (n,) in rad, to be compared with the limit.
    _reach: Callable[[Array], Array]
    #: Rotations (…, 3 or 2) counted from R, and R ↦ the orientation (…, 3, 3) that they stand for.
    _orientation: Callable[[Array, Array], Array]
    #: Orientation, guess ↦ the rotations that it is from the undeformed structure, of all those nearest the guess.
    _from_rest: Callable[[Array, Array], Array]
    #: Rotations, rates, second rates ↦ rates and second rates of rotations counted from the present shape.
    _rates: Callable[[Array, Array, Array], tuple[Array, Array]]

    def __init__(self, structure: Any):
        self._structure = structure
        self.reference: ReferenceRotation | None = None
        self.rotation: Any = None
        self.curvature: Any = None
        self.before: Any = None

    @classmethod
    def of(cls, structure: Any) -> Self | None:
        """Return the rotations of a structure; None in a theory whose strains do not allow a reference."""
        return cls(structure) if structure.problem.theory.exact else None

    def _curvature(self, reference: ReferenceRotation, rotations: Array, nodal: Array) -> Array:
        """Return the curvature of the next reference at the points of the polynomials."""
        raise NotImplementedError

    # --- range ------------------------------------------------------------------------------------------------------

    def reached(self, q: Array, v: Array | None = None, h: float = 0.0) -> float:
        """Return the part of the limit that rotations of q take, with rates v after a step of twice h (s)."""
        reach = self._reach(self._of(q))
        if v is not None:
            reach = reach + 2 * abs(h) * self._reach(self._of(v))
        here, comm = float(reach.max(initial=0.0)), self._structure.comm
        return (here if comm.size == 1 else comm.allreduce(here, op=MPI.MAX)) / self.limit

    def is_due(self, q: Array, v: Array | None = None, h: float = 0.0) -> bool:
        """Return whether rotations should be counted afresh before what follows, a step of h (s) with rates v."""
        now = self.reached(q)
        return now * self.limit > self.enough or (v is not None and 2 * now > 1.0 and self.reached(q, v, h) > 1.0)

    def check(self, q: Array, time: float | None = None) -> None:
        """Refuse rotations that have come farther from their reference than they may."""
        if (part := self.reached(q)) > 1.0:
            raise BeyondReach(f"rotations changed by {part * self.limit:.3g} rad at once", time)

    # --- change of the reference -----------------------------------------------------------------------------------

    def use(self, reference: ReferenceRotation | None) -> bool:
        """Count rotations from a reference, None for the undeformed structure; return whether forms change."""
        if reference is self.reference:
            return False
        first = self.rotation is None
        if first:
            mesh, degree = self._structure.mesh, self._space.element.basix_element.degree
            vectors = fem.functionspace(mesh, element("DG", mesh.basix_cell(), degree, shape=(3,)))
            self.rotation = fem.Function(self._space, name="reference")
            self.curvature = fem.Function(vectors, name="reference_curvature")
            self.before = fem.Function(self._structure.V, name="before")
        self.reference = reference
        shape = reference or self._undeformed
        _write(self.rotation, shape.rotation)
        _write(self.curvature, shape.curvature)
        self._of(self.before.x.array)[:] = shape.total
        return first

    def reset(self, q: Array, v: Array, second: list[Array]) -> ReferenceRotation:
        """Return the shape of q as a reference; q, rates v and second rates become those counted from it."""
        rotations, rates = self._of(q).copy(), self._of(v).copy()
        for a in second:
            self._of(v)[:], self._of(a)[:] = self._rates(rotations, rates, self._of(a))
        self._of(q)[:] = 0.0
        old, cells = self.reference or self._undeformed, self._structure.V.dofmap.list
        nodes, nodal = self._orientation(rotations, old.nodes), rotations[cells]
        at_points = np.einsum("pn,cni->cpi", self._tables[0], nodal)
        total = self._from_rest(nodes, old.total + rotations)
        curvature = self._curvature(old, at_points, nodal)
        return ReferenceRotation(nodes, total, self._orientation(at_points, old.rotation), curvature)

    def total(self, q: Array) -> Array:
        """Return q (local dof array) with its rotations counted from the undeformed structure."""
        if self.reference is None:
            return q
        out, rotations = q.copy(), self._of(q)
        orientation = self._orientation(rotations, self.reference.nodes)
        self._of(out)[:] = self._from_rest(orientation, self.reference.total + rotations)
        return out

    # --- fields -----------------------------------------------------------------------------------------------------

    def _of(self, values: Array) -> Array:
        """Return the rotations of a local dof array of the structure's space, a view (nodes, 3 or 2)."""
        nodes = self._structure.V.dofmap.index_map
        size = self._structure.size
        return values[: (nodes.size_local + nodes.num_ghosts) * size].reshape(-1, size)[:, self.components]

    @cached_property
    def _space(self) -> fem.FunctionSpace:
        """Polynomials of R in every cell."""
        mesh, degree = self._structure.mesh, self._structure.V.element.basix_element.degree + self.finer
        return fem.functionspace(mesh, element("DG", mesh.basix_cell(), degree, shape=(3, 3)))

    @cached_property
    def _tables(self) -> Array:
        """Values and derivatives of the unknowns' functions at the points, shape (1 + dim, points, nodes of a cell)."""
        points = self._space.element.basix_element.points
        return np.asarray(self._structure.V.element.basix_element.tabulate(1, points)[..., 0])

    @cached_property
    def _undeformed(self) -> ReferenceRotation:
        nodes = self._structure.V.dofmap.index_map
        n = nodes.size_local + nodes.num_ghosts
        cells, points = self._space.dofmap.list.shape
        total = np.zeros((n, self.components.stop - self.components.start))
        everywhere = np.broadcast_to(np.eye(3), (cells, points, 3, 3))
        return ReferenceRotation(np.broadcast_to(np.eye(3), (n, 3, 3)), total, everywhere, np.zeros((cells, points, 3)))


def _write(function: Any, values: Array) -> None:
    """Write values (cells, points, …) into a function of polynomials with these points."""
    cells = function.function_space.dofmap.list
    function.x.array.reshape(cells.size, -1)[cells] = values.reshape(*cells.shape, -1)


class SectionTurns(Turns):
    """The rotation vectors θ of a spatial beam's sections: Λ = exp(θ) R."""

    components = slice(3, 6)
    finer = 8
    limit = turned.FULL_TURN
    enough = 1.75 * np.pi
    _reach = staticmethod(lambda rotations: np.linalg.norm(rotations, axis=-1))
    _orientation = staticmethod(lambda rotations, R: turned.rotations(rotations) @ R)
    _from_rest = staticmethod(turned.rotation_vectors)
    _rates = staticmethod(turned.spins)

    def _curvature(self, reference: ReferenceRotation, rotations: Array, nodal: Array) -> Array:
        """Return Rᵀ T(θ) θ' + axial(Rᵀ R')."""
        geometry = self._structure.mesh.geometry
        ends = geometry.x[geometry.dofmap, 0]
        slopes = np.einsum("pn,cni->cpi", self._tables[1], nodal) / np.diff(ends)[:, :, None]
        change = turned.material_curvature(rotations, slopes)
        return np.asarray(np.einsum("cpji,cpj->cpi", reference.rotation, change) + reference.curvature)


class DirectorTurns(Turns):
    """The angles alpha of a plate's director: t = R t(alpha)."""

    components = slice(3, 5)
    finer = 6
    limit = 1.5  # of alpha_2, whose pole is at π/2; alpha_1 may go round
    enough = 1.1
    _reach = staticmethod(lambda rotations: np.abs(rotations[..., 1]))
    _orientation = staticmethod(lambda rotations, R: R @ turned.triads(rotations))
    _from_rest = staticmethod(lambda orientation, guess: turned.tilt_angles(orientation[..., 2], guess))
    _rates = staticmethod(turned.tilts)

    @classmethod
    def of(cls, structure: Any) -> Self | None:
        """Return the rotations of a plate; None in a theory whose strains are not those of a director t too."""
        theory = structure.problem.theory
        takes_director = len(signature(theory.measures(structure.type)).parameters) > 1
        return cls(structure) if theory.exact and takes_director else None

    def _curvature(self, reference: ReferenceRotation, rotations: Array, nodal: Array) -> Array:
        """Return zeros: what bends a plate are the derivatives of its director, which the polynomials of R have."""
        return reference.curvature


# --- theories of moderate rotation, whose rotations are counted from the undeformed structure -------------------------


def check_sections(beam: Any, q: Array, time: float | None = None) -> None:
    """Refuse a state in which some section of a spatial beam has turned by more than a full turn."""
    coordinates, values = beam.nodes(q)
    turns = np.linalg.norm(values[:, 3:], axis=1)
    worst = int(np.argmax(turns))
    if turns[worst] > turned.FULL_TURN:
        theory = beam.problem.theory
        limited = "behind more than one hinge" if theory.exact else f"in the theory {theory.name}"
        others = "a spring or a damper at the root" if theory.exact else f'model.theory = "{richest().name}"'
        what = (
            f"the section at X = {coordinates['x'][worst]:.4g} m has turned by {turns[worst] / (2 * np.pi):.3g} turns"
        )
        raise ComputationError(f"{what}; {limited} rotations are limited to one", time, f"a smaller load, or {others}")
