"""The march through a time history, in fixed steps or adaptive ones, over the legs of a time grid."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import reduce
from itertools import chain, pairwise
from typing import Any

import numpy as np

from rotfem.analysis.schemes import Array, Scheme, State
from rotfem.analysis.stepper import Stepper, seen
from rotfem.analysis.time_grid import SHORT, Leg, TimeGrid
from rotfem.equations.modal_damping import EFFECT
from rotfem.errors import ComputationError
from rotfem.mechanics.time_signals import SAME, View
from rotfem.numerics.linear import ComplexSolver, DirectSolver, combine
from rotfem.numerics.newton import Newton
from rotfem.numerics.projection import sparse_part, times, with_ghosts


@dataclass(frozen=True)
class Steps:
    """When a history ends, and how it is stepped: by a fixed step or to a tolerance.

    Attributes:
        end: last time, s.
        step: fixed step, s; None for adaptive ones.
        tolerance: error of all adaptive steps together, relative to the largest displacement; None for fixed ones.
        max_step, min_step: bounds of an adaptive step, s; None for those of the program.
        breakpoints: times (s) at which something that is prescribed may jump, in addition to the knots of tables.
    """

    end: float
    step: float | None = None
    tolerance: float | None = None
    max_step: float | None = None
    min_step: float | None = None
    breakpoints: Sequence[float] = ()

    @classmethod
    def of(cls, time: Any) -> Steps:
        """Return the steps of anything with these attributes, as a scene's [time] table."""
        return cls(time.end, time.step, time.tolerance, time.max_step, time.min_step, time.breakpoints)


def fixed_steps(stepper: Stepper, state: State, steps: Steps) -> Iterator[State]:
    """Yield the states at step, 2 step, … and end (s); the last step may be shorter.

    Raises:
        ComputationError: a step failed, however short.
    """
    times = TimeGrid(stepper.system.signals, *grid(steps), steps.breakpoints, lands=stepper.scheme.order > 2)
    reached = state.t
    for leg, after in pairwise(chain((leg for leg in times if leg.end > reached), [None])):
        assert leg is not None
        if state.t == 0.0:
            state = started(stepper, state, leg)
        state = travel(stepper, state, leg, after)
        if leg.whole:
            yield state


def grid(steps: Steps) -> tuple[Array, float]:
    """Return the ends of fixed steps, the first at 0, and their length (s)."""
    assert steps.step is not None
    n = int(np.ceil(steps.end / steps.step - 1e-9))
    return np.append(np.arange(n) * steps.step, steps.end), steps.step


def started(stepper: Stepper, state: State, first: Leg) -> State:
    """Return the state at t = 0 as the first leg starts from it."""
    return stepper.restart(state, View(1), View(1, first.line)) if first.line else state


def travel(stepper: Stepper, state: State, leg: Leg, after: Leg | None) -> State:
    """Return the state at the end of a leg, as the one after it starts from it.

    Raises:
        ComputationError: the step failed, however short.
    """
    old = state
    with seen(stepper.system, leg.finish) if leg.lands or leg.line else nullcontext():
        state = stepper.advance(old, leg.length, leg.end)
    for observe in stepper.observers:
        observe(old, state, leg)
    return state if after is None else turned_to(stepper, state, old, leg, after)


def turned_to(stepper: Stepper, state: State, old: State, leg: Leg, after: Leg) -> State:
    """Return the state at the end of a leg as the next leg starts from it; the old one is that of its start."""
    if after.length != leg.length:
        state = stepper.scheme.resized(state, old, after.length)
    if leg.lands or leg.line != after.line:
        state = stepper.restart(state, leg.finish, View(1, after.line))
    return state


#: Displacement over the length, or rotation in rad, above which the result of a linear theory is refused.
LARGEST_LINEAR_DEFLECTION = 1.0


