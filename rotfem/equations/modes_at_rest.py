"""The modes of a structure at rest: undeformed, undamped, without spin and loads, its hub held; and their families."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.numerics.damped import MORE
from rotfem.numerics.eigenproblem import Pencil
from rotfem.numerics.projection import summed, times

Array = npt.NDArray[Any]

#: Relative distance of frequencies that are one, so that any turn of their shapes is one.
EQUAL = 1e-6

#: Part of a span's energy that makes a direction of it.
NEW = 1e-6

#: Frequency, relative to the median of so many first ones, below which a motion is one that nothing holds.
HELD, FIRST = 1e-3, 6


@dataclass(frozen=True)
class ModesAtRest:
    """Modes of K x = ω² M x, the slowest first.

    Attributes:
        omega: ω, rad/s, (m,).
        shapes: x of unit mass, x·M x = 1, owned unknowns, (n, m).
        massed: M x, (n, m).
    """

    omega: Array
    shapes: Array
    massed: Array


def modes_at_rest(system: Any, count: int) -> ModesAtRest:
    """Return the first modes that vibrate, as many as wanted or as there are.

    Shapes of equal frequency are turned so that each belongs to one family as far as that can be.

    Args:
        system: equations of motion of a structure, its hub held.
        count: number of modes.

    Raises:
        ComputationError: the eigensolver failed.
    """
    M, K = system.matrices_at_rest()
    count = min(count, massed(M))
    pairs = Pencil(M, M.duplicate(), K).solve(min(count + MORE, massed(M)))
    found = np.abs(pairs.values)
    vibrates = found > HELD * np.median(found[:FIRST])
    omegas, columns = [], []
    for group in _equal(found[vibrates]):
        X = _real_span(system.comm, M, pairs.right[:, vibrates][:, group])
        energies = family_products(system, X, times(M, X))
        told_apart = sum(i * energy for i, energy in enumerate(energies.values()))
        columns.append(X @ np.linalg.eigh(_symmetric(np.asarray(told_apart)))[1])
        omegas += [float(np.mean(found[vibrates][group]))] * X.shape[1]
    X = np.hstack(columns)[:, :count]
    return ModesAtRest(np.array(omegas[:count]), X, times(M, X))


def _equal(omega: Array) -> list[Array]:
    """Return the numbers of frequencies, increasing, in groups of those that are one."""
    return np.split(np.arange(len(omega)), 1 + np.flatnonzero(np.diff(omega) > EQUAL * omega[1:]))


def _real_span(comm: MPI.Comm, M: Any, X: Array) -> Array:
    """Return real columns V, V·M V = 1, that span complex ones, eigenvectors of one frequency."""
    parts = np.hstack([X.real, X.imag]) / np.sqrt(_energies(comm, M, X.real) + _energies(comm, M, X.imag)).max()
    sizes, turns = np.linalg.eigh(_symmetric(summed(comm, parts.T @ times(M, parts))))
    keep = sizes > NEW * sizes[-1]
    V = np.asarray(parts @ (turns[:, keep] / np.sqrt(sizes[keep])))
    return np.asarray(V / np.sqrt(_energies(comm, M, V)))


def _energies(comm: MPI.Comm, M: Any, X: Array) -> Array:
    """Return x·M x of real columns."""
    return np.asarray(summed(comm, np.sum(X * times(M, X), axis=0)))


def massed(M: Any) -> int:
    """Return how many unknowns have a mass: as many modes there are, and infinite eigenvalues beyond them."""
    indptr, _, data = M.getValuesCSR()
    rows = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))
    return int(M.comm.tompi4py().allreduce(len(np.unique(rows[data != 0.0]))))


def family_products(system: Any, X: Array, MX: Array) -> dict[str, Array]:
    """Return family ↦ x_i^H M x_j of the components that belong to it, over all ranks, (m, m).

    Args:
        system: equations of motion of a structure.
        X: owned unknowns, (n, m); what is behind those of the structure is left aside.
        MX: M X.
    """
    structure, bs = system.structure, system.V.dofmap.index_map_bs
    owned = system.V.dofmap.index_map.size_local * bs
    x, mx = (structure.oriented(Y[:owned].reshape(-1, bs, X.shape[1])) for Y in (X, MX))
    parts = {name: list(components) for name, (components, _) in structure.families.items()}
    return {
        name: np.asarray(summed(system.comm, np.einsum("nci,ncj->ij", x[:, c].conj(), mx[:, c])))
        for name, c in parts.items()
    }


def _symmetric(A: Array) -> Array:
    return 0.5 * (A + A.T)
