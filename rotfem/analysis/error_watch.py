"""What a motion's steps and mesh put its tip off, found while it goes on, from the states that it passes anyway.

In a few shapes V that move the tip, c = Vᵀ M q, the states of a motion say by which force each shape was driven,

    γ = c̈ + C ċ + K c,

with M, C, K of the tangents on the way. What drove it is all that these matrices are not, loads, spin and nonlinear
terms, and is smooth where the motion of the shapes need not be resolved. The exact answer to γ between the states
(`rotfem.analysis.error_recursion`) against the states themselves is what the steps have put off, with the phase that
has been lost so far. A frequency that the mesh puts off by ε likewise moves c as the force 2 ε ω² c would.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.error_bursts import OF_MESH, ORDER, Burst, burst_in, growth_in
from rotfem.analysis.error_samples import Samples
from rotfem.analysis.error_tracks import largest_errors
from rotfem.analysis.error_window import MeshErrors, Window
from rotfem.analysis.schemes import Instant, State
from rotfem.analysis.turning_view import TurningView
from rotfem.errors import ComputationError

Array = npt.NDArray[np.float64]

#: Windows of a history, fewest steps in one by unknowns (the last one takes those that would be fewer), and bytes of
#: states up to which one goes on, and with which those before are looked at while the march is under way.
WINDOWS, FEWEST, LARGE, MEMORY = 8, (50, 100), 2000, 64_000_000

#: Steps of a window where the speed is constant, so that only the deflection changes a tangent, and more than two such
#: windows are to come: of two halves one tells how far the other is off.
STEADY = 100


@dataclass(frozen=True)
class TipErrors:
    """Largest errors of the tip's displacement over a motion, and what they are relative to.

    Attributes:
        time: of the steps, m, and when (s); None where it is not known.
        space: of the mesh, as far as inertia moves it, m, and when (s).
        model: of the theory, as far as phases are lost by it, m, and when (s).
        shape: of the mesh at the largest deflection, relative.
        scale: largest displacement of the tip, m.
        burst: of the motion, with whose growth that of the steps is told; None if there is none.
    """

    time: tuple[float, float] | None
    space: tuple[float, float]
    model: tuple[float, float]
    shape: float
    scale: float
    burst: Burst | None = None


class ErrorWatch:
    """Looks at every step of a march; of a steady state only at its mesh.

    Args:
        system: equations of motion.
        end: length of the history, s; 0 of a steady state.
        scheme: that steps it; None of a steady state.
    """

    def __init__(self, system: Any, end: float = 0.0, scheme: Any = None):
        self._view = None if system.clamp is None else TurningView(system)
        self.system: Any = system if self._view is None else self._view.system
        self.end, self.scheme = end, scheme
        self._mesh = MeshErrors.of(self.system)
        self._fewest = FEWEST[system.A.getSize()[0] > LARGE]
        self._now = Samples([], [], [])
        #: Windows that have ended, to be looked at together: a march that is left alone is quicker.
        self._ended: list[Samples] = []
        self._windows: list[Window] = []
        self._bytes = self._waiting = self._closed = 0
        self._landed = False
        #: The state that the last step has led to, as the march has it.
        self._reached: State | None = None
        #: Whether all windows could be solved.
        self._sound = True
        self._farthest: tuple[float, State | None] = (0.0, None)

    def __call__(self, old: Any, new: Any) -> None:
        """Look at a step from an old to a new state."""
        now, reached = self._now, self._reached
        states = now.states
        if self._landed or not states or reached is None or reached.a is not old.a or reached.q is not old.q:
            self._landed = False
            now.pieces.append(len(states))
            states.append(self._seen(old))
        states.append(self._seen(new))
        self._reached, number = new, len(states)
        now.inner += [(len(now.steps), *self._within(new, instant)) for instant in new.inner]
        now.steps.append((number - 2, number - 1))
        self._bytes += 3 * new.q.nbytes * (1 + len(new.inner))
        due = number > self._fewest and new.t >= (self._closed + 1) * self.end / WINDOWS
        if (due and self._is_enough(new.t)) or self._bytes > MEMORY:
            self._close(new.t)
            if self._waiting > MEMORY:
                self.catch_up(new)

    def _is_enough(self, t: float) -> bool:
        """Return whether this window may end at a time (s) and those to come have enough steps, at the pace of it."""
        steps, since = len(self._now.steps), self._now.states[0][0]
        left = (self.end - t) / (t - since) * steps
        if steps < self._fewest or left <= self._fewest - 0.5:
            return False
        return steps >= min(STEADY, (steps + left) / 2 - 0.5) or not self._steady(since, t)

    def _steady(self, since: float, t: float) -> bool:
        """Return whether the hub turns at a constant speed from one time to another, s, as far as these say it."""
        motion = self.system.motion
        if self.system.hub is not None or motion.pitch is not None:
            return False
        return all(motion.rate(s) == 0.0 and motion.speed(s) == motion.speed(t) for s in (since, 0.5 * (since + t), t))

    def _seen(self, state: State) -> tuple[float, Array, Array, Array, Any]:
        """Return t, q, v, a of a state in the frame that turns, and what rotations are counted from."""
        s = state if self._view is None else self._view.state(state)
        return s.t, s.q, s.v, s.a, s.datum

    def _within(self, new: State, instant: Instant) -> Instant:
        """Return an instant within the step to a state in the frame that turns."""
        if self._view is None:
            return instant
        t, q, v, a = instant
        s = self._view.state(new.changed(t=t, q=q, v=v, a=a))
        return s.t, s.q, s.v, s.a

    def landed(self) -> None:
        """Take note that what drives the motion is not smooth where the last step has ended."""
        self._landed = True

    def errors(self, last: Any, lacking: float = 0.0) -> TipErrors:
        """Return the errors so far.

        Args:
            last: state of the march.
            lacking: part of the stiffness of what bends that a linear theory lacks.
        """
        if self._now.steps:
            self._close(last.t)
        self.catch_up(last)
        size, state = self._farthest
        if state is None:
            state = last if self._view is None else self._view.state(last)
            size = float(self._tip_sizes(state.q[None])[0])
        shape = self._shape(state, size)
        nothing = dict.fromkeys(("time", "space", "model"), (0.0, 0.0))
        found = nothing
        if self._windows and self._sound:
            for window in self._windows if lacking > 0.0 else ():
                window.lacks(lacking)
            held = self.system.held
            with np.errstate(all="ignore"):  # where damping or growth is beyond numbers nothing is known
                found = largest_errors(self._windows, self.scheme, held.linear, size, held.structure.length)
            self._sound = bool(np.isfinite(list(found.values())).all())
            found = found if self._sound else nothing
        if not self._sound:
            return TipErrors(None, found["space"], found["model"], shape, size)
        time, (space, later), (growth, burst) = found["time"], found["space"], self._growth(size)
        if burst is not None:
            time = (time[0] * growth, burst.t)
        return TipErrors(time, (space * min(growth, OF_MESH), later), found["model"], shape, size, burst)

    def _growth(self, size: float) -> tuple[float, Burst | None]:
        """Return by which factor errors grow beyond what tangents say, and the burst they do in; None without.

        Args:
            size: largest displacement of the tip, m.
        """
        if not self._windows or self.scheme.order > ORDER:
            return 1.0, None
        lengths, rates = (np.concatenate([getattr(w, name) for w in self._windows]) for name in ("lengths", "rates"))
        ends = np.concatenate([w.t[w.ends[1]] for w in self._windows])
        slowest = np.median([np.sqrt(np.abs(w.shapes.squares).min()) for w in self._windows])
        burst = burst_in(ends, lengths, rates, float(slowest))
        if burst is not None:
            return burst.growth, burst
        return growth_in(lengths, rates, size / self.system.held.structure.length), None

    def _shape(self, state: State, size: float) -> float:
        """Return the error of a state by the mesh, relative to the largest deflection (m).

        A finer mesh says it; without one the deflection's own shape says it roughly.
        """
        if size > 0.0 and (fine := self._mesh.refined.of_state(state)) is not None:
            return fine / size
        return self._mesh.shape.of_shape(state.q[: len(self.system.held.zeros())], state.datum)

    def _close(self, t: float) -> None:
        """End a window at a time (s)."""
        self._ended.append(self._now)
        self._waiting += self._bytes
        self._closed = int(t / self.end * WINDOWS + 1e-9)
        self._now, self._bytes = Samples([], [], []), 0

    def catch_up(self, last: Any) -> None:
        """Look at the windows that have ended, the last state given."""
        if not self._ended:
            return
        for samples in self._ended:
            self._look_at(samples)
        self._ended, self._waiting = [], 0
        self.system.count_rotations_from(last.datum)
        self.system.set_time(last.t)

    def _look_at(self, samples: Samples) -> None:
        """Look at a window."""
        sizes = self._tip_sizes(samples.displacements)
        i = int(np.argmax(sizes))
        samples.size = float(sizes[i])
        if sizes[i] > self._farthest[0]:
            self._farthest = (float(sizes[i]), samples.state(i))
        if not self._sound:
            return
        before = self._windows[-1] if self._windows else None
        try:
            with np.errstate(all="ignore"):
                self._windows.append(Window(self.system, self._mesh, samples, self.end, before))
        except (ComputationError, np.linalg.LinAlgError):
            self._sound = False

    def _tip_sizes(self, shapes: Array) -> Array:
        """Return the displacement of the tip in shapes (n, unknowns), m, (n,)."""
        inner = self.system.held
        values, names = inner.structure.tip_values, inner.structure.unknowns
        dofs = [values.dofs.start + i for i, name in enumerate(names) if name.startswith("u")]
        here: Array = np.zeros(len(shapes))
        if inner.comm.rank == values.owner:  # others may have no unknowns at all
            here[:] = np.linalg.norm(shapes[:, dofs], axis=1)
        if inner.comm.size > 1:
            inner.comm.Bcast(here, root=values.owner)
        return here
