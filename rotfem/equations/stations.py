"""Forces, strains and unknowns at stations along a beam, stress resultants of a plate, of the state in a system.

Stresses of finite elements are best at the Gauss points that also keep locking away: of elements of degree k the
errors are O(h^(k+1)) there and O(h^k) elsewhere (Barlow, Int. J. Numer. Meth. Eng. 10 (1976) 243). A station has the
value of the polynomial through the Gauss points of its cell and the nearest one on either side, of degree k + 1, and
with it the order of the points. It does not cross jumps of the forces by section, axis or point loads; a station there
has the value of its outer side, the tip that of its inner side.

The forces are derivatives of the stored energy to the strains of the section, ∂W/∂Γ and ∂W/∂K: about the reference
axis, along the turned axes t_i, of the outer part on the inner one. N > 0 is tension, and at the
root of an undeformed beam they are −f and −m of the hub (`rotfem.structures.root_reaction`).

Membrane forces n = h Q ε (N/m), shear forces q = k h G γ (N/m) and moments m = (h³/12) Q κ (N) of a plate are best at
the points of the reduced rule. Every cell carries them to its nodes by the polynomial of degree k − 1 that they have
there, and a node has the mean of its cells. The equivalent stress (von Mises) is the largest of both faces,
σ = n/h ± 6 m/h², and of the middle, σ = n/h with the parabola of the shear stress, 3/2 q/h.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

import basix
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem, la
from ufl.algorithms import expand_derivatives

from rotfem.along import FORCES, RESULTANTS, STRAINS, TWIST
from rotfem.equations.system import System
from rotfem.numerics import forms
from rotfem.numerics.projection import summed
from rotfem.structures.beam import Beam
from rotfem.structures.structure import PointValues

if TYPE_CHECKING:
    from rotfem.structures.plate import Plate
    from rotfem.structures.spatial_beam import SpatialBeam

Array = npt.NDArray[np.float64]

#: Part of a cell by which a station may be off one of its ends.
AT_END = 1e-9


def weights(points: Array, x: float) -> Array:
    """Return the values at x of the Lagrange polynomials through points (n,)."""
    others = [np.delete(points, i) for i in range(len(points))]
    return np.array([np.prod((x - rest) / (p - rest)) for p, rest in zip(points, others, strict=True)])


class DampedStress:
    """The stress resultants of damping at the state of a system.

    Kelvin–Voigt and the stiffness part of Rayleigh damping are stresses, η C Γ̇. Damping by mode is one of modes of the
    structure at rest, and so carried by the stresses that it has when it is displaced by

        w = Σ_j (2 ζ_j/ω_j) φ_j (φ_jᵀ M v),    for K φ_j = ω_j² M φ_j makes K w = C v

    (see `rotfem.equations.modal_damping`). The mass part of Rayleigh damping is no stress.
    """

    def __init__(self, system: System):
        self._system = system
        self._displaced = None if system.by_mode is None else fem.Function(system.V)
        self._compiled: tuple[int, Any] | None = None

    def compiled(self, expression: Callable[[], Any], points: Array) -> Any:
        """Return an expression, compiled at points of the cells; again after a change of the reference rotation."""
        if self._compiled is None or self._compiled[0] != self._system.compositions:
            made = forms.expression(expression(), points, self._system.comm)
            self._compiled = self._system.compositions, made
        return self._compiled[1]

    def of(self, force: Any) -> Any:
        """Return a resultant, a UFL expression of the unknowns, with damping."""
        return sum(self._parts(force, self._system.v), start=force)

    def change(self, force: Any, dq: Any, dv: Any) -> Any:
        """Return the derivative of a resultant with damping about a state at rest by small q and v, two functions."""
        return sum(self._parts(force, dv), start=ufl.derivative(force, self._system.q, dq))

    def _parts(self, force: Any, v: Any) -> list[Any]:
        """Return the parts of damping in a resultant, at velocities v, a function, and those of `update`."""
        viscosity, q, out = self._system.model.mechanics.damping.stiffness, self._system.q, list[Any]()
        if viscosity is not None:
            out.append(viscosity * ufl.derivative(force, q, v))
        if self._displaced is not None:
            at_rest = forms.first_branches(force)  # at rest the other branches of its rotations divide by zero
            out.append(forms.without(ufl.derivative(at_rest, q, self._displaced), q))
        return out

    def update(self, v: Array) -> None:
        """Set the velocities of the owned unknowns; collective."""
        part = self._system.by_mode
        if self._displaced is not None and part is not None:
            w = self._displaced.x
            w.array[: len(part.B)] = part.displaced(v[: len(part.B)])
            w.scatter_forward()


class Stations:
    """Section forces, strains and unknowns of a beam at its stations (m, increasing); the hub is fixed.

    Attributes:
        names: of all quantities: forces (N, N·m), strains (1, 1/m) and unknowns (m, rad), in space elastic twist (rad).
    """

    def __init__(self, system: System, positions: tuple[float, ...]):
        self.system, self.positions = system, np.array(positions)
        self.beam = cast(Beam, system.structure)
        self.comm, self.degree = system.comm, system.V.element.basix_element.degree
        self.names = (*FORCES[self.beam.type], *STRAINS[self.beam.type], *self.beam.components, *TWIST[self.beam.type])
        self._points = forms.quadrature_points(self.beam.mesh, self.degree)
        self._damped = DampedStress(system)
        self._place()

    # --- where ----------------------------------------------------------------------------------------------------

    def _place(self) -> None:
        """Find the cells of all stations, and the weights of Gauss points in their values."""
        mesh, comm = self.beam.mesh, self.comm
        owned = mesh.topology.index_map(1).size_local
        ends = mesh.geometry.x[mesh.geometry.dofmap[:owned], 0].reshape(-1, 2)
        parts = comm.allgather(ends)
        owner = np.concatenate([np.full(len(part), rank) for rank, part in enumerate(parts)])
        local = np.concatenate([np.arange(len(part)) for part in parts])
        cells = np.concatenate(parts)
        order = np.argsort(cells.min(axis=1))
        cells, owner, local = cells[order], owner[order], local[order]
        left, right = cells.min(axis=1), cells.max(axis=1)
        found = np.searchsorted(left, self.positions + AT_END * (right - left).min(), side="right") - 1
        found = np.clip(found, 0, len(left) - 1)
        points = (cells[:, :1] + self._points[:, 0] * (cells[:, 1:] - cells[:, :1])).ravel()
        along = np.argsort(points)
        near = np.abs(np.subtract.outer(left, self.beam.knots)).min(axis=1, initial=np.inf)
        smooth = np.repeat(np.cumsum(near <= AT_END * (right - left)), self.degree)  # its number, of every point
        chosen = [along[self._around(int(c), smooth)] for c in found]
        needed = np.unique(np.concatenate(chosen) // self.degree)
        self._stress = np.zeros((len(found), len(needed), self.degree))
        for row, numbers, x in zip(self._stress, chosen, self.positions, strict=True):
            cell, i = np.divmod(numbers, self.degree)
            row[np.searchsorted(needed, cell), i] = weights(points[numbers], float(x))
        here = owner[needed] == comm.rank
        self._rows, self._cells = np.flatnonzero(here), local[needed[here]].astype(np.int32)
        self._shape = len(needed), self.degree
        self._at = [PointValues(self.system.V, np.array([x, 0.0, 0.0])) for x in self.positions]

    def _around(self, cell: int, smooth: Array) -> list[int]:
        """Return places, from the root on, of the Gauss points of a cell and of the two nearest ones, one on each side.

        Where something jumps on one side, so that its numbers in `smooth` differ, both are on the other one.
        """
        own = [*range(cell * self.degree, (cell + 1) * self.degree)]
        low, high = (
            [n for n in places if 0 <= n < len(smooth) and smooth[n] == smooth[own[0]]]
            for places in ((own[0] - 1, own[0] - 2), (own[-1] + 1, own[-1] + 2))
        )
        return own + ([low[0], high[0]] if low and high else low or high)

    # --- what -----------------------------------------------------------------------------------------------------

    @cached_property
    def _order(self) -> slice:
        return slice(0, len(FORCES[self.beam.type]) + len(STRAINS[self.beam.type]))

    @property
    def _unknowns(self) -> slice:
        return slice(self._order.stop, self._order.stop + len(self.beam.components))

    def _expression(self) -> Any:
        """Return forces and strains as one UFL vector."""
        return ufl.as_vector([part[i] for part in self._quantities() for i in range(part.ufl_shape[0])])

    def _quantities(self) -> tuple[Any, Any]:
        """Return forces and strains as UFL vectors."""
        force, strains = self._section()
        return self._damped.of(force), strains

    def _section(self) -> tuple[Any, Any]:
        """Return forces without those of damping, and strains, as UFL vectors."""
        beam, model = self.beam, self.system.model
        strains = beam.section_strains(model.theory.measures(beam.type))
        at = ufl.variable(strains)
        stored = model.with_gains(beam.stored(at), first_order=model.theory.linear)
        energy = sum(ufl.inner(s.force(s.value), s.value) / 2 for s in stored)
        return ufl.diff(energy, at), strains

    def _read(self, q: Array, v: Array) -> Array:
        """Return the values of the expression and of unknowns (local dof array q) on every rank; v is for damping."""
        self._damped.update(v)
        values: Array = np.zeros((*self._shape, self._order.stop))
        if len(self._cells):
            found = self._damped.compiled(self._expression, self._points).eval(self.beam.mesh, self._cells)
            values[self._rows] = found.reshape(len(self._cells), self.degree, -1)
        out: Array = np.zeros((len(self.positions), len(self.names)))
        out[:, self._order] = np.tensordot(self._stress, values, 2)
        out = summed(self.comm, out)
        out[:, self._unknowns] = [self.beam.whole_values(value(q)) for value in self._at]
        return out

    def __call__(self) -> Array:
        """Return all quantities at all stations, (stations, names), on every rank; unknowns in the turning frame."""
        out = self._read(self.beam.total(self.system.q.x.array), self.system.v.x.array)
        unknowns = out[:, self._unknowns]
        for name in TWIST[self.beam.type]:
            out[:, self.names.index(name)] = cast("SpatialBeam", self.beam).twist(unknowns, self.positions)
        out[:, self._unknowns] = self.system.seen_from_hub(unknowns, self.positions, self.system.time)
        return out


class StationChanges(Stations):
    """Derivatives of the quantities at the stations of a beam about an equilibrium of its system."""

    def __init__(self, system: System, positions: tuple[float, ...]):
        super().__init__(system, positions)
        self._dq, self._dv = fem.Function(system.V), fem.Function(system.V)

    def _quantities(self) -> tuple[Any, Any]:
        """Return the changes of forces and strains as UFL vectors."""
        force, strains = self._section()
        change = ufl.derivative(strains, self.system.q, self._dq)
        return tuple(expand_derivatives(x) for x in (self._damped.change(force, self._dq, self._dv), change))

    def of(self, q: Array, v: Array) -> Array:
        """Return the changes of all quantities at all stations by small q and v of the owned unknowns."""
        for function, values in ((self._dq, q), (self._dv, v)):
            function.x.array[: len(values)] = values
            function.x.scatter_forward()
        return self._read(self._dq.x.array, v)


# --- plates ----------------------------------------------------------------------------------------------------------


def von_mises(values: Array, thickness: Array) -> Array:
    """Return the largest equivalent stress (…,), Pa, of n, q, m in their order (…, 8) over a thickness (…,), m."""
    h = thickness[..., None]
    n, q, m = values[..., :3] / h, values[..., 3:5] / h, 6 * values[..., 5:] / h**2

    def squared(s: Array) -> Array:
        out: Array = s[..., 0] ** 2 - s[..., 0] * s[..., 1] + s[..., 1] ** 2 + 3 * s[..., 2] ** 2
        return out

    middle = squared(n) + 3 * np.sum((1.5 * q) ** 2, axis=-1)
    return np.asarray(np.sqrt(np.maximum(np.maximum(squared(n + m), squared(n - m)), middle)))


class PlateResultants:
    """Stress resultants of a plate; the hub is fixed.

    Attributes:
        names: of all quantities.
    """

    names = RESULTANTS["plate"]

    def __init__(self, system: System):
        self.system, self.V = system, system.V
        mesh, element = self.V.mesh, self.V.element.basix_element
        self._points = forms.quadrature_points(mesh, element.degree)
        self._cells = np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
        lower = basix.create_element(basix.ElementFamily.P, element.cell_type, element.degree - 1, discontinuous=True)
        at_points, at_nodes = (lower.tabulate(0, x)[0, :, :, 0] for x in (self._points, element.points))
        self._carry = at_nodes @ np.linalg.pinv(at_points)
        self._sum = la.vector(self.V.dofmap.index_map, len(self.names) + 1)
        self._damped = DampedStress(system)

    def _expression(self) -> Any:
        """Return resultants and thickness as one UFL vector."""
        parts: list[Any] = []
        for name in ("membrane", "shear", "bending"):  # others only keep elements from locking
            force = self._damped.of(self.system.model.mechanics.resultant(name))
            parts += [force[i] for i in range(ufl.as_ufl(force).ufl_shape[0])]
        return ufl.as_vector([*parts, self.system.structure.section["thickness"]])

    def __call__(self) -> Array:
        """Return all quantities at all nodes in the order of `structure.nodes`, (n, names), on every rank."""
        width, total = len(self.names), self._sum.array.reshape(-1, len(self.names) + 1)
        total[:] = 0.0
        self._damped.update(self.system.v.x.array)
        if len(self._cells):
            found = self._damped.compiled(self._expression, self._points).eval(self.V.mesh, self._cells)
            found = found.reshape(len(self._cells), len(self._points), -1)
            nodal = np.einsum("np,cpj->cnj", self._carry, found)
            stress = von_mises(nodal[..., : width - 1], nodal[..., -1])
            values = np.concatenate([nodal[..., :-1], stress[..., None], np.ones_like(stress)[..., None]], axis=-1)
            np.add.at(total, self.V.dofmap.list[self._cells], values)
        if self.system.comm.size > 1:
            self._sum.scatter_reverse(la.InsertMode.add)
        owned = self.V.dofmap.index_map.size_local
        here = total[:owned, :-1] / total[:owned, -1:]
        return np.asarray(cast("Plate", self.system.structure).ordered(here))
