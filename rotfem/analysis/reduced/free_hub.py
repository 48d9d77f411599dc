"""Reduced models on a free hub: its angle is one more unknown, and Newton's method is one of whole trajectories.

The equations are linear in the coordinates at a given speed, and linear in speed and rate but for Omega². So they are
linearised about a trajectory of some steps, the linear ones solved by batched collocation, and again about that one: a
few rounds are enough.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.reduced.collocation import BATCH, NODES, Steps, collocate
from rotfem.analysis.reduced.drive import Drive
from rotfem.analysis.reduced.hub_moment import Directions, HubMoment
from rotfem.analysis.reduced.model import ReducedModel
from rotfem.analysis.reduced.solution import Solution, Trajectory
from rotfem.errors import ComputationError
from rotfem.mechanics.courses import POINTS, WEIGHTS

Array = npt.NDArray[np.float64]

#: Steps that are solved together, Newton iterations that they may take, and relative change that ends them.
WINDOW, ITERATIONS, CLOSE = 64, 15, 1e-11

#: Times and states (coordinates with the angle last, rates and accelerations, (n, m + 1)) ↦ forces (n, m + 1).
Lacking = Callable[[Array, tuple[Array, ...]], Array]

#: Change of angle, speed and rate for derivatives, the last two exact; how much longer steps of small things are.
BESIDE, LONGER = np.array([1e-6, 1.0, 1.0]), 2


class FreeDrive(Drive):
    """What drives a structure whose hub is free: angle and speed are those of the last trajectory found.

    Before there is one they are those of a rigid structure.

    Args:
        system: bordered equations of a linear theory.
        times: times of the history, increasing, s.
    """

    def __init__(self, system: Any, times: Array):
        super().__init__(system.held, times)
        self.hub, self.bordered = system.hub, system
        self.steps: Steps | None = None
        inertia = self.hub.inertia + (2 * self.system.rest_inertia if "w" in self.frame.constants else 0.0)
        fine = np.unique(np.concatenate([self.knots, np.linspace(self.knots[0], self.knots[-1], 2001)]))
        self._rigid = fine, self.hub.rigid_speeds(fine, inertia)

    @property
    def whole(self) -> Any:
        """The system with its hub, whose effects can be switched."""
        return self.bordered

    def active(self) -> npt.NDArray[np.int64]:
        """Return the numbers of the pieces that are there at any speed and rate, as nobody knows what they will be."""
        t = self.looks()
        ones = np.ones(len(t))
        return np.flatnonzero(np.abs(self.made_of(self.constants(t, ones, ones, ones), len(t))).max(axis=0) > 0.0)

    def angle(self, t: Array) -> Array:
        """Return the angle of the hub at times (n,), rad."""
        if self.steps is not None:
            return self.steps.at(t)[0][:, -1]
        fine, speed = self._rigid
        turned = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(fine) * (speed[1:] + speed[:-1]))])
        return np.asarray(np.interp(t, fine, turned))

    def speed(self, t: Array) -> Array:
        """Return the speed of the hub at times (n,), rad/s."""
        return np.asarray(np.interp(t, *self._rigid) if self.steps is None else self.steps.at(t)[1][:, -1])

    def rate(self, t: Array) -> Array:
        """Return the rate of the speed of the hub at times (n,), rad/s²."""
        if self.steps is not None:
            return self.steps.rates_of(t)[:, -1]
        fine, speed = self._rigid
        return np.asarray((np.diff(speed) / np.diff(fine))[np.clip(np.searchsorted(fine, t) - 1, 0, len(fine) - 2)])


class FreeSolution(Solution):
    """Solves reduced models on a free hub; what follows them sees the angle as something prescribed."""

    drive: FreeDrive

    def __init__(self, drive: FreeDrive, times: Array):
        super().__init__(drive, times)
        self.constant = False
        self.moment: HubMoment | None = None
        #: The trajectory of last time, from which the next one starts: by coarser steps, or by other effects.
        self._known: Steps | None = None

    @property
    def hub(self) -> FreeSolution:
        """This solution, which has a free hub."""
        return self

    def again(self, longer: int = 1) -> FreeSolution:
        """Return a solution of equations with effects switched off or on, by steps so many times as long."""
        other = free_solution(self.drive.bordered, self.times)
        other.parts, other._steps, other._known = -(-self.parts // longer), self._steps, self._known
        return other

    def solve(self, model: ReducedModel, q: Array, v: Array) -> Trajectory:
        """Return the history of a model from coordinates and rates (m,), and leave its angle in the drive.

        Raises:
            ComputationError: no trajectory is found, or it is not finite.
        """
        if self.moment is None or self.moment.size != model.size:
            self.moment = HubMoment(Directions.of(model), self.drive.bordered.row)
        ends = self.ends(model)
        if self._known is not None and self._known.q.shape[1] != model.size + 1:
            self._known = None
        y, dy = np.append(q, 0.0), np.append(v, self.drive.hub.speed)
        parts: list[Steps] = []
        first, width = 0, WINDOW
        while first < len(ends) - 1:
            window = ends[first : first + width + 1]
            found = self._window(model, window, y, dy)
            if found is None:
                if width == 1:
                    raise ComputationError("the motion of the hub was not found", time=float(window[0]))
                width //= 2
                continue
            parts.append(found)
            y, dy, first, width = found.q[-1], found.v[-1], first + len(window) - 1, min(2 * width, WINDOW)
        steps = Steps(
            ends,
            np.vstack([parts[0].q[:1], *(p.q[1:] for p in parts)]),
            np.vstack([parts[0].v[:1], *(p.v[1:] for p in parts)]),
            np.concatenate([p.a for p in parts]),
        )
        self.drive.steps = self._known = steps

        def at(t: Array) -> tuple[Array, Array]:
            x, rates = steps.at(t)
            return x[:, :-1], rates[:, :-1]

        return Trajectory(*at(self.times), len(ends) - 1, False, at)

    def _window(self, model: ReducedModel, ends: Array, y: Array, dy: Array) -> Steps | None:
        """Return the solution over some steps; None where Newton's method does not find it."""
        q, v, a = self._expected(ends, y, dy)
        before = np.inf
        for _ in range(ITERATIONS):
            state = (q.reshape(-1, len(y)), v.reshape(-1, len(y)), a.reshape(-1, len(y)))
            steps = collocate(partial(self.linearised, model, state), self.drive.within, ends, y, dy)
            new = steps.nodes()
            if not all(np.all(np.isfinite(x)) for x in new):
                return None
            change = float(np.abs(new[1][..., -1] - v[..., -1]).max())
            size = float(np.abs(new[1][..., -1]).max())
            q, v, a = new
            following = change * (change / before) ** 2 if before < np.inf else change  # by a quadratic law
            if min(change, following) <= CLOSE * size or (change <= 1e-7 * size and change >= 0.5 * before):
                return steps
            before = change
        return None

    def _expected(self, ends: Array, y: Array, dy: Array) -> tuple[Array, Array, Array]:
        """Return coordinates and angle, rates and accelerations at the nodes of steps, (n, nodes, m + 1) each.

        They are those of the trajectory of last time; without one the hub goes on at its speed, the structure at rest.
        """
        if self._known is not None:
            t = self.drive.within(ends[:-1], ends[1:], NODES)
            found = (*self._known.at(t.ravel()), self._known.rates_of(t.ravel()))
            q, v, a = (x.reshape(*t.shape, len(y)) for x in found)
            return q, v, a
        elapsed = ends[:-1, None] + np.diff(ends)[:, None] * NODES - ends[0]
        turns = np.append(0 * dy[:-1], dy[-1])
        q = y + elapsed[..., None] * turns
        return q, np.broadcast_to(turns, q.shape), np.zeros_like(q)

    def linearised(self, model: ReducedModel, state: tuple[Array, ...], t: Array) -> tuple[Array, Array, Array, Array]:
        """Return M, C, K (n, m + 1, m + 1) and f (n, m + 1) of the equations linearised about states.

        Args:
            model: of the structure.
            state: coordinates and angle, rates and accelerations, (n, m + 1).
            t: times, s.
        """
        q, v, a = state
        m, hub, moment = model.size, self.drive.hub, self.moment
        assert moment is not None
        x, turn = (q[:, :-1], v[:, :-1], a[:, :-1]), np.stack([q[:, -1], v[:, -1], a[:, -1]], axis=1)
        c, w = self._weighed(turn, t)
        slopes = moment.slopes(w, *x)
        out = []
        for kind, operator, slope, k in zip("KCM", model.operators(c)[2::-1], slopes, range(3), strict=True):
            step = np.zeros(3)
            step[k] = BESIDE[k]
            (c_plus, w_plus), (c_minus, w_minus) = (self._weighed(turn + side, t) for side in (step, -step))
            by_c, by_w = (c_plus - c_minus) / (2 * step[k]), (w_plus - w_minus) / (2 * step[k])
            A = np.empty((len(t), m + 1, m + 1))
            A[:, :m, :m] = operator
            A[:, :m, m] = self._force(model, by_c, *x)
            A[:, m, :m] = slope
            A[:, m, m] = moment.value(by_w, *x) + {"K": 0.0, "C": hub.damping, "M": hub.inertia}[kind]
            out.append(A)
        K, C, M = out
        F = self._unbalanced(model, state, t, (c, w))
        f = F - sum(np.einsum("nij,nj->ni", A, y) for A, y in ((M, a), (C, v), (K, q)))
        return M, C, K, f

    def moment_along(self, shapes: Array, first_order: bool) -> Callable[..., Array]:
        """Return what the hub feels of shapes, local dof arrays (n, p), as a function.

        Its arguments are times (n,), s, angle, speed and its rate (n, 3), and coordinates, rates and accelerations
        (n, p); its value the moment (n,), N·m. In first order it leaves out what is of second in the coordinates.
        """
        assert self.moment is not None
        felt = HubMoment(replace(self.moment.basis, V=shapes), self.drive.bordered.row, first_order)

        def moment(t: Array, turn: Array, s: Array, v: Array, a: Array) -> Array:
            return felt.value(felt.weights(self.drive.constants(t, *turn.T), *turn.T[1:]), s, v, a)

        return moment

    def corrections(self, model: ReducedModel, lacking: Lacking, rounds: int) -> list[Array]:
        """Return what forces that the equations lack add to the coordinates, (rows, m), after each round of Newton's.

        Its steps are longer; what the motion leaves between its own nodes is none of the forces.

        Args:
            model: the reduced model.
            lacking: of states, forces (n, m + 1), the moment on the hub last.
            rounds: how many.
        """
        ends, path, nothing = self.ends(model, LONGER), self.drive.steps, np.zeros(model.size + 1)
        assert path is not None
        t = self.drive.within(ends[:-1], ends[1:], NODES)

        def operators(t: Array) -> tuple[Array, Array, Array, Array]:
            return self.linearised(model, path.state(t), t)

        added, out = None, list[Array]()
        for _ in range(rounds):
            f = []
            for at in np.array_split(t.ravel(), len(ends) // BATCH + 1):
                x = path.state(at)
                y = x if added is None else tuple(map(np.add, x, added.state(at)))
                more = 0.0 if added is None else self._unbalanced(model, y, at) - self._unbalanced(model, x, at)
                f.append(lacking(at, y) + more)
            steps = collocate(operators, self.drive.within, ends, nothing, nothing, np.vstack(f).reshape(*t.shape, -1))
            added = steps if added is None else added.plus(steps)
            out.append(added.at(self.times)[0][:, :-1])
        return out

    def _weighed(self, turn: Array, t: Array) -> tuple[Array, Array]:
        """Return the factors of all pieces, and those of the hub's moment, of angle, speed and its rate (n, 3)."""
        assert self.moment is not None
        constants = self.drive.constants(t, *turn.T)
        return self.drive.made_of(constants, len(t)), self.moment.weights(constants, turn[:, 1], turn[:, 2])

    def _unbalanced(self, model: ReducedModel, state: tuple[Array, ...], t: Array, weighed: Any = None) -> Array:
        """Return what the equations of structure and hub leave of states, with the angle last, (n, m + 1)."""
        turn, x, hub = np.stack([y[:, -1] for y in state], axis=1), [y[:, :-1] for y in state], self.drive.hub
        c, w = weighed or self._weighed(turn, t)
        assert self.moment is not None
        own = hub.inertia * turn[:, 2] + hub.damping * turn[:, 1] - hub.torque.many(t)
        return np.column_stack([self._force(model, c, *x), self.moment.value(w, *x) + own])

    def _force(self, model: ReducedModel, c: Array, q: Array, v: Array, a: Array) -> Array:
        """Return M a + C v + K q + f with these factors, (n, m)."""
        M, C, K, f = model.operators(c)
        return np.asarray(f + sum(np.einsum("nij,nj->ni", A, y) for A, y in ((M, a), (C, v), (K, q))))

    def given(self) -> dict[str, Array]:
        """Return work (J) and angular impulse (N·m·s) from outside in the rows: torque, brake, loads (see `State`)."""
        drive, hub, moment, steps = self.drive, self.drive.hub, self.moment, self.drive.steps
        assert steps is not None
        assert moment is not None
        grid = np.union1d(steps.ends, self.times)
        t = drive.within(grid[:-1], grid[1:], POINTS)
        state = steps.at(t.ravel())
        speed, torque = state[1][:, -1], hub.torque.many(t.ravel())
        weights = moment.weights(drive.constants(t.ravel(), state[0][:, -1], speed, 0 * speed), speed, 0 * speed)
        outside = moment.outside(weights, state[0][:, :-1])
        brake = hub.damping * speed
        rows = np.searchsorted(grid, self.times)
        out = {}
        for name, rate in (("impulse", torque - brake + outside), ("work", (torque - brake) * speed)):
            parts = np.diff(grid) * (rate.reshape(t.shape) @ WEIGHTS)
            out[name] = np.concatenate([[0.0], np.cumsum(parts)])[rows]
        return out


def free_solution(system: Any, times: Array) -> FreeSolution:
    """Return what solves reduced models of bordered equations (see `FreeDrive`), at times (s)."""
    return FreeSolution(FreeDrive(system, times), times)
