"""Reduced models on a free hub: its angle ψ is one more unknown, and its equation one more.

The work of the structure in a rigid turn of the hub is a polynomial in η, η̇ and η̈ and in the constants of frame and
loads. Its derivatives at rest are read from the hub's row (`rotfem.equations.bordered`) along the basis, one constant
at a time,

    G = g + g_q·η + g_v·η̇ + g_a·η̈ + ½ η·Q η + ½ η̇·U η̇ + η̇·W η + η̈·A η,    I ψ̈ + c ψ̇ + G = M(t),

so that it has all of second order, the angular momentum with it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.reduced.equations import Excitation, Forces, HeldEquations
from rotfem.analysis.reduced.model import ReducedModel
from rotfem.analysis.reduced.solution import Solution
from rotfem.mechanics.time_signals import POINTS, WEIGHTS
from rotfem.numerics.projection import summed

Array = npt.NDArray[np.float64]

#: Rotation, or displacement over the length, by which a shape is moved for a derivative that is linear in it.
SMALL = 1e-5

#: Part of the largest change that is round-off.
ROUND_OFF = 1e-9

#: Shifts of the row: which of its derivatives it is; and second derivatives, of the row of the first with the second.
SHIFTS = {"q": (1.0, 0.0, 0.0), "v": (0.0, 1.0, 0.0), "a": (0.0, 0.0, 1.0)}
PAIRS = {"qq": 0.5, "vv": 0.5, "vq": 1.0, "aq": 1.0}

#: Times at which the speed of a rigid structure is known.
RIGID = 2001


@dataclass
class Polynomial:
    """What belongs to one product of constants: value, slopes (3, m) by q, v and a, and matrices (4, m, m) by PAIRS."""

    value: float
    slopes: Array
    matrices: Array

    def less(self, other: Polynomial, factor: float = 1.0) -> Polynomial:
        """Return the difference from another, times a factor."""
        return Polynomial(
            factor * (self.value - other.value),
            factor * (self.slopes - other.slopes),
            factor * (self.matrices - other.matrices),
        )


class HubMoment:
    """The moment G of a structure on its free hub.

    Args:
        model: of the structure.
        row: the hub's equation.

    Attributes:
        parts: polynomials by the constant and its component that they are multiplied by; ("", 0) by 1, ("ww", 0) by
            the square of the speed. "w" and "dw" stand for the speed and its rate about the axis.
    """

    def __init__(self, model: ReducedModel, row: Any):
        self.model, self.row, self.system = model, row, model.system
        self.constants = dict(self.system.model.frame.constants)
        self.constants |= {name: c for name, (c, _) in self.system.structure.load_constants.items()}
        kept = {name: constant.value.copy() for name, constant in self.constants.items()}
        self.parts = self._parts()
        for name, value in kept.items():
            self.constants[name].value[...] = value
        self.system.structure.update_loads()
        parts = self.parts.values()
        self._values = np.array([p.value for p in parts])
        self._slopes, self._matrices = np.array([p.slopes for p in parts]), np.array([p.matrices for p in parts])

    def _parts(self) -> dict[tuple[str, int], Polynomial]:
        base = self._at("", 0, 0.0)
        parts = {("", 0): base}
        for name, constant in self.constants.items():
            if name == "w":
                plus, minus = self._at("w", 0, 1.0), self._at("w", 0, -1.0)
                parts["w", 0] = plus.less(minus, 0.5)
                parts["ww", 0] = plus.less(base, 0.5).less(base.less(minus, 0.5))
                continue
            for i in range(1 if name == "dw" else constant.value.size):
                parts[name, i] = self._at(name, i, 1.0).less(base)
        return parts

    def _at(self, name: str, component: int, value: float) -> Polynomial:
        """Return the polynomial with one constant at a value and all others at zero."""
        for constant in self.constants.values():
            constant.value[...] = 0.0
        if name in ("w", "dw"):
            constant = self.constants[name]
            constant.value[...] = value * self.system.motion.axis[-constant.value.size :]
        elif name:
            self.constants[name].value.flat[component] = value
        self.system.structure.update_loads()
        m, zero = self.model.size, self.system.zeros()
        self.system.set_state(zero)
        moment, rest = self.row.work(), {kind: self._slope(kind, zero, zero) for kind in SHIFTS}
        coupled = self.row.coupled and m
        matrices = [self._matrix(pair[0], pair[1], rest) if coupled else np.zeros((m, m)) for pair in PAIRS]
        return Polynomial(moment, np.array(list(rest.values())), np.array(matrices))

    def _slope(self, kind: str, q: Array, v: Array) -> Array:
        """Return the row's derivative by q, v or a along the basis at a state, (m,)."""
        if not self.row.coupled:
            return np.zeros(self.model.size)
        self.system.set_state(q, v)
        vector, owned = self.row.row(SHIFTS[kind]).array, self.model.owned
        return np.asarray(summed(self.system.comm, self.model.V[owned].T @ vector[owned]))

    def _matrix(self, kind: str, along: str, rest: dict[str, Array]) -> Array:
        """Return a second derivative along the basis; zeros where a direction of no special kind shows none."""
        V, zero = self.model.V, self.system.zeros()

        def change(shape: Array) -> Array:
            size = SMALL / max(self.system.size(shape), 1e-300)
            state = (size * shape, zero) if along == "q" else (zero, size * shape)
            return np.asarray((self._slope(kind, *state) - rest[kind]) / size)

        any_direction = change(V @ np.cos(np.arange(1.0, self.model.size + 1)))
        scale = float(np.abs(rest[kind]).max(initial=0.0)) / SMALL
        if not np.any(np.abs(any_direction) > ROUND_OFF * scale):
            return np.zeros((self.model.size,) * 2)
        return np.array([change(column) for column in V.T]).T

    # --- at many times -----------------------------------------------------------------------------------------------

    def weights(self, constants: dict[str, Array], speed: Array, rate: Array) -> Array:
        """Return what the polynomials are multiplied by, in the order of the parts, (n, parts)."""
        own = {"": np.ones_like(speed), "w": speed, "ww": speed**2, "dw": rate}
        return np.stack([own[name] if name in own else constants[name][:, i] for name, i in self.parts], axis=1)

    def outside(self, weights: Array, q: Array) -> Array:
        """Return the moment of all forces that are no change of momentum, at rest in the frame (n,), N·m."""
        apart = np.array([name not in ("", "w", "ww", "dw") for name, _ in self.parts])
        return -self.value(weights * apart, q, 0 * q, 0 * q)

    def value(self, weights: Array, q: Array, v: Array, a: Array) -> Array:
        """Return G of states (n, m), (n,)."""
        slopes, matrices = np.tensordot(weights, self._slopes, 1), np.tensordot(weights, self._matrices, 1)
        state = {"q": q, "v": v, "a": a}
        out = weights @ self._values + np.einsum("nki,kni->n", slopes, np.stack([q, v, a]))
        for k, (pair, factor) in enumerate(PAIRS.items()):
            out = out + factor * np.einsum("ni,nij,nj->n", state[pair[0]], matrices[:, k], state[pair[1]])
        return np.asarray(out)


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
        of_rate = [p.slopes[2] for p in self.moment.parts.values()]
        constants = self.excitation.constants(there, turn)
        weights = self.moment.weights(constants, turn[:, 1], turn[:, 2])[0]
        inertia = self.hub.inertia + (self.moment.parts["dw", 0].value if ("dw", 0) in self.moment.parts else 0.0)
        M, C, K = (np.zeros((m + 1, m + 1)) for _ in range(3))
        for whole, own, corner in zip((M, C, K), small, (inertia, self.hub.damping, inertia), strict=True):
            whole[:m, :m], whole[m, m] = own[0], corner
        M[:m, m], M[m, :m] = (pushed - f)[0], weights @ np.array(of_rate)
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
            moment = self.moment.value(self.moment.weights(constants, *turn.T[1:]), q, v, a)
            return np.column_stack([out, own + moment]) + further

        return residual

    def given(self, solution: Solution, times: Array) -> dict[str, Array]:
        """Return angular impulse (N·m·s) and work (J) from outside until times: torque, brake, loads (see `State`)."""
        grid = np.union1d(solution.ends, times)
        t = self.within(grid[:-1], grid[1:], POINTS)
        turn, (q, _, _) = self.turn(t.ravel(), solution), self.coordinates(solution, t.ravel())
        turn[:, 2] = 0.0
        torque = self.hub.torque.many(t.ravel()) - self.hub.damping * turn[:, 1]
        weights = self.moment.weights(self.excitation.constants(t.ravel(), turn), *turn.T[1:])
        rates = {"impulse": torque + self.moment.outside(weights, q), "work": torque * turn[:, 1]}
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
