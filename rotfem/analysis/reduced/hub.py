"""Reduced models on a free hub: its angle ψ is one more unknown, and its equation one more.

With the angular momentum of the structure about the axis, H = 2Ω T0(η) + T1(η, η̇) (`ReducedModel.of_spin`),

    I ψ̈ + c ψ̇ + dH/dt = M(t) + N,    dH/dt = 2Ω̇ T0 + 2Ω ∂T0/∂η·η̇ + ∂T1/∂η·η̇ + ∂T1/∂η̇·η̈,

N the moment of all that acts from outside. N is linear in the constants of base, gravity and loads. Its part of each is
read from the hub's row (`rotfem.equations.bordered`) at rest, along the basis and to second order,

    N = Σ c (n + n_q·η + ½ η·Q η).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.reduced.equations import Excitation, Forces, HeldEquations
from rotfem.analysis.reduced.model import ReducedModel
from rotfem.analysis.reduced.solution import Solution
from rotfem.errors import InputError
from rotfem.mechanics.time_signals import POINTS, WEIGHTS
from rotfem.numerics.projection import summed

Array = npt.NDArray[np.float64]

#: Rotation, or displacement over the length, by which a shape is moved for a derivative that is linear in it.
SMALL = 1e-5

#: Part of the largest change that is round-off.
ROUND_OFF = 1e-9

#: Times at which the speed of a rigid structure is known.
RIGID = 2001

#: Effects of which the angular momentum is that of the equations.
OF_MOMENTUM = ("coriolis", "centrifugal", "euler")


class HubMoment:
    """The moment of a structure on its free hub, dH/dt and N.

    Args:
        model: of the structure.
        row: the hub's equation.

    Attributes:
        inertia: of the undeformed structure about the axis, kg·m².

    Raises:
        InputError: the equations lack an effect that angular momentum has.
    """

    def __init__(self, model: ReducedModel, row: Any):
        self.model, self.row, self.system = model, row, model.system
        effects = self.system.model.effects
        for name in OF_MOMENTUM:
            if name not in effects:
                why = f'lacks "{name}", which the reduced model of a free hub needs; leave model.reduced out'
                raise InputError("model.effects", list(effects), why)
        self._coupled = float(row.coupled)
        (self._load, self._stiffness), (self.slope, self._coupling), T0 = model.of_spin()
        self.slope = self._coupled * self.slope
        self.inertia = 2 * T0
        self._read_outside()

    def _read_outside(self) -> None:
        """Read n, n_q and Q of every component of a constant, in the order of `_entries`."""
        system, m, zero = self.system, self.model.size, self.system.zeros()
        constants = {name: c for name, c in system.model.frame.constants.items() if name not in ("w", "dw")}
        constants |= {name: c for name, (c, _) in system.structure.load_constants.items()}
        everything = [*system.model.frame.constants.values(), *constants.values()]
        kept = [c.value.copy() for c in everything]
        for c in everything:
            c.value[...] = 0.0
        self._entries = [(name, i) for name, c in constants.items() for i in range(c.value.size)]
        size = len(self._entries)
        self._n, self._slopes, self._matrices = np.zeros(size), np.zeros((size, m)), np.zeros((size, m, m))
        for k, (name, i) in enumerate(self._entries if self.row.has_outside else ()):
            constants[name].value.flat[i] = 1.0
            system.structure.update_loads()
            system.set_state(zero)
            self._n[k] = -self.row.work()
            if self.row.coupled and m:
                self._slopes[k] = rest = self._slope(zero)
                self._matrices[k] = self._changes(rest)
            constants[name].value.flat[i] = 0.0
        for c, value in zip(everything, kept, strict=True):
            c.value[...] = value
        system.structure.update_loads()

    def _slope(self, q: Array) -> Array:
        """Return the derivative of N by q along the basis at a state, (m,)."""
        self.system.set_state(q)
        vector, owned = self.row.row((1.0, 0.0, 0.0)).array, self.model.owned
        return -np.asarray(summed(self.system.comm, self.model.V[owned].T @ vector[owned]))

    def _changes(self, rest: Array) -> Array:
        """Return the second derivative of N by q along the basis; zero where no direction shows one."""

        def change(shape: Array) -> Array:
            size = SMALL / max(self.system.size(shape), 1e-300)
            return np.asarray((self._slope(size * shape) - rest) / size)

        any_direction = change(self.model.V @ np.cos(np.arange(1.0, self.model.size + 1)))
        if np.abs(any_direction).max() <= ROUND_OFF * np.abs(rest).max() / SMALL:
            return np.zeros((self.model.size,) * 2)
        return np.array([change(column) for column in self.model.V.T]).T

    # --- at many times -----------------------------------------------------------------------------------------------

    def outside(self, constants: dict[str, Array], q: Array) -> Array:
        """Return N at times (n,), N·m.

        Args:
            constants: values of those of frame and loads, by name, (n, size).
            q: coordinates of the structure, (n, m).
        """
        if not self._entries:
            return np.zeros(len(q))
        c = np.stack([constants[name][:, i] for name, i in self._entries], axis=1)
        slopes = c @ self._slopes + 0.5 * np.einsum("nij,nj->ni", np.tensordot(c, self._matrices, 1), q)
        return np.asarray(c @ self._n + np.sum(slopes * q, axis=1))

    def of_momentum(self, speed: Array, rate: Array, q: Array, v: Array, a: Array) -> Array:
        """Return dH/dt (n,), N·m; that of a rigid structure if the hub is uncoupled.

        Args:
            speed: Ω at n times, rad/s.
            rate: Ω̇ there.
            q: coordinates of the structure, (n, m).
            v: their rates.
            a: their accelerations.
        """
        q, v, a = (self._coupled * x for x in (q, v, a))
        bent = q @ self._stiffness
        T0 = 0.5 * self.inertia - q @ self._load - 0.5 * np.sum(q * bent, axis=1)
        change = -(v @ self._load) - np.sum(v * bent, axis=1)
        of_T1 = a @ self.slope + np.sum((a @ self._coupling) * q + (v @ self._coupling) * v, axis=1)
        return np.asarray(2 * rate * T0 + 2 * speed * change + of_T1)


class FreeHubEquations(HeldEquations):
    """The equations of a reduced model and its free hub; unknowns are the coordinates and the angle, which is last.

    Args:
        model: the basis.
        excitation: what acts.
        bordered: equations of structure and hub.
        further: of times (n,), s, forces (n, m + 1) that are added; none if None.
    """

    def __init__(self, model: ReducedModel, excitation: Excitation, bordered: Any, further: Forces | None = None):
        self.model, self.excitation, self.further = model, excitation, further
        self.within, self.constant = excitation.within, False
        self.bordered, self.hub, self.moment = bordered, bordered.hub, HubMoment(model, bordered.row)

    def start(self, shape: Array | None) -> tuple[Array, Array]:
        """Return coordinates with the angle 0, and rates with the speed of the hub, (m + 1,)."""
        q, v = super().start(shape)
        return np.append(q, 0.0), np.append(v, self.hub.speed)

    def turn(self, t: Array, solution: Solution | None = None) -> Array:
        """Return angle, speed and its rate at times (n,), (n, 3), as of a rigid structure if there is no solution."""
        if solution is not None:
            return np.stack([x[:, -1] for x in solution.at(t)], axis=1)
        return rigid_turn(self.bordered, t)

    def reference(self, t: float, y: Array, v: Array) -> tuple[Array, Array, Array]:
        """Return M, C, K (m + 1, m + 1) at a time (s), angle and speed, coupled as at rest; a spring holds the angle.

        The spring, of one radian a second, is taken off again by the iteration: without it the modes of a rigid turn
        would be dependent.
        """
        m, turn = self.model.size, np.array([[y[-1], v[-1], 0.0]])
        there = np.array([t])
        rates = turn + np.array([[0.0, 0.0, 1.0]])
        (*small, f), (*_, pushed) = (self.model.operators(self.excitation.factors(there, x)) for x in (turn, rates))
        inertia = self.hub.inertia + self.moment.inertia
        M, C, K = (np.zeros((m + 1, m + 1)) for _ in range(3))
        for whole, own, corner in zip((M, C, K), small, (inertia, self.hub.damping, inertia), strict=True):
            whole[:m, :m], whole[m, m] = own[0], corner
        M[:m, m], M[m, :m] = (pushed - f)[0], self.moment.slope
        return M, C, K

    def at(self, t: Array) -> Callable[[Array, Array, Array], Array]:
        """Return what the equations of structure and hub leave of states, (n, m + 1) each, with the angle last."""
        loads, torque = self.excitation.loads(t), self.hub.torque.many(t, after=True)
        further = 0.0 if self.further is None else self.further(t)

        def residual(y: Array, dy: Array, ddy: Array) -> Array:
            turn, (q, v, a) = np.stack([x[:, -1] for x in (y, dy, ddy)], axis=1), (x[:, :-1] for x in (y, dy, ddy))
            constants = self.excitation.constants(t, turn, loads)
            c = np.asarray(self.model.system.factors(constants, len(t)))
            M, C, K, f = self.model.operators(c)
            out = f + sum(np.einsum("nij,nj->ni", A, x) for A, x in ((M, a), (C, v), (K, q)))
            own = self.hub.inertia * turn[:, 2] + self.hub.damping * turn[:, 1] - torque
            own = own + self.moment.of_momentum(turn[:, 1], turn[:, 2], q, v, a) - self.moment.outside(constants, q)
            return np.column_stack([out, own]) + further

        return residual

    def given(self, solution: Solution, times: Array) -> dict[str, Array]:
        """Return angular impulse (N·m·s) and work (J) from outside until times: torque, brake, loads (see `State`)."""
        grid = np.union1d(solution.ends, times)
        t = self.within(grid[:-1], grid[1:], POINTS)
        turn, (q, _, _) = self.turn(t.ravel(), solution), self.coordinates(solution, t.ravel())
        turn[:, 2] = 0.0
        torque = self.hub.torque.many(t.ravel()) - self.hub.damping * turn[:, 1]
        constants = self.excitation.constants(t.ravel(), turn)
        rates = {"impulse": torque + self.moment.outside(constants, q), "work": torque * turn[:, 1]}
        rows, out = np.searchsorted(grid, times), {}
        for name, rate in rates.items():
            parts = np.diff(grid) * (rate.reshape(t.shape) @ WEIGHTS)
            out[name] = np.concatenate([[0.0], np.cumsum(parts)])[rows]
        return out


def rigid_turn(bordered: Any, t: Array) -> Array:
    """Return angle, speed and its rate (n, 3) of a free hub at times (n,), s, as if the structure were rigid."""
    held, hub = bordered.held, bordered.hub
    inertia = hub.inertia + (2 * held.rest_inertia if "w" in held.model.frame.constants else 0.0)
    fine = np.unique(np.concatenate([t, np.linspace(0.0, float(t[-1]), RIGID)]))
    speed = hub.rigid_speeds(fine, inertia)
    angle = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(fine) * (speed[1:] + speed[:-1]))])
    return np.column_stack([np.interp(t, fine, x) for x in (angle, speed, np.gradient(speed, fine))])