class March:
    """A time history, state after state.

    Args:
        system: equations of motion.
        scheme: time-stepping scheme.
        steps: end and length of the steps.
        newton: iteration control of the steps.
        q: shape at t = 0 in the turning frame, local dof array of the structure; undeformed if None.
        v: velocities there, relative to the turning frame; it is at rest if None.

    Attributes:
        stepper: what advances the system, with its counts.
        reached: state that an earlier march has yielded, to go on from; its stepper's numbers must be this one's.
    """

    def __init__(
        self, system: Any, scheme: Scheme, steps: Steps, newton: Newton, q: Array | None = None, v: Array | None = None
    ):
        self.system, self.steps = system, steps
        self.stepper = Stepper(system, scheme, newton)
        self.reached: State | None = None
        self._q = np.zeros_like(system.q.x.array) if q is None else q
        self._v = v

    def __iter__(self) -> Iterator[State]:
        """Yield the state at t = 0, unless it goes on from a later one, and at the end of every step.

        Raises:
            ComputationError: a step failed, however short.
        """
        state = self.reached
        if state is None:
            q, v = self.system.start(self._q)
            if self._v is not None:
                v[: len(self._v)] += self._v
            state = self.stepper.start(0.0, q, v)
            yield state
        steps = fixed_steps if self.steps.step is not None else AdaptiveSteps
        yield from steps(self.stepper, state, self.steps)


#: Error of a step that the controller aims at, as a part of the allowed one: a vibration's local error is its largest
#: times |cos φ|, ½ in the geometric mean over phases. Smallest ratio of two steps.
AIM, SHRINK = 0.5, 0.2

#: The longest step, and the intervals over which many knots are averaged, as parts of the end. A history is seldom
#: drawn with more than 2000 points: what changes faster has the same impulse and first moment in every interval.
LONGEST, CELL = 0.05, 5e-4

#: Steps, rejected ones included, after which a march is given up; steps over which its mean step is measured.
MOST_STEPS, PACE = 500_000, 5000

#: What to do then.
QUICKER = (
    "time.breakpoints where a function of motion or loads jumps; fixed steps (time.step), which take the mean of what "
    "is quicker than they are; a looser time.tolerance; or an earlier time.end"
)


