"""Modes once more, with the stiff strains as unknowns, where round-off of the stiffness has spoilt them."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.equations.mixed_form import Resultants, Saddle
from rotfem.errors import ComputationError
from rotfem.numerics.balance import power_of_two
from rotfem.numerics.eigenproblem import ROUNDED, Eigenpairs, Pencil, RoundOff, relative
from rotfem.numerics.low_rank import sparse_part

Array = npt.NDArray[Any]

#: Error bound from which digits are lost, so that the modes are computed once more.
LOST = 1e-5

#: Error bound that viscosity alone would leave, from which nothing is gained.
WORTH = 0.1


class KeptDigits:
    """Modes of a system from its saddle form; compiled when it is first needed.

    Args:
        system: equations of motion of the structure, hub held.

    Attributes:
        used: whether it has kept more digits of some pairs.
    """

    def __init__(self, system: Any):
        self.system, self.used = system, False
        self._resultants: Resultants | None = None

    def better(self, pencil: Pencil, pairs: Eigenpairs, count: int) -> Eigenpairs:
        """Return the pairs, or those of the saddle form where digits are lost and it keeps more of them.

        Args:
            pencil: M, C and K at the state that is set; where C is not sparse nothing better is tried.
            pairs: its eigenpairs.
            count: number of pairs wanted.
        """
        worst = float(np.max(pairs.bounds[:count], initial=0.0))
        if worst <= LOST or sparse_part(pencil.C) is not pencil.C or not Resultants.possible(self.system):
            return pairs
        if self._in_damping(pairs, count) > WORTH:
            return pairs
        if self._resultants is None:
            self._resultants = Resultants(self.system)
        saddle = self._resultants.at_state(pencil.M, pencil.C)
        kept = saddle_pencil(saddle, pencil.unit or 1.0)
        try:
            found = kept.solve(count)
        except ComputationError:
            return pairs
        n = pairs.right.shape[0]
        right, left, bounds = found.right[:n], found.left[:n], found.bounds
        eta = self.system.model.mechanics.damping.stiffness
        left_out: Array = np.zeros(len(bounds))
        if saddle.stressed is not None:
            left_out += ROUNDED * np.abs(_product(pencil, left, pencil.apply(saddle.stressed, right)))
        if eta is not None:  # C = η K + … is summed as K was
            left_out += np.abs(float(eta.value) * found.values) * RoundOff(pencil).stiffness(left, right)
        if np.any(left_out):
            MX, CX = (pencil.apply(A, right) for A in (pencil.M, pencil.C))
            slope = np.abs(_product(pencil, left, 2 * found.values * MX + CX) * found.values)
            bounds = bounds + relative(left_out / np.maximum(slope, np.finfo(float).tiny))
        if len(bounds) < min(count, len(pairs.bounds)) or _digits(bounds[:count]) <= _digits(pairs.bounds[:count]):
            return pairs
        pencil.spectrum_error, self.used = kept.spectrum_error, True
        return Eigenpairs(found.values, right, left, found.errors, bounds)

    def _in_damping(self, pairs: Eigenpairs, count: int) -> float:
        """Return what the viscosity of the stiff strains, which is summed as before, would leave of the bounds."""
        eta = self.system.model.mechanics.damping.stiffness
        if eta is None:
            return 0.0
        bounds = np.maximum(pairs.bounds, pairs.bounds**2)[:count]
        return float(np.max(float(eta.value) * np.abs(pairs.values[:count]) * bounds, initial=0.0))


def _product(pencil: Pencil, Y: Array, X: Array) -> Array:
    """Return y^H x of all columns, over all ranks."""
    local = np.sum(Y.conj() * X, axis=0)
    return np.asarray(pencil.comm.allreduce(local) if pencil.comm.size > 1 else local)


def _digits(bounds: Array) -> float:
    """Return how many digits relative bounds leave, in the mean."""
    return -float(np.mean(np.log10(np.maximum(bounds, np.finfo(float).eps)))) if len(bounds) else 0.0


def saddle_pencil(saddle: Saddle, unit: float) -> Pencil:
    """Return the pencil of a saddle form, its unknowns scaled so that neither stiff nor soft strains are lost.

    Unknowns are scaled by what soft strains, or where there are none the inertia at a frequency of the size wanted,
    make of them; the equation of each strain by its largest entry.

    Args:
        saddle: the matrices.
        unit: size of the frequencies, 1/s.
    """
    pencil = Pencil(saddle.M, saddle.C, saddle.K)
    n = saddle.rest.getLocalSize()[0]
    d, mass = saddle.K.createVecRight(), saddle.M.getDiagonal().array[:n]
    rest = np.abs(saddle.rest.getDiagonal().array)
    size = np.maximum(rest, unit**2 * np.abs(mass))
    d.array[:] = 1.0
    d.array[:n] = power_of_two(1.0 / np.sqrt(np.where(size > 0.0, size, 1.0)))
    rows = saddle.factors.copy()
    rows.diagonalScale(None, _first(d, n))
    strains = _largest_in_rows(rows)[n:]
    d.array[n:] = power_of_two(1.0 / np.where(strains > 0.0, strains, 1.0))
    pencil.unknowns, pencil.pivots, pencil.unit = d, True, unit
    factors = saddle.factors.copy()
    indptr, indices, data = factors.getValuesCSR()
    factors.setValuesCSR(indptr, indices, np.abs(data))
    factors.assemble()
    pencil.factors = factors
    pencil.sizes = np.zeros(d.getLocalSize())
    pencil.sizes[:n] = np.sqrt(rest)
    return pencil


def _largest_in_rows(A: Any) -> Array:
    """Return the size of the largest entry of every owned row."""
    indptr, _, data = A.getValuesCSR()
    out = np.zeros(len(indptr) - 1)
    np.maximum.at(out, np.repeat(np.arange(len(out)), np.diff(indptr)), np.abs(data))
    return out


def _first(d: Any, n: int) -> Any:
    """Return a copy of a vector that is zero but for its first n owned entries."""
    out = d.copy()
    out.array[n:] = 0.0
    return out
