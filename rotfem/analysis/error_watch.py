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

from rotfem.analysis.error_recursion import Propagator, Spans, accumulated, interpolated
from rotfem.analysis.reduced_tangents import Tangents
from rotfem.analysis.ritz_vectors import RitzVectors
from rotfem.analysis.schemes import State
from rotfem.analysis.shape_error import ShapeError
from rotfem.errors import ComputationError

Array = npt.NDArray[np.float64]

#: Windows of a history, fewest steps in one by unknowns, and most bytes of states that are kept.
WINDOWS, FEWEST, LARGE, MEMORY = 8, (20, 100), 2000, 64_000_000

#: Samples of γ a polynomial goes through, beyond the order of the scheme.
BEYOND = 2

#: Part of a turn in a history by which the angle of a free hub is held, so that no eigenvalue is double.
HELD = 0.01


@dataclass(frozen=True)
class TipErrors:
    """Largest errors of the tip's displacement over a motion, and what they are relative to.

    Attributes:
        time: of the steps, m, and when (s); None where it is not known.
        space: of the mesh, as far as inertia moves it, m, and when (s).
        shape: of the mesh at the largest deflection, relative.
        scale: largest displacement of the tip, m.
    """

    time: tuple[float, float] | None
    space: tuple[float, float]
    shape: float
    scale: float