class AdaptiveSteps:
    """States whose local errors add up to a tolerance, relative to the largest displacement so far.

    The controller is H211PI: h' = h (r_n r_{n−1})^(−1/6k) with errors r ∝ hᵏ, parts of what is allowed. It filters what
    vibrations make of them (Söderlind, ACM Trans. Math. Softw. 29 (2003) 1, table 1). No step grows after a rejected
    one (Hairer, Nørsett & Wanner 1993, section II.4).

    Steps land on the knots of what is prescribed. Where a cell of the time grid has more than a few of them, signals
    are straight lines over it.

    Args:
        stepper: what advances the system.
        state: at t = 0.
        steps: `Steps` with a tolerance.
    """

    def __init__(self, stepper: Stepper, state: State, steps: Any):
        self.stepper, self.state, self.end = stepper, state, float(steps.end)
        self.tolerance = float(steps.tolerance)
        self.longest = steps.max_step or LONGEST * self.end
        self.shortest = steps.min_step or 1e-9 * self.end
        self.measure = ErrorMeasure(stepper.system, stepper.scheme, self.end)
        self.cell, self.least = CELL * self.end, 10 * stepper.newton.tolerance  # of which errors are noise
        cells = np.append(np.arange(round(1 / CELL)) * self.cell, self.end)
        legs = list(TimeGrid(stepper.system.signals, cells, self.cell, steps.breakpoints))
        self.lines = np.array([leg.line for leg in legs if leg.line]).reshape(-1, 2)
        landings = np.unique([*(leg.end for leg in legs if leg.lands), *self.lines.ravel(), self.end])
        self.landings = landings[landings > 0.0]
        self.wanted, self.before, self.largest = min(self.longest, 1e-4 * self.end), 1.0, 1e-6
        if stepper.pace is not None:
            self.wanted, self.largest, self.before = stepper.pace

    def __iter__(self) -> Iterator[State]:
        """Yield the state at the end of every step.

        Raises:
            ComputationError: a step failed, or would have to be shorter than allowed, or there are too many.
        """
        state, wanted, stepper, before = self.state, self.wanted, self.stepper, self.before
        order, most = stepper.scheme.estimate[1] - 1, stepper.scheme.growth
        switches, began = switches_of(stepper.system), state.t
        self.largest = max(self.largest, self.measure.displacement(state))
        for number in range(1, MOST_STEPS + 1):
            if state.t >= self.end:
                return
            if number % PACE == 0:
                advance, began = (state.t - began) / PACE, state.t
                if self.end - state.t > 10 * MOST_STEPS * advance:
                    what = (
                        f"the last {PACE} steps were of {advance:.3g} s on average: {MOST_STEPS} do not reach the end"
                    )
                    raise ComputationError(what, time=state.t, advice=QUICKER)
            leg = self._next(state.t, wanted)
            if state.t == 0.0:
                state = started(stepper, state, leg)
            new, ratio = self._tried(state, leg)
            if ratio > 1.0:
                stepper.rejected += 1
                wanted, most = leg.length * max((ratio / AIM) ** (-1 / order), SHRINK), 1.0
                if wanted < self.shortest:
                    what = f"the step fell below {self.shortest:.3g} s without meeting the tolerance"
                    helps = ["a looser time.tolerance", "a smaller time.min_step", "some damping"]
                    advice = ", or ".join(helps[: 2 if EFFECT in stepper.system.model.effects else 3])
                    raise ComputationError(what, time=state.t, advice=advice)
                continue
            ratio = max(ratio / AIM, 1e-12)
            factor = float(np.clip((ratio * before) ** (-1 / (6 * order)), SHRINK, most))
            most = stepper.scheme.growth
            if leg.length >= wanted or factor < 1.0:
                wanted, before = min(self.longest, leg.length * factor), ratio
            if switches is not None:
                switches.passed(number, state, new)
            for observe in stepper.observers:
                observe(state, new, leg)
            if new.t < self.end:
                new = turned_to(stepper, new, state, leg, self._next(new.t, wanted))
            state, stepper.pace = new, (wanted, self.largest, before)
            yield state
        raise ComputationError(f"{MOST_STEPS} steps have not reached the end", time=state.t, advice=QUICKER)

    def _tried(self, start: State, leg: Leg) -> tuple[State, float]:
        """Return the state at the end of a leg, and its error as a part of what is allowed."""
        stepper = self.stepper
        short = leg.length <= SHORT * self.longest
        with seen(stepper.system, leg.finish):
            try:
                new = stepper.advance(start, leg.length, leg.end, 5 if short else 0)
            except ComputationError:
                if short:
                    raise
                return start, np.inf
        local = stepper.scheme.local_error(new, start)
        self.largest = max(self.largest, self.measure.displacement(new))
        if local is None:  # a fallback has taken it
            return new, 1.0
        return new, self.measure(local, leg.length) / max(self.tolerance * self.largest, self.least)

    def _next(self, t: float, wanted: float) -> Leg:
        """Return a leg from t (s) that is about as long as wanted and passes no landing."""
        stop = float(self.landings[np.searchsorted(self.landings, t * (1 + SAME), side="right")])
        left, h = stop - t, min(wanted, self.longest)
        if lands := h >= left * (1 - 1e-9):
            h = left
        else:
            h = left / 2 if h > 0.6 * left else h
            stop = t + h
        i = int(np.searchsorted(self.lines[:, 1], t + 0.5 * h))
        there = i < len(self.lines) and self.lines[i, 0] < t + 0.5 * h
        return Leg(stop, h, lands, (float(self.lines[i, 0]), float(self.lines[i, 1])) if there else None)


#: Filters, of owned arrays, are made for steps in this ratio; the last ones are kept, as a complex factor is large.
COARSE = 1.5
Filter = Callable[[Array], Array]


