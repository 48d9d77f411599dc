"""Companions of a march: the same problem in steps of twice the length, on a coarser mesh, or in a richer theory.

A companion is a second march in lockstep, on a system of its own. It takes two steps of the followed march as one if
no knot lies between them, or the same steps as another companion.

An error follows from a difference by the order of the elements, or by that of the scheme up to `CERTAIN`
(`rotfem.refinement.estimate`), as long as a vibration as quick as the difference stays in phase. Otherwise it is the
difference itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from math import dist, hypot
from typing import Any

import numpy as np
from mpi4py import MPI

from rotfem.analysis.dense_output import between
from rotfem.analysis.march import started, travel
from rotfem.analysis.schemes import Array, Scheme, State
from rotfem.analysis.stepper import Stepper
from rotfem.analysis.time_grid import Leg
from rotfem.equations.compiled import compile_system
from rotfem.errors import ComputationError
from rotfem.mechanics.problem import Problem
from rotfem.mechanics.theories import compared
from rotfem.numerics.newton import Newton
from rotfem.refinement.coarser import on_other_mesh
from rotfem.refinement.distance import Output, tip
from rotfem.refinement.estimate import extrapolated

#: Shape and velocities at t = 0 of a system, local dof arrays; None where it is undeformed, or at rest.
Start = Callable[[Any], tuple[Array | None, Array | None]]


@dataclass
class Followed:
    """Steps of the followed march that a companion takes as one.

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


class CompanionStepper(Stepper):
    """Stepper of a companion, which is to gain the energy that the march it follows gains."""

    def _gains_energy(self, new: State, state: State) -> bool:
        return False


class Companion:
    """A march that follows another one, as an observer of its steps.

    Args:
        system: its own, of the same problem or of another one with the same outputs.
        followed: the system of the followed march.
        scheme: of both.
        newton: iteration control of the followed march.
        doubles: whether it takes two steps as one.
        further: companions that follow this one.
        output: compared at the ends of its steps.
        interval: between rows, s: the outputs are also compared in the row nearest to the middle of every step. None
            where rows are ends of steps.

    Attributes:
        state: reached; None before `begin`.
        difference: largest distance of the two outputs so far, and its time, s.
        components: largest difference of every component.
        path: length of the path of its output so far, summed over steps.
        doubled: length of that in doubled steps.
        last: output at the end of the last step.
        sound: whether all steps were solved, and the distance is below the limit.
        limit: distance at which it stops.
        part: Newton tolerance as a part of the difference so far, where that is above the own tolerance.
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
        self.stepper = CompanionStepper(system, scheme, own)
        self.stepper.observers.append(self._arrived)
        self.further = list(further)
        self.state: State | None = None
        self.difference, self.path, self.doubled, self.sound = (0.0, 0.0), 0.0, 0.0, True
        self.last: tuple[float, ...] = ()
        self.components: tuple[float, ...] = ()
        #: Difference of the outputs at the end of the last step, and sums over steps for `late`.
        self._apart: tuple[float, ...] = ()
        self._squares, self._rates, self._cubes = 0.0, 0.0, 0.0
        #: Steps seen and not taken: one that may be doubled with the next, and one whose next leg is not known.
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
        self.components = self._apart = (0.0,) * len(self.last)

    @property
    def late(self) -> float:
        """Phase error at the end, rad: Σ ω (ωh)² h/12 with ω² = ∫|ḋ|² dt/∫|d|² dt of the difference d.

        (ωh)²/12 is the relative error of a frequency by the trapezoidal rule (Hughes 1987, chapter 9).
        """
        return float((self._rates / self._squares) ** 1.5 * self._cubes / 12.0) if self._squares > 0.0 else 0.0

    def __call__(self, old: State, new: State, leg: Leg) -> None:
        """Observe a step of the followed march, and take the own steps that are complete with it."""
        if not self.sound:
            return
        if self.followed.held.structure.turns is not None:  # these states may get another reference rotation
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
        """Take the remaining steps."""
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
        before, since, h = self.last, self._apart, new.t - old.t
        self.last, self._apart = self._compare(new, step.end)
        self.path += (way := dist(before, self.last))
        self.doubled += way if len(step.steps) > 1 else 0.0
        size, change = hypot(*self._apart), dist(since, self._apart)
        self._squares += h * size * size
        self._rates += change * change / h
        self._cubes += sum((b.t - a.t) ** 3 for a, b in step.steps)
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
        self._step = step
        try:
            if start.t == 0.0:
                start = started(stepper, start, step.leg)
            with np.errstate(all="ignore"):
                self.state = travel(stepper, start, step.leg, after)
        except ComputationError:
            self.sound = False

    def _compare(self, here: State, there: State) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Record the distance of the outputs at an instant; return the own output and the difference."""
        own = self.output(self.system, here)
        apart: Any = (own - self.output(self.followed, there)).tolist()
        size = hypot(*apart)
        self.sound &= size <= self.limit  # false for nan
        self.components = tuple(max(a, abs(b)) for a, b in zip(self.components, apart, strict=True))
        if size > self.difference[0]:
            self.difference = size, there.t
            least = self.part * size / self.system.structure.length
            self.stepper.newton.tolerance = max(self.stepper.newton.tolerance, least)
        return tuple(map(float, own)), tuple(apart)


#: Phase error φ (rad) of a vibration up to which its difference to doubled steps, 2A |sin 3φ/2|, grows with it.
IN_PHASE = np.pi / 3

#: Order up to which a scheme's order holds for all motions. That of others is reduced by stiff components, to the stage
#: order or below (Hairer & Wanner 1996, section IV.15): it is taken as unknown.
CERTAIN = 2


def richer_problem(problem: Problem) -> Problem | None:
    """Return a problem in the richer theory that it is compared with; None where there is none."""
    richer = compared(problem.theory, problem.structure.type)
    return None if richer is None else problem.replace(theory=richer)


class HistoryErrors:
    """The errors of a march by its companions, as an observer of its steps.

    Args:
        problem: what is computed.
        system: its system.
        scheme: of its steps.
        newton: its iteration control.
        start: of the march.
        output: whose errors are wanted.
        interval: between rows, s; None where they are ends of steps.
        richer: the problem in a richer theory; None for none.

    Attributes:
        steps: companion in doubled steps; the others follow it.
        mesh: companion in the doubled steps on another mesh; None without one.
        other: that mesh; None without one.
        theory: companion in the doubled steps in the richer theory, compared at the tip; None without one.
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
        """All companions, each after the one that it follows."""
        return [self.steps, *self.steps.further]

    def __call__(self, old: State, new: State, leg: Leg) -> None:
        """Observe a step of the march."""
        self.steps(old, new, leg)

    def errors(self, scale: float) -> dict[str, float | None]:
        """Return the relative errors by the steps, `time`, and by the mesh, `space`; None where unknown.

        Where a part f ≥ 1/2 of the path was in doubled steps, the difference is divided by f.

        Args:
            scale: largest value of the output.
        """
        self.steps.finish()
        steps, mesh, scale = self.steps, self.mesh, scale if scale > 0.0 else np.inf
        out: dict[str, float | None] = {"time": None, "space": None}
        if steps.sound and steps.doubled >= steps.path / 2:
            whole = steps.difference[0] * (steps.path / steps.doubled if steps.doubled > 0.0 else 1.0)
            known = self.scheme.order <= CERTAIN and steps.late <= IN_PHASE
            out["time"] = (extrapolated(whole, self.scheme.order) if known else whole) / scale
        if steps.sound and mesh is not None and mesh.sound and self.other is not None:
            out["space"] = self.other.error(mesh.difference[0] / scale)
        return out
