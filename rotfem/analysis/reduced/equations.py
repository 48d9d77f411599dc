"""The equations of a reduced model over time: what acts on it, and what is left of the equations by a motion.

What acts is read as arrays: the factors cₚ of all pieces at many times at once.
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
from rotfem.mechanics.time_signals import SAME as RESOLVED

Array = npt.NDArray[np.float64]

#: Forces (n, unknowns) at times (n,), s.
Forces = Callable[[Array], Array]

#: Relative change of a matrix that is round-off.
SAME = 1e-12

#: Relative distance from a breakpoint at which a signal has the value that it has on that side of it.
ASIDE = 4 * RESOLVED

#: Samples between two breakpoints, and between all of them at least, by which active pieces are found.
SAMPLES, FEWEST = 5, 40

#: Angle by which a vibration goes on in a step, at most, that the four nodes of a step resolve: half a period, rad.
HALF = np.pi

#: Part of an interval from one sample to the next, counted on from its start: no multiple of it is a period.
GOLDEN = 0.5 * (np.sqrt(5.0) - 1)


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
        """Return times between all breakpoints at which what acts is typical of them, s."""
        number = max(SAMPLES, -(-FEWEST // (len(self.knots) - 1)))
        shares = np.sort(GOLDEN * (np.arange(number) + 1) % 1.0)
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
        about = slice(2, 3) if self.frame.planar else slice(0, 3)
        along = slice(0, 2) if self.frame.planar else slice(0, 3)
        slices = {"w": about, "dw": about, "a_o": along, "v_o": along, "gravity": along}
        moved = self._moved(t, *turn.T)
        values = {name: moved[name][:, slices.get(name, slice(None))] for name in self.frame.constants}
        return values | (self.loads(t) if loads is None else loads)

    def loads(self, t: Array) -> dict[str, Array]:
        """Return the values of the constants of loads at times (n,), by name, (n, size)."""
        values = {}
        for name, (constant, at) in self.system.structure.load_constants.items():
            if constant.follows_nodes:
                values[name] = np.array([at(float(s)) for s in t])
            else:
                values[name] = self._signal(f"loads.{name}", at, t)[:, : constant.value.size]
        return values

    def _moved(self, t: Array, angle: Array, speed: Array, rate: Array) -> dict[str, Array]:
        """Return what the frame's constants are at times, by name, as far as there are such, (n, components)."""
        axis, names, pitch = self.motion.axis, self.frame.constants, self.motion.pitch
        values = {"w": np.outer(speed, axis), "dw": np.outer(rate, axis)}
        if "a_o" in names or pitch is not None:
            values["a_o"] = self._signal("motion.base_acceleration", self.motion.base_acceleration, t)
        if "gravity" in names:
            values["gravity"] = self._gravity(angle)
        if pitch is None:
            return values
        beta, d_beta, dd_beta = (self._signal(name, at, t)[:, 0] for name, at in pitch.signals.items())
        beta = beta - pitch.start
        if "gravity" in names:
            values["gravity"] = pitch.seen(beta[:, None], values["gravity"])
        values |= pitch.moved((beta, d_beta, dd_beta), values["w"], values["dw"], values["a_o"])
        return values

    def _signal(self, name: str, at: Any, t: Array) -> Array:
        """Return the values of a signal, or of what does not change, at times (n,), shape (n, components)."""
        known = self._signals.get(name)
        values = known.values(t) if known else np.tile(np.atleast_1d(np.asarray(at(0.0), dtype=float)), (len(t), 1))
        return np.asarray(values, dtype=float)

    def _gravity(self, angle: Array) -> Array:
        """Return gravity in the turning frame (Rodrigues' formula, backwards), shape (n, 3)."""
        e, g = self.motion.axis, np.asarray(self.system.model.problem.loads.gravity, dtype=float)
        along = e * (e @ g)
        turned = along + np.outer(np.cos(angle), g - along) - np.outer(np.sin(angle), np.cross(e, g))
        return np.asarray(turned)


class HeldEquations:
    """The equations of a reduced model whose hub moves as prescribed.

    Args:
        model: the basis.
        excitation: what acts.
        further: of times (n,), s, forces (n, unknowns) that are added; none if None.
    """

    def __init__(self, model: ReducedModel, excitation: Excitation, further: Forces | None = None):
        self.model, self.excitation, self.further = model, excitation, further
        self.within = excitation.within
        matrices = model.operators(excitation.factors(excitation.samples()))[:3]
        self.constant = all(np.all(np.ptp(A, axis=0) <= SAME * np.abs(A).max(initial=0.0)) for A in matrices)

    def start(self, shape: Array | None) -> tuple[Array, Array]:
        """Return coordinates and rates (m,) at the start: of a shape (local dof array), or undeformed; at rest."""
        rest: Array = np.zeros(self.model.size)
        return rest if shape is None else self.model.coordinates(shape), rest

    def turn(self, t: Array, solution: Solution | None = None) -> Array:
        """Return angle (rad), speed and its rate of the frame at times (n,), s, (n, 3)."""
        return self.excitation.turn(t)

    def structure(self, y: Array) -> Array:
        """Return the coordinates of the structure (…, m) among unknowns."""
        return y[..., : self.model.size]

    def coordinates(self, solution: Solution, t: Array) -> States:
        """Return the states (n, m) of the structure in a solution at times (n,), s."""
        q, v, a = (self.structure(x) for x in solution.at(t))
        return q, v, a

    def reference(self, t: float, y: Array, v: Array) -> tuple[Array, Array, Array]:
        """Return M, C, K (m, m) at a time, s."""
        M, C, K, _ = self.model.operators(self.excitation.factors(np.array([t])))
        return M[0], C[0], K[0]

    def at(self, t: Array) -> Callable[[Array, Array, Array], Array]:
        """Return M a + C v + K q + f and further forces (n, m), a function of q, v and a (n, m)."""
        M, C, K, f = self.model.operators(self.excitation.factors(t))
        f = f if self.further is None else f + self.further(t)

        def residual(q: Array, v: Array, a: Array) -> Array:
            return np.asarray(f + sum(np.einsum("nij,nj->ni", A, x) for A, x in ((M, a), (C, v), (K, q))))

        return residual

    def second_order(self, manifold: Manifold, solution: Solution) -> Forces:
        """Return the forces (n, unknowns) of a linear solution on a manifold, a function of times; none on a hub."""
        fastest = HALF / float(np.diff(solution.ends).max())

        def forces(t: Array) -> Array:
            c = self.excitation.factors(t, self.turn(t, solution))
            states = solution.at(t, fastest)
            out = np.zeros_like(states[0])
            self.structure(out)[:] = manifold.forces(c, *(self.structure(x) for x in states))
            return out

        return forces
