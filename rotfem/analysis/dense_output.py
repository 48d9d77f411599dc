"""States between steps: rows of a history at equal distances, independent of the steps.

Between two states all unknowns are the polynomials through what is known at both: through q and q̇ cubics, of order 4,
and through q, q̇ and q̈ quintics, of order 6 (Hermite). Cubics are for schemes up to order 2, whose accelerations of
unresolved vibrations are noise, and for other schemes where the accelerations are such noise.

All unknowns have the same weights, so linear relations between them at both ends, as zero shear strain of a thin plate,
hold in between.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from mpi4py import MPI
from numpy.polynomial.polynomial import polyder, polyval

from rotfem.analysis.schemes import Array, State
from rotfem.analysis.time_grid import CLOSE
from rotfem.equations.system import System

#: Part of the cubic's largest acceleration by which those of the states may differ from its own; else they are noise.
NOISE = 0.5


def multiples(interval: float, end: float) -> Array:
    """Return 0, the multiples of an interval (s) before the end (s), and the end."""
    return np.append(np.arange(int(np.ceil(end / interval - CLOSE))) * interval, end)


class RowTimes:
    """Interpolates the steps of a march at given times.

    Args:
        times: increasing, s; those up to the start of the march are passed over.
        order: of the scheme that steps.
        comm: MPI communicator of the processes that share the unknowns.
        start: of the march, s.
    """

    def __init__(self, times: Array, order: int, comm: MPI.Comm, start: float = 0.0):
        self.times, self.order, self.comm = times, order, comm
        self._close = CLOSE * float(np.diff(times).min(initial=np.inf)) if len(times) > 1 else 0.0
        self._next = int(np.searchsorted(times, start + self._close, side="right"))
        self._reached: list[State] = []

    def __call__(self, old: State, new: State) -> None:
        """Find the rows in a step from an old to a new state."""
        last = new.t + self._close
        if not self.times[self._next : self._next + 1] <= last:  # there is none, as in most of many short steps
            return
        end = int(np.searchsorted(self.times, last, side="right"))
        times = list(map(float, self.times[self._next : end]))
        self._next = end
        ends = [new] if times and times[-1] > new.t - self._close else []
        self._reached += between(old, new, times[: len(times) - len(ends)], self.order, self.comm) + ends

    def taken(self) -> list[State]:
        """Return the states of the rows since the last call."""
        found, self._reached = self._reached, []
        return found


def between(old: State, new: State, times: list[float], order: int, comm: MPI.Comm) -> list[State]:
    """Return the states at times (s) within a step; work and impulse of a free hub are linear in it."""
    if not times:
        return []
    h, curve = new.t - old.t, polynomial(old, new, order, comm)
    shares = (np.array(times, dtype=np.float64) - old.t) / np.float64(h)
    moved = [x / h**k for k, x in enumerate(derivatives(curve, shares))]
    out = []
    for t, share, q, v, a in zip(times, shares, *moved, strict=True):
        hub_work = None
        if old.hub_work is not None and new.hub_work is not None:
            hub_work = np.asarray(old.hub_work + share * (new.hub_work - old.hub_work))
        out.append(new.changed(t=t, q=q, v=v, a=a, memory=None, hub_work=hub_work))
    return out


def polynomial(old: State, new: State, order: int, comm: MPI.Comm) -> Array:
    """Return the coefficients of q in a step, by powers of (t − t_old)/h, (powers, unknowns)."""
    h = new.t - old.t
    data = np.array((old.q, old.v, old.a, new.q, new.v, new.a)) * np.array([1.0, h, h * h] * 2)[:, None]
    cubic, bent = _coefficients(2)
    points = data[[0, 1, 3, 4]]
    if order > 2:
        accelerations = bent.dot(points)
        sizes = [float(np.abs(x).max(initial=0.0)) for x in (data[2::3] - accelerations, accelerations)]
        off, size = sizes if comm.size == 1 else (comm.allreduce(x, MPI.MAX) for x in sizes)
        if off <= NOISE * size:
            return np.asarray(_coefficients(3)[0].dot(data))
    return np.asarray(cubic.dot(points))


@cache
def _coefficients(known: int) -> tuple[Array, Array]:
    """Return the coefficients, by power, of the polynomials that are 1 in one value of two ends and 0 in the others.

    With them come their second derivatives at both ends.
    """
    ends, number = np.array([0.0, 1.0]), 2 * known
    at = np.stack(derivatives(np.eye(number), ends)[:known], axis=1)
    out = np.asarray(np.linalg.inv(at.reshape(number, number)), dtype=np.float64)
    return out, derivatives(out, ends)[2]


def derivatives(curve: Array, x: Array) -> list[Array]:
    """Return polynomials of coefficients (powers, number) and their first two derivatives at x, (n, number) each."""
    return [np.asarray(polyval(x, polyder(curve, k)), dtype=np.float64).T for k in range(3)]


def write_state(system: System, state: State) -> None:
    """Write a state into a system whose time is set, with the acceleration that the equations give at it.

    Forces at the root depend on it.
    """
    system.set_state(state.q, state.v, state.a)
    if not state.balanced:
        system.set_state(state.q, state.v, state.a + system.acceleration())