class ErrorMeasure:
    """Error at the end of a history that a step's local error leads to if every step were like this one.

    A vibration of frequency ω and amplitude A has a local error e of C (ωh)ᵐ A in every step. N such steps add up to
    N C (ωh)ᵐ A, but never to more than 2 A, the vibration in opposite phase: what is small need not be resolved. A
    Butterworth filter B leaves N e where that is below 2 A, half of it where both are equal, and less than 2 A beyond:

        B = 1/(1 + (τω)²ⁿ),    N C (h/τ)ᵐ = 2,    n = m/2, rounded up.

    An unresolved vibration has an e of up to (s ωh)² A, of which the filter 1/(1 + (s ωh)²) leaves A: it counts with
    its amplitude. The error is the larger of both, times 2 for the half that B leaves.

    B is applied as n filters one after the other, for the n roots X of Xⁿ = −1:

        z (z M + τ C + τ²/z K)⁻¹ M e,    z² = −X,    Re z > 0.

    Matrices are those at the start. The angle of a free hub is among the unknowns, as the hub moves with vibrations.
    With C, motions that strong damping stops within the step are filtered too (as any stiff component: Hairer & Wanner
    1996, eq. (IV.8.20)).

    Args:
        system: equations of motion; state and time of the start are set in it.
        scheme: whose local errors are measured.
        end: length of the history, s.
    """

    def __init__(self, system: Any, scheme: Scheme, end: float):
        self.inner, self.end, self.scheme = system.held, end, scheme
        self.inner.set_time(0.0, self.inner.model.problem.motion)  # of a free hub the speed it starts with, not of now
        self.inner.set_state(self.inner.zeros())
        self._matrices = system.with_hub(self.inner.mass_damping_stiffness())
        self._owned = self.inner.V.dofmap.index_map.size_local * self.inner.V.dofmap.index_map_bs
        self._length: int | None = None
        self._filters: list[list[Filter]] = []

    def __call__(self, error: Array, h: float) -> float:
        """Return the largest entry of the error, in units of the unknowns' scale.

        Args:
            error: local error of q, local dof array; of a free hub with that of its angle last.
            h: length of the step, s.
        """
        e = np.full(self._matrices[0].getLocalSize()[0], error[-1])  # the last process has the angle of a hub
        e[: self._owned] = error[: self._owned]
        length = round(np.log(h) / np.log(COARSE))
        if length != self._length:
            self._length, self._filters = length, self._made(COARSE**length)
        filtered = (reduce(lambda e, through: through(e), filters, e)[: self._owned] for filters in self._filters)
        adds_up, remains = (self.size(with_ghosts(self.inner.V, x)) for x in filtered)
        return 2.0 * max(self.end / h * adds_up, remains)

    def size(self, x: Array) -> float:
        """Return the largest displacement of points of the sections in a local dof array, over the length."""
        return float(self.inner.displaced(x).max() / self.inner.structure.length)

    def displacement(self, state: State) -> float:
        """Return the largest displacement of a state relative to the turning frame, in units of its scale."""
        q, clamp = state.q[: len(self.inner.scale)], self.inner.clamp
        if clamp is not None:
            x = self.inner.V.tabulate_dof_coordinates()[:, 0]
            q = clamp.relative(q.reshape(len(x), -1), x, state.t).ravel()
        return self.size(q)

    def _made(self, h: float) -> list[list[Filter]]:
        """Return the filters of B, and that of unresolved vibrations, for steps of h (s)."""
        constant, order, lost = self.scheme.estimate
        n, tau = (order + 1) // 2, h * (0.5 * constant * self.end / h) ** (1 / order)
        B = [self._filter(np.exp(0.5j * np.pi * k / n), tau) for k in range(n - 1, -1, -2)]
        return [B, [self._filter(1.0, lost * h)]]

    def _filter(self, z: complex, tau: float) -> Filter:
        """Return the filter of z, of a complex one with that of its conjugate."""
        (M, C, K), weights = self._matrices, np.array([z, tau, tau**2 / z])
        if np.isreal(z):
            real = DirectSolver(combine(sparse_part(M).duplicate(), [M, C, K], weights.real))
            return lambda e: real.solve_all(times(M, e[:, None]))[:, 0]
        solver = ComplexSolver((M, C, K))
        solver.factor(list(weights))

        def both(e: Array) -> Array:
            x = z * solver.solve(times(M, e[:, None])[:, 0].astype(np.complex128))
            return np.real(z * solver.solve(times(M, np.stack([x.real, -x.imag], axis=1)) @ (1.0, 1.0j)))

        return both


