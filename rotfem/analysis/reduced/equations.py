"""The equations of a reduced model over time: what acts on it, and what is left of the equations by a motion.

What acts is read as arrays: the factors cₚ of all pieces at many times at once.

On a free hub the angle ψ is one more unknown. With the angular momentum of the structure about the axis,
H = 2Ω T0(η) + T1(η, η̇) (`ReducedModel.of_spin`), its equation is

    I ψ̈ + c ψ̇ + dH/dt = M(t) + N,    dH/dt = 2Ω̇ T0 + 2Ω ∂T0/∂η·η̇ + ∂T1/∂η·η̇ + ∂T1/∂η̇·η̈,

N the moment of all that acts from outside. N is linear in the constants of base, gravity and loads. Its part of each is
read from the hub's row (`rotfem.equations.bordered`) at rest, N = Σ c (n + n_q·η).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.reduced.manifold import Manifold
from rotfem.analysis.reduced.model import ReducedModel
from rotfem.analysis.reduced.solution import Solution, States
from rotfem.analysis.time_grid import find_jumps
from rotfem.errors import InputError
from rotfem.mechanics.pitch import in_turned_frame
from rotfem.mechanics.time_signals import POINTS, WEIGHTS
from rotfem.mechanics.time_signals import SAME as RESOLVED
from rotfem.numerics.projection import summed

Array = npt.NDArray[np.float64]

#: Forces (n, unknowns) at times (n,), s.
Forces = Callable[[Array], Array]

#: Relative distance from a breakpoint at which a signal has the value that it has on that side of it.
ASIDE = 4 * RESOLVED


class Excitation:
    """Motion of the frame, gravity and loads over a stretch of time, and the factors of the pieces they make.

    Args:
        system: equations of a linear theory, the hub held.
        times: times of the history, increasing, s.

    Attributes:
        knots: breakpoints (s) between which all signals are smooth and nearly straight; first and last are ends.
    """

    def __init__(self, system: Any, times: Array):
        self.system, self.motion, self.frame = system, system.motion, system.model.frame
        self._signals = {signal.name: signal for signal in system.signals}
        for signal in system.signals:
            find_jumps(signal, times)
        first, last = float(times[0]), float(times[-1])
        points = np.concatenate([np.empty(0), *(np.concatenate([c.knots, c.smooth]) for c in system.signals)])
        inside = np.unique(points[(points > first) & (points < last)])
        knots = np.concatenate([[first], inside, [last]])
        self.knots: Array = knots[np.append(np.diff(knots) > ASIDE * (last - first), True)]

    def within(self, begin: Array, end: Array, shares: Array) -> Array:
        """Return the times at these shares of intervals, never on the wrong side of their ends; (n, shares), s."""
        t = begin[:, None] + (end - begin)[:, None] * shares
        low, high = begin[:, None] * (1 + ASIDE), end[:, None] * (1 - ASIDE)
        return np.asarray(np.clip(t, np.minimum(low, high), high))

    def samples(self) -> Array:
        """Return times (s) between all breakpoints, five between two and 40 at least, at no period's distance."""
        number = max(5, -(-40 // (len(self.knots) - 1)))
        shares = np.sort(np.random.default_rng(0).random(number))
        return self.within(self.knots[:-1], self.knots[1:], shares).ravel()

    def turn(self, t: Array) -> Array:
        """Return prescribed angle (0 where no gravity needs it), speed and its rate at times (n,), (n, 3)."""
        angle = [self.motion.angle(float(s)) if "gravity" in self.frame.constants else 0.0 for s in t]
        speed, rate = (
            self._signal(f"motion.{name}", getattr(self.motion, name), t)[:, 0] for name in ("speed", "rate")
        )
        return np.column_stack([angle, speed, rate])

    def factors(self, t: Array, turn: Array | None = None) -> Array:
        """Return the factor of every piece at times (n,), shape (n, pieces); of a turn (n, 3) as prescribed if None."""
        return np.asarray(self.system.factors(self.constants(t, self.turn(t) if turn is None else turn), len(t)))

    def constants(self, t: Array, turn: Array, loads: dict[str, Array] | None = None) -> dict[str, Array]:
        """Return the values of all constants of frame and loads, by name, (n, size).

        Args:
            t: times (n,), s.
            turn: angle (rad), speed and rate of the frame about its axis, (n, 3).
            loads: those of the loads, where they are known.
        """
        moved = self._moved(t, *turn.T)
        values = {name: moved[name][:, self.frame.slices[name]] for name in self.frame.constants}
        return values | (self.loads(t) if loads is None else loads)

    def loads(self, t: Array) -> dict[str, Array]:
        """Return the values of the constants of loads at times (n,), by name, (n, size)."""
        values = {}
        for name, amplitude in self.system.structure.load_constants.items():
            if amplitude.follows_nodes:
                values[name] = np.array([amplitude.at(float(s)) for s in t])
            else:
                values[name] = self._signal(f"loads.{name}", amplitude.at, t)[:, : amplitude.value.size]
        return values

    def _moved(self, t: Array, angle: Array, speed: Array, rate: Array) -> dict[str, Array]:
        """Return what the frame's constants are at times, by name, as far as there are such, (n, components)."""
        axis, names, pitch = self.motion.axis, self.frame.constants, self.motion.pitch
        values: dict[str, Array] = {"w": np.outer(speed, axis), "dw": np.outer(rate, axis)}
        if "a_o" in names or pitch is not None:
            values["a_o"] = self._signal("motion.base_acceleration", self.motion.base_acceleration, t)
        gravity = in_turned_frame(axis, angle[:, None], np.asarray(self.system.model.problem.loads.gravity))
        if pitch is None:
            return values | {"gravity": gravity}
        beta, d_beta, dd_beta = (self._signal(name, at, t)[:, 0] for name, at in pitch.signals.items())
        values = pitch.moved((beta - pitch.start, d_beta, dd_beta), values["w"], values["dw"], values["a_o"])
        return values | {"gravity": pitch.seen((beta - pitch.start)[:, None], gravity)}

    def _signal(self, name: str, at: Any, t: Array) -> Array:
        """Return the values of a signal, or of what does not change, at times (n,), shape (n, components)."""
        known = self._signals.get(name)
        values = known.values(t) if known else np.tile(np.atleast_1d(np.asarray(at(0.0), dtype=float)), (len(t), 1))
        return np.asarray(values, dtype=float)


class HeldEquations:
    """The equations of a reduced model whose hub moves as prescribed.

    Args:
        model: the basis.
        excitation: what acts.

    Attributes:
        further: of times (n,), s, forces (n, unknowns) that are added; none if None.
    """

    further: Forces | None = None

    def __init__(self, model: ReducedModel, excitation: Excitation):
        self.model, self.excitation, self.within = model, excitation, excitation.within
        matrices = model.operators(excitation.factors(excitation.samples()))
        self.constant = all(np.all(np.ptp(A, axis=0) <= 1e-12 * np.abs(A).max(initial=0.0)) for A in matrices)

    def start(self, shape: Array | None) -> tuple[Array, Array]:
        """Return coordinates and rates (m,) at the start: of a shape (local dof array), or undeformed; at rest."""
        rest: Array = np.zeros(self.model.size)
        return rest if shape is None else self.model.coordinates(shape), rest

    def turn(self, t: Array, solution: Solution | None = None) -> Array:
        """Return angle (rad), speed and its rate of the frame at times (n,), s, (n, 3)."""
        return self.excitation.turn(t)

    def coordinates(self, solution: Solution, t: Array) -> States:
        """Return the states (n, m) of the structure in a solution at times (n,), s."""
        q, v, a = (x[:, : self.model.size] for x in solution.at(t))
        return q, v, a

    def reference(self, t: float, y: Array, v: Array) -> tuple[Array, Array, Array]:
        """Return M, C, K (m, m) at a time, s."""
        M, C, K = self.model.operators(self.excitation.factors(np.array([t])))
        return M[0], C[0], K[0]

    def at(self, t: Array) -> Callable[[Array, Array, Array], Array]:
        """Return M a + C v + K q + f and further forces (n, m), a function of q, v and a (n, m)."""
        own, further = self.model.residual(self.excitation.factors(t)), self._further(t)
        return lambda q, v, a: own(q, v, a) + further

    def _further(self, t: Array) -> Array | float:
        return 0.0 if self.further is None else self.further(t)

    def second_order(self, manifold: Manifold, solution: Solution) -> Forces:
        """Return the forces (n, unknowns) of a linear solution on a manifold, a function of times; none on a hub.

        The four nodes of a step resolve vibrations of half a period in it; quicker ones are left out.
        """
        fastest = np.pi / float(np.diff(solution.ends).max())

        def forces(t: Array) -> Array:
            c = self.excitation.factors(t, self.turn(t, solution))
            states, m = solution.at(t, fastest), self.model.size
            out = np.zeros_like(states[0])
            out[:, :m] = manifold.forces(c, *(x[:, :m] for x in states))
            return out

        return forces


class FreeHubEquations(HeldEquations):
    """The equations of a reduced model and its free hub; unknowns are the coordinates and the angle, which is last.

    Args:
        model: the basis.
        excitation: what acts.
        bordered: equations of structure and hub.

    Raises:
        InputError: the equations lack an effect that angular momentum has.
    """

    def __init__(self, model: ReducedModel, excitation: Excitation, bordered: Any):
        self.model, self.excitation, self.within, self.constant = model, excitation, excitation.within, False
        self.bordered, self.hub, self._coupled = bordered, bordered.hub, float(bordered.row.coupled)
        effects = model.system.model.effects
        for name in ("coriolis", "centrifugal", "euler"):
            if name not in effects:
                why = f'lacks "{name}", which the reduced model of a free hub needs; leave model.reduced out'
                raise InputError("model.effects", list(effects), why)
        self._load, self._stiffness = model.of_spin("centrifugal", 2)
        slope, self._coupling = model.of_spin("euler", 1)
        self._slope, self._inertia = self._coupled * slope, 2 * model.system.rest_inertia
        self._read_outside()

    def _read_outside(self) -> None:
        """Read n and n_q of every component of a constant, in the order of `_entries`."""
        system, row, V = self.model.system, self.bordered.row, self.model.V[self.model.owned]
        constants = {name: c for name, c in system.model.frame.constants.items() if name not in ("w", "dw")}
        constants |= system.structure.load_constants
        everything = [*system.model.frame.constants.values(), *constants.values()]
        kept = [c.value.copy() for c in everything]
        for c in everything:
            c.value[...] = 0.0
        self._entries = [(name, i) for name, c in constants.items() for i in range(c.value.size)]
        self._n, self._n_q = np.zeros(len(self._entries)), np.zeros((len(self._entries), self.model.size))
        for k, (name, i) in enumerate(self._entries if row.has_outside else ()):
            constants[name].value.flat[i] = 1.0
            system.structure.update_loads()
            system.set_state(system.zeros())
            self._n[k] = -row.work()
            self._n_q[k] = -np.asarray(summed(system.comm, V.T @ row.row((1.0, 0.0, 0.0)).array[self.model.owned]))
            constants[name].value.flat[i] = 0.0
        for c, value in zip(everything, kept, strict=True):
            c.value[...] = value
        system.structure.update_loads()

    def _outside(self, constants: dict[str, Array], q: Array) -> Array:
        """Return N at n times (n,), N·m, of the constants of frame and loads (n, size) and coordinates (n, m)."""
        if not self._entries:
            return np.zeros(len(q))
        c = np.stack([constants[name][:, i] for name, i in self._entries], axis=1)
        return np.asarray(c @ self._n + np.sum((c @ self._n_q) * q, axis=1))

    def _of_momentum(self, turn: Array, q: Array, v: Array, a: Array) -> Array:
        """Return dH/dt (n,), N·m, of a turn (n, 3) and states (n, m); of a rigid structure if the hub is uncoupled."""
        q, v, a = (self._coupled * x for x in (q, v, a))
        bent = q @ self._stiffness
        T0 = 0.5 * self._inertia - q @ self._load - 0.5 * np.sum(q * bent, axis=1)
        change = -(v @ self._load) - np.sum(v * bent, axis=1)
        of_T1 = a @ self._slope + np.sum((a @ self._coupling) * q + (v @ self._coupling) * v, axis=1)
        return np.asarray(2 * turn[:, 2] * T0 + 2 * turn[:, 1] * change + of_T1)

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
        """Return M, C, K (m + 1, m + 1) at a time (s), angle and speed, coupled as at rest."""
        m, turn = self.model.size, np.array([[y[-1], v[-1], 0.0]])
        there = np.array([t])
        rates = turn + np.array([[0.0, 0.0, 1.0]])
        factors = [self.excitation.factors(there, x) for x in (turn, rates)]
        small, (f, pushed) = self.model.operators(factors[0]), (self.model.load(c) for c in factors)
        inertia = self.hub.inertia + self._inertia
        M, C, K = (np.zeros((m + 1, m + 1)) for _ in range(3))
        for whole, own, corner in zip((M, C, K), small, (inertia, self.hub.damping, 0.0), strict=True):
            whole[:m, :m], whole[m, m] = own[0], corner
        M[:m, m], M[m, :m] = (pushed - f)[0], self._slope
        return M, C, K

    def at(self, t: Array) -> Callable[[Array, Array, Array], Array]:
        """Return what the equations of structure and hub leave of states, (n, m + 1) each, with the angle last."""
        loads, torque = self.excitation.loads(t), self.hub.torque.many(t, after=True)
        further = self._further(t)

        def residual(y: Array, dy: Array, ddy: Array) -> Array:
            turn, (q, v, a) = np.stack([x[:, -1] for x in (y, dy, ddy)], axis=1), (x[:, :-1] for x in (y, dy, ddy))
            constants = self.excitation.constants(t, turn, loads)
            out = self.model.residual(np.asarray(self.model.system.factors(constants, len(t))))(q, v, a)
            own = self.hub.inertia * turn[:, 2] + self.hub.damping * turn[:, 1] - torque
            own = own + self._of_momentum(turn, q, v, a) - self._outside(constants, q)
            return np.column_stack([out, own]) + further

        return residual

    def given(self, solution: Solution, times: Array) -> Array:
        """Return work (J) and angular impulse (N·m·s) from outside until times (n,): torque, brake, loads; (n, 2)."""
        grid = np.union1d(solution.ends, times)
        t = self.within(grid[:-1], grid[1:], POINTS).ravel()
        turn, (q, _, _) = self.turn(t, solution), self.coordinates(solution, t)
        turn[:, 2] = 0.0
        torque = self.hub.torque.many(t) - self.hub.damping * turn[:, 1]
        outside = self._outside(self.excitation.constants(t, turn), q)
        rates = np.column_stack([torque * turn[:, 1], torque + outside]).reshape(-1, len(POINTS), 2)
        parts = np.diff(grid)[:, None] * np.einsum("j,njk->nk", WEIGHTS, rates)
        return np.asarray(np.vstack([np.zeros(2), np.cumsum(parts, axis=0)])[np.searchsorted(grid, times)])


def rigid_turn(bordered: Any, t: Array) -> Array:
    """Return angle, speed and its rate (n, 3) of a free hub at times (n,), s, as if the structure were rigid."""
    held, hub = bordered.held, bordered.hub
    inertia = hub.inertia + (2 * held.rest_inertia if "w" in held.model.frame.constants else 0.0)
    fine = np.unique(np.concatenate([t, np.linspace(0.0, float(t[-1]), 2001)]))
    speed = hub.rigid_speeds(fine, inertia)
    angle = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(fine) * (speed[1:] + speed[:-1]))])
    return np.column_stack([np.interp(t, fine, x) for x in (angle, speed, np.gradient(speed, fine))])
