"""Companions of a march: the same problem in steps of twice the length, on a coarser mesh, or in a richer theory.

A companion is one more march on a system of its own. It takes two steps of the march that it follows as one, wherever
nothing prescribed lies between them, or the same ones as another companion; so it meets the same instants. Its first
guess of a step is the motion that it follows plus the difference so far: mostly one Newton iteration is left to do.

Differences become errors by an order (see `rotfem.refinement.estimate`): that of elements, or that of the scheme up to
`CERTAIN`. Of schemes of higher order the difference itself is the error.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from math import dist, hypot
from typing import Any

import numpy as np
from mpi4py import MPI

from rotfem.analysis.dense_output import between, polynomial
from rotfem.analysis.march import started, travel
from rotfem.analysis.schemes import Array, Scheme, Stage, State
from rotfem.analysis.stepper import Stepper
from rotfem.analysis.time_grid import Leg
from rotfem.equations.compiled import compile_system
from rotfem.errors import ComputationError
from rotfem.mechanics.problem import Problem
from rotfem.mechanics.theories import compared
from rotfem.numerics.newton import Newton
from rotfem.refinement.coarser import carrier, on_other_mesh
from rotfem.refinement.distance import Output, tip
from rotfem.refinement.estimate import error_of

#: Shape and velocities at t = 0 of a system, local dof arrays; None where it is undeformed, or at rest.
Start = Callable[[Any], tuple[Array | None, Array | None]]


@dataclass
class Followed:
    """Steps of the march that is followed, which a companion takes as one.

    Attributes:
        leg: from the start of the first to the end of the last.
        steps: their states at start and end.
    """

    leg: Leg
    steps: tuple[tuple[State, State], ...]

    @property
    def end(self) -> State:
        """State that the last ends in."""
        return self.steps[-1][1]

    def state_at(self, t: float, order: int, comm: MPI.Comm) -> State:
        """Return the state at a time (s) as a row of a history has it."""
        old, new = next(pair for pair in self.steps if t <= pair[1].t)
        return between(old, new, [t], order, comm)[0] if t < new.t else new


class FollowingStepper(Stepper):
    """Stepper whose first guess is a motion that it follows plus the difference so far.

    Attributes:
        followed: over the next step; None where there is no such guess.
        carried: makes q of the motion that is followed one on its own mesh; None where nothing does.
        differences: (t, difference) at the ends of the last two steps, s.
    """

    def __init__(self, system: Any, scheme: Scheme, newton: Newton, carried: Callable[[Array], Array] | None):
        super().__init__(system, scheme, newton)
        self.followed: Followed | None = None
        self.carried = carried
        self.differences: list[tuple[float, Array]] = []
        #: q followed, carried to its own mesh, at the end of the step.
        self._there: Array | None = None
        #: Polynomials of the steps that are followed, by the time at their end.
        self._curves: dict[float, Array] = {}

    def _gains_energy(self, new: State, state: State) -> bool:
        return False

    def predicted(self, stage: Stage, state: State) -> Array:
        """Return q followed, plus the difference at the start of the step, growing as over the step before."""
        step = self.followed
        if step is None or self.carried is None or state.reference is not step.end.reference:
            return super().predicted(stage, state)
        there = self._there if stage.t >= step.end.t else None
        t, difference = self.differences[-1]
        guess = np.add(self.carried(self._followed_at(stage.t, step)) if there is None else there, difference)
        if len(self.differences) > 1:
            before, other = self.differences[0]
            guess += (stage.t - t) / (t - before) * (difference - other)
        clamped = self.system.held.clamped
        guess[clamped] = stage.q[clamped]  # no iteration corrects them: round-off of what is carried would add up
        return guess

    def _followed_at(self, t: float, step: Followed) -> Array:
        """Return q of the motion that is followed at a time in a step of it, s."""
        old, new = next((pair for pair in step.steps if t <= pair[1].t), step.steps[-1])
        if not old.t < t < new.t:
            return old.q if t <= old.t else new.q
        if new.t not in self._curves:
            self._curves[new.t] = polynomial(old, new, self.scheme.order, self.system.comm)
        curve, share = self._curves[new.t], (t - old.t) / (new.t - old.t)
        return np.asarray(share ** np.arange(len(curve)) @ curve)

    def follow(self, step: Followed, state: State) -> None:
        """Take a step as the one that is followed from a state."""
        self.followed, self._there, self._curves = None, None, {}
        if self.system.solved_at_once or self.carried is None:
            return
        if any(s.reference is not state.reference for pair in step.steps for s in pair):
            self.differences = []
            return
        self.followed, self._there = step, self.carried(step.end.q)
        if not self.differences:
            self.differences = [(state.t, state.q - self.carried(step.steps[0][0].q))]

    def arrived(self, state: State) -> None:
        """Take note of the difference at the end of the step that was followed."""
        if self.followed is None or self._there is None or state.reference is not self.followed.end.reference:
            self.differences = []
        else:
            self.differences = [*self.differences[-1:], (state.t, state.q - self._there)]


class Companion:
    """A march that follows another one; a watch of the steps of that.

    Args:
        system: its own, of the problem of the march that is followed or of another one with the same outputs.
        followed: the system of that march.
        scheme: of both.
        newton: iteration control of the march that is followed.
        doubles: whether it takes two steps as one.
        further: companions that follow this one.
        output: that the two are compared by, at the ends of its steps.
        interval: between rows, s; they are also compared in the row next to the middle of every step. None where rows
            are ends of steps.

    Attributes:
        state: reached; None before `begin`.
        difference: largest distance of the two outputs so far, and when, s.
        components: largest difference of every component of them.
        path: length of the way of its output so far, from one end of a step to the next.
        doubled: part of that in doubled steps.
        last: output at the end of the last step.
        sound: whether all its steps could be solved, and it is no farther away than the limit.
        limit: largest distance up to which it goes on.
        part: of the difference so far to which its steps are solved, where that is more than the tolerance.
    """

    limit: float = float(np.finfo(float).max)
    part: float = 0.0

    def __init__(
        self,
        system: Any,
        followed: Any,
        scheme: Scheme,
        newton: Newton,
        doubles: bool = True,
        further: Sequence[Companion] = (),
        output: Output = tip,
        interval: float | None = None,
    ):
        self.system, self.followed, self.doubles, self.output = system, followed, doubles, output
        self.interval = interval
        system.held.plain = True
        own = Newton(newton.tolerance, newton.max_iterations, foreseeing=True)
        self.stepper = FollowingStepper(system, scheme, own, carrier(followed, system))
        self.stepper.observers.append(self._arrived)
        self.further = list(further)
        self.state: State | None = None
        self.difference, self.path, self.doubled, self.sound = (0.0, 0.0), 0.0, 0.0, True
        self.last: tuple[float, ...] = ()
        self.components: tuple[float, ...] = ()
        #: Steps taken note of: those that may be doubled with the next, and those whose way on is not known yet.
        self.waiting: list[Followed | None] = [None, None]

    def begin(self, q: Array | None, v: Array | None = None) -> None:
        """Start at t = 0 from a shape in the turning frame and velocities relative to it, local dof arrays.

        It is undeformed without a shape, at rest without velocities.

        Raises:
            ComputationError: there are no accelerations.
        """
        start, rates = self.system.start(self.system.held.zeros() if q is None else q.copy())
        if v is not None:
            rates[: len(v)] += v
        self.state = self.stepper.start(0.0, start, rates)
        self.last = tuple(map(float, self.output(self.system, self.state)))
        self.components = (0.0,) * len(self.last)

    def __call__(self, old: State, new: State, leg: Leg) -> None:
        """Take note of a step of the march that is followed, and take all those whose way on is known by it."""
        if not self.sound:
            return
        if self.followed.held.structure.turns is not None:  # it may count the rotations of these states afresh
            old, new = copy(old), copy(new)
        step, (single, _) = Followed(leg, ((old, new),)), self.waiting
        if single is not None:
            self.waiting[0] = None
            if single.leg.doubles(leg):
                length = single.leg.length + leg.length
                self._is_known(Followed(replace(leg, length=length), single.steps + step.steps))
                return
            self._is_known(single)
        if self.doubles and leg.doubles(leg):
            self.waiting[0] = step
        else:
            self._is_known(step)

    def finish(self) -> None:
        """Take the last steps."""
        single, _ = self.waiting
        if single is not None:
            self._is_known(single)
        if (last := self.waiting[1]) is not None:
            self._take(last, None)
        self.waiting = [None, None]
        for companion in self.further:
            companion.finish()

    def _arrived(self, old: State, new: State, leg: Leg) -> None:
        """Compare the outputs at the end of a step and within it, and pass it on."""
        step = self._step
        self.stepper.arrived(new)
        before, self.last = self.last, self._compare(new, step.end)
        self.path += (way := dist(before, self.last))
        self.doubled += way if len(step.steps) > 1 else 0.0
        if self.interval is not None:
            row = round((old.t + new.t) / (2 * self.interval)) * self.interval
            if old.t < row < new.t:
                known = self.stepper.scheme.order, self.system.comm
                self._compare(between(old, new, [row], *known)[0], step.state_at(row, *known))
        for companion in self.further:
            companion(old, new, leg)

    def _is_known(self, step: Followed) -> None:
        """Take the step before one, now that it is known which leg goes on from there."""
        last, self.waiting[1] = self.waiting[1], step
        if last is not None:
            self._take(last, step.leg)

    def _take(self, step: Followed, after: Leg | None) -> None:
        """Take a step, from which the next leg goes on."""
        if not self.sound or self.state is None:
            self.sound = False
            return
        stepper, start = self.stepper, self.state
        stepper.follow(step, start)
        self._step = step
        try:
            if start.t == 0.0:
                start = started(stepper, start, step.leg)
            with np.errstate(all="ignore"):
                self.state = travel(stepper, start, step.leg, after)
        except ComputationError:
            self.sound = False

    def _compare(self, here: State, there: State) -> tuple[float, ...]:
        """Take note of the distance of the outputs at an instant, and return its own one."""
        own = self.output(self.system, here)
        apart: Any = (own - self.output(self.followed, there)).tolist()
        size = hypot(*apart)
        self.sound &= size <= self.limit  # not where it is no number
        self.components = tuple(max(a, abs(b)) for a, b in zip(self.components, apart, strict=True))
        if size > self.difference[0]:
            self.difference = size, there.t
            least = self.part * size / self.system.structure.length
            self.stepper.newton.tolerance = max(self.stepper.newton.tolerance, least)
        return tuple(map(float, own))


#: Order of a scheme up to which it is that of all motions. Stiff components reduce the order of others to that of their
#: stages (Hairer & Wanner 1996, section IV.15), or below: no order is known of them.
CERTAIN = 2


def richer_problem(problem: Problem) -> Problem | None:
    """Return a problem in the theory that its answers are compared with; None where there is none."""
    richer = compared(problem.theory, problem.structure.type)
    return None if richer is None else problem.replace(theory=richer)


class HistoryErrors:
    """The errors of a march by its companions; a watch of its steps.

    Args:
        problem: what is computed.
        system: its system, which marches.
        scheme: of its steps.
        newton: its iteration control.
        start: what it starts from.
        output: whose errors these are.
        interval: between rows, s; None where they are ends of steps.
        richer: the problem in the theory that its answers are compared with; None for none.

    Attributes:
        steps: companion in steps of twice the length; followed by the others.
        mesh: companion in the same long steps on another mesh; None without one.
        other: that mesh; None without one.
        theory: companion in the same long steps in the richer theory, compared at the tip; None without one.
    """

    def __init__(
        self,
        problem: Problem,
        system: Any,
        scheme: Scheme,
        newton: Newton,
        start: Start,
        output: Output = tip,
        interval: float | None = None,
        richer: Problem | None = None,
    ):
        self.scheme = scheme
        same, self.other = system.twin(), on_other_mesh(problem, system)
        self.mesh: Companion | None = None
        self.theory: Companion | None = None
        if self.other is not None:
            self.mesh = Companion(self.other.system, same, scheme, newton, False, output=output, interval=interval)
        if richer is not None:
            there = compile_system(richer.replace(outputs={}), system.comm)
            self.theory = Companion(there, same, scheme, newton, doubles=False)
        further = [companion for companion in (self.mesh, self.theory) if companion is not None]
        self.steps = Companion(same, system, scheme, newton, True, further, output, interval)
        for companion in self.companions:
            try:
                companion.begin(*start(companion.system))
            except ComputationError:
                companion.sound = False

    @property
    def companions(self) -> list[Companion]:
        """All of them, each after the one that it follows."""
        return [self.steps, *self.steps.further]

    def __call__(self, old: State, new: State, leg: Leg) -> None:
        """Take note of a step of the march."""
        self.steps(old, new, leg)

    def errors(self, scale: float) -> dict[str, float | None]:
        """Return the errors by the steps, `time`, and by the mesh, `space`, at the end of the march; None is unknown.

        Args:
            scale: largest value of the output.
        """
        self.steps.finish()
        steps, mesh, scale = self.steps, self.mesh, scale if scale > 0.0 else np.inf
        out: dict[str, float | None] = {"time": None, "space": None}
        if steps.sound and steps.doubled >= steps.path / 2:  # less says too little
            # as if all of the way had been doubled
            whole = steps.difference[0] * (steps.path / steps.doubled if steps.doubled > 0.0 else 1.0)
            out["time"] = error_of(whole / scale, self.scheme.order if self.scheme.order <= CERTAIN else 0)
        if steps.sound and mesh is not None and mesh.sound and self.other is not None:
            out["space"] = self.other.error(mesh.difference[0] / scale)
        return out