#: Switches undone in the very next step, and steps meanwhile, that make a sliding mode. A switch that the motion passes
#: is not undone at once.
RETURNS, STEPS = 20, 2000

#: What to do where there is one.
SMOOTHER = (
    "a torque that is continuous there, as one proportional to the deviation between its limits, or a hysteresis that "
    "leaves the motion time between two switches"
)


class Switches:
    """Detects sliding modes of a torque that jumps with the motion, as a relay does, by counting switches over steps.

    A single switch is resolved by the step-size control. Where the torque drives the motion back from either side of
    its jump (a sliding mode, Filippov 1988, section 4) an implicit step may have no solution, and adaptive steps follow
    every switch.

    Args:
        system: equations of motion of a free hub.
    """

    def __init__(self, system: Any):
        self.system, self.torque = system, system.hub.torque
        self._returns: deque[tuple[int, float]] = deque(maxlen=RETURNS)
        self._switched = False

    def passed(self, number: int, old: State, new: State) -> None:
        """Count the switches of a step.

        Raises:
            ComputationError: RETURNS steps have undone the switch of the step before.
        """
        before, self._switched = self._switched, self.between(self._seen(old), self._seen(new))
        if not (before and self._switched):
            return
        self._returns.append((number, new.t))
        first, since = self._returns[0]
        if len(self._returns) < RETURNS or number - first > STEPS:
            return
        what = (
            f"the torque has switched back at once {RETURNS} times in the last {new.t - since:.3g} s, which took "
            f"{number - first} steps: it holds the motion at its own jump (sliding mode)"
        )
        raise ComputationError(what, time=new.t, advice=SMOOTHER)

    def within(self, state: State, h: float) -> bool:
        """Return whether the torque jumps within a time h (s) of a state that goes on with its acceleration."""
        return self.between(self._seen(state), self._seen(state) + h * np.array([1.0, *self._rates(state)]))

    def between(self, old: Any, new: Any) -> bool:
        """Return whether the torque jumps on the straight line between two sets of its arguments."""
        M, there = self._at(old), self._at(new)
        change = abs(there - M)
        if change == 0.0:
            return False
        for _ in range(52):  # all digits of the arguments
            middle = 0.5 * (old + new)
            value = self._at(middle)
            if abs(value - M) >= abs(there - value):
                new, there = middle, value
            else:
                old, M = middle, value
            if abs(there - M) < 0.5 * change:
                return False
        return True

    def _at(self, seen: Any) -> float:
        t, psi, speed, *tip = map(float, seen)
        return float(
            self.torque.controller(t, psi, speed, dict(zip(self.system.structure.components, tip, strict=True)))
        )

    def _seen(self, state: State) -> Any:
        """Return time, angle, speed and the components of the tip, the arguments of the torque."""
        self.system.count_rotations_from(state.reference)
        return np.array([state.t, state.q[-1], state.v[-1], *self.system.tip(state.q, state.t)])

    def _rates(self, state: State) -> list[float]:
        return [state.v[-1], state.a[-1], *np.zeros(len(self.system.structure.components))]


def switches_of(system: Any) -> Switches | None:
    """Return the detector of sliding modes of a controlled torque of a free hub; None without one."""
    return Switches(system) if system.hub is not None and system.hub.torque.controlled else None
