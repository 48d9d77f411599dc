"""The errors of frequencies: modes on half the cells, and in a richer theory; and the phase that such an error makes.

The difference of an eigenvalue to that of the same mode on half the cells says its error (see
`rotfem.refinement.coarser`). The error by a theory is the difference itself. The same mode is the one whose shape is
most alike in x^H M x; of several shapes that are, as those of the two whirls of a shaft above its critical speed, it is
the one of the nearest eigenvalue.

The stress stiffness of a linear theory is that of the undeformed structure, so its eigenvalues λ are in error by dλ.
What a start with q₀ and v₀, relative to the equilibrium, has of a mode with right and left vectors x and y is c x with

    c = yᴴ[(λM + C)q₀ + Mv₀] / yᴴ(2λM + C)x

(Tisseur & Meerbergen, SIAM Review 43 (2001) 235, section 3). After the time T, or where damping −Re λ ends the
vibration sooner, it is out of phase by |dλ| T. What drives a motion keeps its phase: this is of motions that nothing
drives.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.equilibrium import steady_state
from rotfem.analysis.frequency_response import tip_output
from rotfem.analysis.modal import ModalAnalysis, Spinning
from rotfem.errors import ComputationError, InputError
from rotfem.mechanics.problem import Problem
from rotfem.mechanics.theories import richest
from rotfem.numerics.eigenproblem import Pencil
from rotfem.numerics.linear import SMALL
from rotfem.numerics.newton import Newton
from rotfem.numerics.projection import summed
from rotfem.refinement.coarser import interpolation, on_other_mesh

Array = npt.NDArray[Any]

#: Modes in addition to those wanted that are computed on a coarser mesh, where they may come in another order.
SPARE = 4


@dataclass
class Level:
    """A problem on another mesh, or in another theory.

    Attributes:
        analysis: of the problem there.
        error: difference of a frequency, relative ↦ its error.
        weights: values at the nodes of the analysed mesh by those of this one; None on several processes.
        before: solution at the speed before.
    """

    analysis: ModalAnalysis
    error: Callable[[float], float]
    weights: Any
    before: Spinning | None = None


@dataclass
class Modes:
    """Modes on another mesh, or in another theory.

    Attributes:
        speed: Ω, rad/s.
        values: λ.
        carried: their vectors at the nodes of the analysed mesh, without the hub; None on several processes.
        error: see `Level`.
    """

    speed: float
    values: Array
    carried: Array | None
    error: Callable[[float], float]


class FrequencyErrors:
    """The errors of the frequencies of an analysis at any speed.

    Args:
        analysis: of the modes.
        richer: the problem in the theory that frequencies are compared with; None for the errors by the mesh.
    """

    def __init__(self, analysis: ModalAnalysis, richer: Problem | None = None):
        self.analysis, self.richer = analysis, richer
        self._level: Level | None = None
        self._modes: Modes | None = None

    def __call__(self, spinning: Spinning) -> list[float | None]:
        """Return the relative error of every eigenvalue; None where it is unknown."""
        lam = spinning.pairs.values
        modes = self._at(spinning.speed, len(lam) + int(spinning.rigid)) if len(lam) else None
        if modes is None:
            return [None] * len(lam)
        differences = np.abs(self._matched(modes, spinning) - lam) / np.maximum(np.abs(lam), np.finfo(float).tiny)
        return [modes.error(float(d)) for d in differences]

    def near(self, speed: float, count: int) -> Array | None:
        """Return the modes on half the cells as columns of the analysed mesh, if it is large; its matrices are freed.

        Args:
            speed: Ω, rad/s.
            count: number of modes.
        """
        size = self.analysis.system.V.dofmap.index_map.size_global * self.analysis.structure.size
        modes = self._at(speed, count) if size > SMALL else None
        if modes is not None and modes.carried is not None:
            self._level = None
        return None if modes is None else modes.carried

    def _at(self, speed: float, count: int) -> Modes | None:
        """Return at least so many modes on the other mesh; None where there are none."""
        if self._modes is not None and self._modes.speed == speed and len(self._modes.values) >= count:
            return self._modes
        level = self._level = self._level or self._made()
        if level is None:
            return None
        there = level.analysis
        most = there.structure.free_unknowns() + int(there.free)
        try:
            level.before = there.at(speed, min(count + SPARE, most), level.before, keep=False)
        except (ComputationError, InputError, np.linalg.LinAlgError):
            return None
        values, carried = level.before.pairs.values, None
        if level.weights is not None:
            shapes = there.right(level.before)[: level.weights.shape[1] * self.analysis.structure.size]
            columns = shapes.reshape(level.weights.shape[1], -1)
            carried = (level.weights @ columns).reshape(-1, shapes.shape[1])
        self._modes = Modes(speed, values, carried, level.error) if len(values) + int(there.free) >= count else None
        return self._modes

    @property
    def there(self) -> ModalAnalysis | None:
        """What the last frequencies were compared with; None where there is nothing."""
        return None if self._level is None else self._level.analysis

    def _made(self) -> Level | None:
        own = self.analysis
        system: Any = None
        error: Callable[[float], float] = float
        if self.richer is None:
            other = on_other_mesh(own.problem, own.system, moving=False)
            if other is None:
                return None
            system, error = other.system, other.error
            problem = own.problem.replace(mesh=system.model.problem.mesh)
        else:
            problem = self.richer.replace(outputs={})
        there = ModalAnalysis(problem, own.about, own.newton, own.comm, system)
        there.past_limits = own.past_limits
        nodes = own.system.V.tabulate_dof_coordinates()
        return Level(there, error, interpolation(there.system.V, nodes) if own.comm.size == 1 else None)

    def _matched(self, modes: Modes, spinning: Spinning) -> Array:
        """Return for every mode the eigenvalue of the most similar one on another mesh."""
        values, carried = modes.values, modes.carried
        apart = np.abs(values[None, :] - spinning.pairs.values[:, None])
        if carried is not None:
            alike = np.abs(self.analysis.mass_times(spinning)[: len(carried)].conj().T @ carried)
            M = self.analysis.system.held.matrix(0.0, 0.0, 1.0, 0.0)
            size = np.abs(np.sum(carried.conj() * Pencil(M, M, M).apply(M, carried), axis=0))
            alike /= np.sqrt(np.maximum(size, 1e-300))
            # as much alike are shapes within 25 degrees of the mode
            apart[alike < 0.9 * np.max(alike, axis=1, keepdims=True)] = np.inf
        return np.asarray(values[np.argmin(apart, axis=1)])


def phase_drift(problem: Problem, system: Any, start: tuple[Array, Array], time: float, newton: Newton) -> float | None:
    """Return by how much the error of a linear theory's frequencies moves the tip, m; None where it is unknown.

    Args:
        problem: a linear theory's, at constant speed, with nothing that drives its motion.
        system: equations of motion, the hub held; its state and time are set.
        start: q and v at t = 0, local dof arrays.
        time: that passes, s.
        newton: iteration control.

    Raises:
        ComputationError: there is no equilibrium, or no mode.
    """
    speed, (q, v) = float(problem.motion.speed(0.0)), start
    rest = steady_state(system, speed, newton)
    if not np.any(rest) or not (np.any(q - rest) or np.any(v)):
        return 0.0
    analysis = ModalAnalysis(problem.replace(outputs={}), newton=newton, comm=system.comm, system=system)
    spinning = analysis.at(speed, 8)  # a free vibration from a smooth start has little of higher modes
    pairs, pencil = spinning.pairs, spinning.pencil
    errors = FrequencyErrors(analysis, problem.replace(theory=richest()))(spinning)
    if None in errors:
        return None
    lam, (away, rate) = pairs.values, ((x[: len(pairs.right), None]).astype(complex) for x in (q - rest, v))
    moved = summed(system.comm, pairs.left.conj().T @ pencil.apply(pencil.M, rate))
    part = (pencil.gram(pairs.left, lam, away, np.zeros(1)) + moved)[:, 0] / np.diag(spinning.own)
    change = np.array(errors, dtype=float) * np.abs(lam)
    lasting = np.minimum(time, 1.0 / np.maximum(-lam.real, 1.0 / time))
    out = np.abs(part) * np.minimum(change * lasting, 2.0)  # which is out of phase
    tip = tip_output(system).read
    lengths = [np.linalg.norm(tip(x, 0.0)[system.structure.moves]) for x in pairs.right.T]
    return float(np.sum(out * lengths, where=lam.imag > 0.0) * 2.0)  # with the conjugate pairs