class ErrorWatch:
    """Looks at every step of a march; of a steady state only at its mesh.

    Args:
        system: equations of motion.
        end: length of the history, s; 0 of a steady state.
        scheme: that steps it; None of a steady state.

    Attributes:
        since: from when on (s) it has looked; None before the first step.
    """

    def __init__(self, system: Any, end: float = 0.0, scheme: Any = None):
        self.system, self.end, self.scheme = system, end, scheme
        self.since: float | None = None
        self._mesh = ShapeError(system.held)
        self._fewest = FEWEST[system.A.getSize()[0] > LARGE]
        self._samples: list[tuple[float, Array, Array, Array, Any]] = []
        self._steps: list[tuple[int, int]] = []
        self._pieces: list[int] = []
        self._bytes = self._closed = 0
        self._landed = False
        #: Whether all windows could be solved, and there were equations to solve them by.
        self._sound = system.clamp is None
        self._shapes: RitzVectors | None = None
        self._carried: Array = np.zeros((2, 0))
        self._largest = {"time": (0.0, 0.0), "space": (0.0, 0.0)}
        self._farthest: tuple[float, Array, Any] = (0.0, np.zeros(0), None)

    def __call__(self, old: Any, new: Any) -> None:
        """Look at a step from an old to a new state."""
        samples = self._samples
        if self.since is None:
            self.since = old.t
        if self._landed or not samples or samples[-1][3] is not old.a or samples[-1][1] is not old.q:
            self._landed = False
            self._pieces.append(len(samples))
            samples.append((old.t, old.q, old.v, old.a, old.datum))
        samples.append((new.t, new.q, new.v, new.a, new.datum))
        self._steps.append((len(samples) - 2, len(samples) - 1))
        self._bytes += 3 * new.q.nbytes
        due = new.t >= (self._closed + 1) * self.end / WINDOWS and len(self._steps) >= self._fewest
        if due or self._bytes > MEMORY:
            self._close(new)

    def landed(self) -> None:
        """Take note that what drives the motion is not smooth where the last step has ended."""
        self._landed = True

    def errors(self, last: Any) -> TipErrors:
        """Return the errors so far, the last state given."""
        if self._steps:
            self._close(last)
        size, q, datum = self._farthest
        if not q.size:
            size, q, datum = float(self._tip_sizes([last.q])[0]), last.q, last.datum
        shape = self._mesh.of_shape(q[: len(self.system.held.zeros())], datum)
        return TipErrors(self._largest["time"] if self._sound else None, self._largest["space"], shape, size)

    # --- a window ----------------------------------------------------------------------------------------------------

    def _close(self, last: Any) -> None:
        """Find the errors of the steps since the last window."""
        sizes = self._tip_sizes([sample[1] for sample in self._samples])
        i = int(np.argmax(sizes))
        if sizes[i] > self._farthest[0]:
            self._farthest = (float(sizes[i]), self._samples[i][1], self._samples[i][4])
        if self._sound:
            try:
                self._solve()
            except (ComputationError, np.linalg.LinAlgError):
                self._sound = False
            self.system.count_rotations_from(last.datum)
            self.system.set_time(last.t)
        self._closed = int(last.t / self.end * WINDOWS + 1e-9)
        self._samples, self._steps, self._pieces, self._bytes = [], [], [], 0

    def _solve(self) -> None:
        tangents = Tangents(self.system, self._middle)
        shapes = tangents.shapes()
        M, C, K = tangents.reduced(shapes)
        if self.system.hub is not None:
            K[-1, -1] += HELD * M[-1, -1] * (2 * np.pi / self.end) ** 2
        self._propagate(shapes, np.asarray(np.linalg.solve(M, C)), np.asarray(np.linalg.solve(M, K)))
        self._shapes = shapes

    @property
    def _middle(self) -> State:
        """The state in the middle of the window."""
        t = [sample[0] for sample in self._samples]
        i = int(np.searchsorted(t, 0.5 * (t[0] + t[-1])))
        return State(*self._samples[i][:4], datum=self._samples[i][4])

    def _propagate(self, shapes: RitzVectors, C: Array, K: Array) -> None:
        """Go on with the errors through the window, with C and K per unit mass."""
        t = np.array([sample[0] for sample in self._samples])
        c, v, a = (self._coordinates(shapes, list(arrays)) for arrays in list(zip(*self._samples, strict=True))[1:4])
        begin, end = np.array(self._steps).T
        h = t[end] - t[begin]
        exact = Propagator(C, K, h)
        states = exact.modal(c, v)
        drift = states[end] - exact.factors * states[begin] - exact.forced(self._drives(t, (c, v, a), (C, K)))
        off = self._mesh_force(shapes, a)
        late = exact.forced(np.stack([off[begin], off[end] - off[begin]], axis=1))
        starts = exact.modal(*self._start(shapes))
        errors = [accumulated(start, exact.factors, each) for start, each in zip(starts, (drift, late), strict=True)]
        self._carried = np.array([exact.state(e[-1]) for e in errors])
        for name, e in zip(self._largest, errors, strict=True):
            at_tip = exact.displacements(e)[:, : shapes.tip.shape[1]] @ shapes.tip.T
            sizes = np.linalg.norm(at_tip, axis=1)
            i = int(np.argmax(sizes))
            self._largest[name] = max(self._largest[name], (float(sizes[i]), float(t[end[i]])))

    def _tip_sizes(self, shapes: list[Array]) -> Array:
        """Return the displacement of the tip in shapes (local dof arrays), m."""
        inner = self.system.held
        values, names = inner.structure.tip_values, inner.structure.unknowns
        dofs = [values.dofs.start + i for i, name in enumerate(names) if name.startswith("u")]
        here: Array = np.linalg.norm(np.array([q[dofs] for q in shapes]), axis=1)
        if inner.comm.size > 1:
            inner.comm.Bcast(here, root=values._owner)
        return here

    def _coordinates(self, shapes: RitzVectors, arrays: list[Array]) -> Array:
        """Return Vᵀ M x of local dof arrays, (n, r); of a free hub with its angle."""
        n = len(shapes.V)
        X = np.array([x[:n] for x in arrays])
        out = shapes.sum(X @ shapes.massed)
        if self.system.hub is not None:
            out = np.column_stack([out, [x[-1] for x in arrays]])
        return out

    def _drives(self, t: Array, motion: tuple[Array, Array, Array], CK: tuple[Array, Array]) -> Array:
        """Return γ over every step as polynomials."""
        (c, v, a), (C, K) = motion, CK
        begin, end = np.array(self._steps).T
        piece = np.searchsorted(self._pieces, begin, side="right") - 1
        first = np.array(self._pieces)[piece]
        last = np.array([*self._pieces[1:], len(t)])[piece] - 1
        h = t[end] - t[begin]
        most = self.scheme.order + BEYOND
        if self.scheme.balanced_at_end:
            gamma = a + v @ C.T + c @ K.T
            return interpolated(t, gamma, Spans(t[begin], h, begin, first, last), most)
        middle = [0.5 * (x[begin] + x[end]) for x in (t, c, v)]
        gamma = a[end] + middle[2] @ C.T + middle[1] @ K.T
        first, last = first - piece, last - piece - 1  # one sample fewer in each piece
        return interpolated(middle[0], gamma, Spans(t[begin], h, np.arange(len(h)), first, last), most)

    def _mesh_force(self, shapes: RitzVectors, a: Array) -> Array:
        """Return 2 ε c̈: the forces of inertia, whose static answer the mesh puts off by 2 ε."""
        epsilon = self._mesh.of_modes(shapes.V)
        out = np.zeros_like(a)
        out[:, : len(epsilon)] = 2.0 * epsilon * a[:, : len(epsilon)]
        return out

    def _start(self, shapes: RitzVectors) -> tuple[Array, Array]:
        """Return the errors of time and space that the window starts with, c and ċ, shape (2, r) each."""
        r = shapes.V.shape[1]
        size = r + (self.system.hub is not None)
        out = np.zeros((2, 2, size))
        if self._shapes is not None:
            turn = shapes.sum(shapes.V.T @ self._shapes.massed)
            old = self._carried.reshape(2, 2, -1)
            out[:, :, :r] = old[:, :, : turn.shape[1]] @ turn.T
            if size > r:
                out[:, :, -1] = old[:, :, -1]
        return out[:, 0], out[:, 1]
