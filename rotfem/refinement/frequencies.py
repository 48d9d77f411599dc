"""The errors of frequencies by the mesh and by the theory, and the phase error that follows.

The error by the mesh is that of the difference to the same mode on half the cells (`rotfem.refinement.coarser`), the
error by the theory the difference itself. Modes are matched by their shapes in x^H M x; of several similar shapes, as
those of the two whirls of a shaft above its critical speed, the nearest eigenvalue is taken.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.modal import ModalAnalysis, Spinning
from rotfem.errors import ComputationError, InputError
from rotfem.mechanics.problem import Problem
from rotfem.numerics.linear import SMALL
from rotfem.numerics.newton import Newton
from rotfem.numerics.projection import summed, with_ghosts
from rotfem.refinement.coarser import interpolation, on_other_mesh
from rotfem.refinement.distance import sizes

Array = npt.NDArray[Any]

#: Modes computed beyond those wanted on the other mesh, where their order may differ.
SPARE = 4


class FrequencyErrors:
    """The errors of the frequencies of an analysis at any speed.

    Args:
        analysis: of the modes.
        richer: the problem in the theory that frequencies are compared with; None for the errors by the mesh.

    Attributes:
        there: analysis of the problem on the other mesh or in that theory; None where there is none.
        values: λ there, at the speed of the last call; and `resolved`, with 0 for those that are zero to round-off.
        carried: their vectors at the nodes of the own mesh, without the hub; None where these cannot be interpolated.
    """

    def __init__(self, analysis: ModalAnalysis, richer: Problem | None = None):
        self.analysis, self.richer = analysis, richer
        self.there: ModalAnalysis | None = None
        self.values: Array = np.empty(0)
        self.resolved: Array = np.empty(0)
        self.carried: Array | None = None
        self._speed: float | None = None
        self._before: Spinning | None = None
        #: Values at the nodes of the analysed mesh by those of the other one; square roots of x^H M x there;
        #: difference of a frequency ↦ its error.
        self._weights: Any = None
        self._sizes: Array = np.empty(0)
        self._error: Callable[[float], float] = float

    def __call__(self, spinning: Spinning) -> list[float | None]:
        """Return the error of every eigenvalue relative to its `sizes`, None where it is unknown."""
        lam = spinning.pairs.resolved
        if not len(lam) or not self._found(spinning.speed, len(lam) + int(spinning.rigid)):
            return [None] * len(lam)
        return [self._error(float(d)) for d in np.abs(self._matched(spinning) - lam) / sizes(lam)]

    def near(self, speed: float, count: int) -> Array | None:
        """Return the modes on half the cells as columns on the own mesh, None if that is small; free their matrices.

        Args:
            speed: Ω, rad/s.
            count: number of modes.
        """
        size = self.analysis.system.V.dofmap.index_map.size_global * self.analysis.structure.size
        if size <= SMALL or not self._found(speed, count):
            return None
        if self.carried is not None:
            self.there = self._before = None
        return self.carried

    def _found(self, speed: float, count: int) -> bool:
        """Find at least so many modes on the other mesh; return whether there are."""
        if self._speed == speed and len(self.values) >= count:
            return True
        there = self.there = self.there or self._made()
        self._speed = None
        if there is None:
            return False
        most = there.structure.free_unknowns() + int(there.free)
        try:
            self._before = there.at(speed, min(count + SPARE, most), self._before, keep=False)
        except (ComputationError, InputError, np.linalg.LinAlgError):
            return False
        self.values, self.resolved = self._before.pairs.values, self._before.pairs.resolved
        if self._weights is not None:
            V, clamped, size = there.system.V, self._before.clamped, self.analysis.structure.size
            shapes = there.right(self._before)[: V.dofmap.index_map.size_local * size]
            energies = summed(there.comm, np.sum(shapes.conj() * clamped.apply(clamped.M, shapes), axis=0))
            self._sizes = np.sqrt(np.maximum(np.abs(energies), 1e-300))
            columns = with_ghosts(V, shapes).reshape(self._weights.shape[1], -1)
            self.carried = (self._weights @ columns).reshape(-1, shapes.shape[1])
        if len(self.values) + int(there.free) < count:
            return False
        self._speed = speed
        return True

    def _made(self) -> ModalAnalysis | None:
        own = self.analysis
        system: Any = None
        if self.richer is None:
            # Half the cells of a plate, whole on each of up to four processes, are no more than their part of its own.
            other = on_other_mesh(own.problem, own.system, moving=False, alone=own.comm.size <= 4)
            if other is None:
                return None
            system, self._error = other.system, other.error
            problem = own.problem.replace(mesh=system.model.problem.mesh)
        else:
            problem = self.richer.replace(outputs={})
        # what its iterations show does not hold on another mesh
        newton = Newton(own.newton.tolerance, own.newton.max_iterations)
        there = ModalAnalysis(problem, own.about, newton, own.comm if system is None else system.comm, system)
        V = own.system.V
        weights = interpolation(there.system.V, V.tabulate_dof_coordinates()[: V.dofmap.index_map.size_local])
        self._weights = weights if all(own.comm.allgather(weights is not None)) else None
        return there

    def _matched(self, spinning: Spinning) -> Array:
        """Return for every mode the eigenvalue of the most similar one on another mesh."""
        values, carried = self.values, self.carried
        apart = np.abs(values[None, :] - spinning.pairs.values[:, None])
        if carried is not None:
            products = self.analysis.mass_times(spinning)[: len(carried)].conj().T @ carried
            alike = np.abs(summed(self.analysis.comm, products)) / self._sizes
            # as much alike are shapes within 25 degrees of the mode
            apart[alike < 0.9 * np.max(alike, axis=1, keepdims=True)] = np.inf
        return np.asarray(self.resolved[np.argmin(apart, axis=1)])
