"""The errors of frequencies: modes on half the cells, and in a richer theory.

The difference of an eigenvalue to that of the same mode on half the cells says its error (see
`rotfem.refinement.coarser`). The error by a theory is the difference itself. The same mode is the one whose shape is
most alike in x^H M x; of several shapes that are, as those of the two whirls of a shaft above its critical speed, it is
the one of the nearest eigenvalue.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.modal import ModalAnalysis, Spinning
from rotfem.errors import ComputationError, InputError
from rotfem.mechanics.problem import Problem
from rotfem.refinement.carrier import interpolation
from rotfem.refinement.coarser import on_other_mesh

Array = npt.NDArray[Any]

#: Modes in addition to those wanted that are computed on a coarser mesh, where they may come in another order.
SPARE = 4

#: Part of the largest likeness of shapes from which a shape is as much alike: an angle of 25 degrees to the mode.
ALIKE = 0.9


@dataclass
class Level:
    """Modes of a problem on another mesh, or in another theory.

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


class FrequencyErrors:
    """The errors of the frequencies of an analysis at any speed.

    Args:
        analysis: of the modes.
        richer: the problem in the theory that frequencies are compared with; None for the errors by the mesh.
    """

    def __init__(self, analysis: ModalAnalysis, richer: Problem | None = None):
        self.analysis, self.richer = analysis, richer
        self._level: Level | None = None

    def __call__(self, spinning: Spinning) -> list[float | None]:
        """Return the relative error of every eigenvalue; None where it is unknown."""
        lam = spinning.pairs.values
        self._level = self._level or self._made()
        if self._level is None or not len(lam):
            return [None] * len(lam)
        try:
            there = self._matched(self._level, spinning)
        except (ComputationError, InputError, np.linalg.LinAlgError):
            return [None] * len(lam)
        differences = np.abs(there - lam) / np.maximum(np.abs(lam), np.finfo(float).tiny)
        return [self._level.error(float(d)) for d in differences]

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

    def _matched(self, level: Level, spinning: Spinning) -> Array:
        """Return for every mode the eigenvalue of the most similar one on another mesh."""
        there, count = level.analysis, len(spinning.pairs.values)
        most = there.structure.free_unknowns() + int(there.free)
        level.before = there.at(spinning.speed, min(count + int(spinning.rigid) + SPARE, most), level.before)
        values = level.before.pairs.values
        if len(values) < count:
            raise ComputationError("there are fewer modes to compare with")
        if level.weights is None:
            return np.array([values[np.argmin(np.abs(values - lam))] for lam in spinning.pairs.values])
        block = self.analysis.structure.size
        shapes = there.right(level.before)[: level.weights.shape[1] * block]
        columns = shapes.reshape(level.weights.shape[1], -1)
        carried = (level.weights @ columns).reshape(-1, shapes.shape[1])
        alike = np.abs(self.analysis.mass_times(spinning)[: len(carried)].conj().T @ carried)
        size = np.abs(np.sum(carried.conj() * _massed(self.analysis, carried), axis=0))
        alike /= np.sqrt(np.maximum(size, 1e-300))
        apart = np.abs(values[None, :] - spinning.pairs.values[:, None])
        apart[alike < ALIKE * np.max(alike, axis=1, keepdims=True)] = np.inf
        return np.asarray(values[np.argmin(apart, axis=1)])


def _massed(analysis: ModalAnalysis, columns: Array) -> Array:
    """Return M at rest times columns of the structure's unknowns."""
    held = analysis.system.held
    M = held.matrix(0.0, 0.0, 1.0, 0.0)
    x, b = M.createVecs()
    out = np.empty(columns.shape, dtype=complex)
    for j in range(columns.shape[1]):
        for part, unit in ((columns[:, j].real, 1.0), (columns[:, j].imag, 1j)):
            x.array[:] = part
            M.mult(x, b)
            out[:, j] = b.array if unit == 1.0 else out[:, j] + unit * b.array
    return out
