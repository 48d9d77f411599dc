"""What is read of a state: sizes in the units of the unknowns, the tip, the shape, energies and outputs."""

from __future__ import annotations

from abc import abstractmethod
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from mpi4py import MPI

from rotfem.equations.functionals import Functionals
from rotfem.equations.model import Model
from rotfem.mechanics.loads import is_moment
from rotfem.mechanics.motion import Motion
from rotfem.mechanics.sums import added
from rotfem.numerics import forms
from rotfem.structures.root_reaction import RootReaction
from rotfem.structures.structure import Structure
from rotfem.structures.turning_clamp import TurningClamp

Array = npt.NDArray[np.float64]


class Readings:
    """Values of the state of a system, on every rank the same (see `rotfem.equations.system.System`)."""

    model: Model
    structure: Structure
    motion: Motion
    comm: MPI.Comm
    time: float
    scale: Array
    clamp: TurningClamp | None
    root: RootReaction
    q: Any
    V: Any

    @abstractmethod
    def clamp_forces(self) -> Array:
        """Return the part of this process in what the clamp does in its unit motions at the state and time set."""

    @abstractmethod
    def clamp_tangents(self) -> tuple[Array, Array, Array]:
        """Return what small q, v and a of the owned unknowns add to `clamp_forces` about an equilibrium that is set.

        Three arrays (unknowns, motions), of K, C and M.
        """

    def size(self, x: Array) -> float:
        """Return the largest entry of a local dof array in units of `scale`, over all ranks."""
        here = float(np.max(np.abs(x) / self.scale)) if x.size else 0.0
        return here if self.comm.size == 1 else self.comm.allreduce(here, op=MPI.MAX)

    def product(self, x: Array, y: Array) -> float:
        """Return the sum of the products of the entries of two local dof arrays in units of `scale`, over all ranks."""
        owned = slice(0, self.V.dofmap.index_map.size_local * self.V.dofmap.index_map_bs)
        here = float((x[owned] / self.scale[owned]) @ (y[owned] / self.scale[owned]))
        return here if self.comm.size == 1 else self.comm.allreduce(here)

    def deflection(self, q: Array, t: float) -> float:
        """Return the largest unknown relative to the turning frame in units of `scale`, over all ranks."""
        if self.clamp is None:
            return self.size(q)
        x = self.V.tabulate_dof_coordinates()[:, 0]
        return self.size(self.clamp.relative(q.reshape(len(x), -1), x, t).ravel())

    def increment_size(self, dq: Array) -> float:
        """Return the size of a correction by which Newton is judged."""
        return self.size(dq)

    def sizes(self, x: Array) -> Array:
        """Return the largest entry of each component in units of `scale`, over all ranks, shape (components,)."""
        here = (np.abs(x) / self.scale).reshape(-1, self.V.dofmap.index_map_bs).max(axis=0, initial=0.0)
        here = self.structure.whole_values(here)
        if self.comm.size > 1:
            self.comm.Allreduce(MPI.IN_PLACE, here, op=MPI.MAX)
        return np.asarray(here)

    def tip(self, q: Array, t: float) -> Array:
        """Return the values of the unknowns at the tip, relative to the turning frame, shape (components,)."""
        tip = self.structure.whole_values(self.structure.tip_values(self.structure.total(q)))
        return np.asarray(self.seen_from_hub(tip[None, :], self.structure.length, t)[0])

    def seen_from_hub(self, values: Array, x: Any, t: float) -> Array:
        """Return all components (n, components) of points at x (m) at time t (s) in the frame that turns with the hub.

        That is the frame of the unknowns but in the inertial form, and under a pitch over time.
        """
        if self.clamp is not None:
            return self.clamp.relative(values, x, t)
        pitch = self.motion.pitch
        return values if pitch is None else pitch.in_hub_axes(values, t)

    def root_reaction(self) -> dict[str, float]:
        """Return force (N) and moment (N·m) of the hub on the structure at the state and time set, axes of the hub.

        The moment is about the root, `root.place`; keys f1, f2, … m3, as far as the structure has them.
        """
        here = self.clamp_forces()
        values = here if self.comm.size == 1 else self.comm.allreduce(here)
        found = dict(zip(self.root.names, map(float, values), strict=True))
        if self.clamp is not None:
            c, s = np.cos(self.clamp.angle(self.time)), np.sin(self.clamp.angle(self.time))
            found |= {"f1": c * found["f1"] + s * found["f2"], "f2": c * found["f2"] - s * found["f1"]}
        if self.motion.pitch is not None:
            turned = self.motion.pitch.in_hub_axes(np.array(list(found.values())), self.time)
            found = dict(zip(found, map(float, turned), strict=True))
        return found

    def shape(self) -> dict[str, Array]:
        """Return the deflected structure at the state: position x (m), u1, u2 (m), alpha, … in the turning frame."""
        coordinates, q = self.structure.nodes(self.structure.total(self.q.x.array))
        q = self.seen_from_hub(q, coordinates["x"], self.time)
        return {**coordinates, **{name: q[:, i] for i, name in enumerate(self.structure.components)}}

    @cached_property
    def _energies(self) -> Functionals:
        return Functionals(self.model.energies(), self.structure.mesh)

    @cached_property
    def _moment(self) -> Any:
        """The sum of all applied moments, compiled; None without. Of planar beams, whose axis is that of the spin."""
        moments = [load for load in self.model.mechanics.loads if is_moment(load.name)]
        return forms.form(added(load.force * load.measure for load in moments)) if moments else None

    @cached_property
    def _outputs(self) -> dict[str, Any]:
        return {name: forms.form(form) for name, form in self.model.outputs().items()}

    def compile_readings(self) -> None:
        """Compile what is read of states, energies and outputs, which is otherwise done when first asked for."""
        _ = self._energies, self._outputs

    def total(self, form: Any) -> float:
        """Return the value of a compiled functional over all ranks; 0 of None."""
        if form is None:
            return 0.0
        here = float(fem.assemble_scalar(form))
        return here if self.comm.size == 1 else float(self.comm.allreduce(here))

    def outputs(self) -> dict[str, float]:
        """Return the functionals of the problem at the state and time set."""
        return {name: self.total(form) for name, form in self._outputs.items()}

    def energies(self) -> dict[str, float]:
        """Return kinetic and strain energy and the Jacobi integral T2 − T0 + W + V, J.

        V is the potential of dead loads, gravity and base acceleration; the integral is constant while these and the
        spin are constant in the frame and nothing dissipates.
        """
        e = self._energies()
        kinetic = e["T2"] + e.get("T1", 0.0) + e.get("T0", 0.0) + e.get("origin", 0.0)
        if "momentum" in e:
            spin = self.motion.speed(self.time) * float(self.motion.axis[2])
            jacobi = kinetic - spin * e["momentum"] + e["strain"]
        else:
            jacobi = e["T2"] - e.get("T0", 0.0) + e["strain"]
        potential = e.get("potential", 0.0)
        if self.clamp is not None:  # a dead moment works on the rotation relative to the hub, alpha − psi
            potential += self.total(self._moment) * self.clamp.angle(self.time)
        return {"kinetic": kinetic, "strain": e["strain"], "jacobi": jacobi + potential}
