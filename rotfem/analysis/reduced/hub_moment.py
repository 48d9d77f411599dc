"""The work of a structure in a rigid turn of its free hub, to second order in the coordinates of a basis.

It is a polynomial in q, v and a and in the constants of frame and loads. Its derivatives at rest are read from the
hub's row (`rotfem.equations.bordered`) in the directions of the basis, one constant at a time:

    G = g + g_q·q + g_v·v + g_a·a + ½ q·Q q + ½ v·U v + v·W q + a·A q.

The angular momentum and all else of second order is in it; terms of third order, which second-order directors have,
are not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.reduced.model import ReducedModel
from rotfem.numerics.projection import summed

Array = npt.NDArray[np.float64]

#: Rotation, or displacement over the length, by which a shape is moved to see what changes with it.
SMALL = 1e-5

#: Part of the largest change that is round-off.
ROUND_OFF = 1e-9

#: Shifts of the row: which of its derivatives it is.
SHIFTS = {"q": (1.0, 0.0, 0.0), "v": (0.0, 1.0, 0.0), "a": (0.0, 0.0, 1.0)}

#: Second derivatives: of the row of the first with the second.
PAIRS = ("qq", "vv", "vq", "aq")


@dataclass
class Polynomial:
    """What belongs to one product of constants: value, slopes (m,) by "q", "v", "a", and matrices (m, m) by PAIRS."""

    value: float
    slopes: dict[str, Array]
    matrices: dict[str, Array]

    def less(self, other: Polynomial, factor: float = 1.0) -> Polynomial:
        """Return the difference from another, times a factor."""
        return Polynomial(
            factor * (self.value - other.value),
            {k: factor * (x - other.slopes[k]) for k, x in self.slopes.items()},
            {k: factor * (x - other.matrices[k]) for k, x in self.matrices.items()},
        )


@dataclass(frozen=True)
class Directions:
    """Shapes V, local dof arrays (n, m), of a system; owned are the unknowns of this process."""

    system: Any
    V: Array
    owned: Any

    @classmethod
    def of(cls, model: ReducedModel) -> Directions:
        """Return the basis of a reduced model."""
        return cls(model.system, model.V, model.owned)

    @property
    def size(self) -> int:
        """Number of shapes."""
        return int(self.V.shape[1])


class HubMoment:
    """The polynomials of all constants, with the effects that are on.

    Args:
        basis: of the structure.
        row: the hub's equation.
        first_order: leaves out what is of second order in the coordinates.

    Attributes:
        parts: polynomials by the constant and its component that they are multiplied by; ("", 0) by 1, ("ww", 0) by
            the square of the speed. "w" and "dw" stand for the speed and its rate about the axis.
        size: number of coordinates.
    """

    def __init__(self, basis: Directions, row: Any, first_order: bool = False):
        self.basis, self.row, self.system, self.size = basis, row, basis.system, basis.size
        self._first_order = first_order
        self.constants = dict(self.system.model.frame.constants)
        self.constants |= {name: c for name, (c, _) in self.system.structure.load_constants.items()}
        kept = {name: constant.value.copy() for name, constant in self.constants.items()}
        self._axis = self.system.motion.axis
        self.parts = self._parts()
        for name, value in kept.items():
            self.constants[name].value[...] = value
        self.system.structure.update_loads()

    def _parts(self) -> dict[tuple[str, int], Polynomial]:
        base = self._at("", 0, 0.0)
        parts = {("", 0): base}
        if not self.row.coupled:
            base = Polynomial(base.value, {k: 0 * x for k, x in base.slopes.items()}, base.matrices)
            parts = {("", 0): base}
        for name, constant in self.constants.items():
            if name == "w":
                plus, minus = self._at("w", 0, 1.0), self._at("w", 0, -1.0)
                parts["w", 0] = plus.less(minus, 0.5)
                half = plus.less(base, 0.5)
                parts["ww", 0] = half.less(base.less(minus, 0.5))
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
            constant.value[...] = value * self._axis[-constant.value.size :]
        elif name:
            self.constants[name].value.flat[component] = value
        self.system.structure.update_loads()
        system, m = self.system, self.size
        zero = system.zeros()
        system.set_state(zero)
        moment = self.row.work()
        rest = {kind: self._slope(kind, zero, zero) for kind in SHIFTS}
        matrices: dict[str, Array] = {pair: np.zeros((m, m)) for pair in PAIRS}
        if self.row.coupled and m and not self._first_order:
            matrices = {pair: self._matrix(pair[0], pair[1], rest) for pair in PAIRS}
        return Polynomial(moment, rest, matrices)

    def _slope(self, kind: str, q: Array, v: Array) -> Array:
        """Return the row's derivative by q, v or a along the basis at a state, (m,)."""
        if not self.row.coupled:
            return np.zeros(self.size)
        self.system.set_state(q, v)
        vector, V = self.row.row(SHIFTS[kind]).array, self.basis.V[self.basis.owned]
        return np.asarray(summed(self.system.comm, V.T @ vector[self.basis.owned]))

    def _matrix(self, kind: str, along: str, rest: dict[str, Array]) -> Array:
        """Return a second derivative along the basis; zeros where a direction at random shows none."""
        V, zero = self.basis.V, self.system.zeros()

        def change(shape: Array) -> Array:
            size = SMALL / max(self.system.size(shape), 1e-300)
            state = (size * shape, zero) if along == "q" else (zero, size * shape)
            return np.asarray((self._slope(kind, *state) - rest[kind]) / size)

        weights = np.cos(np.arange(1.0, self.size + 1))
        any_direction = change(V @ weights)
        scale = float(np.abs(rest[kind]).max(initial=0.0)) / SMALL
        if not np.any(np.abs(any_direction) > ROUND_OFF * scale):
            return np.zeros((self.size,) * 2)
        return np.array([change(column) for column in V.T]).T

    # --- at many times -----------------------------------------------------------------------------------------------

    def weights(self, constants: dict[str, Array], speed: Array, rate: Array) -> Array:
        """Return what the polynomials are multiplied by, in the order of the parts, (n, parts)."""
        own = {"": np.ones_like(speed), "w": speed, "ww": speed**2, "dw": rate}
        return np.stack([own[name] if name in own else constants[name][:, i] for name, i in self.parts], axis=1)

    def outside(self, weights: Array, q: Array) -> Array:
        """Return the moment of all forces that are no change of momentum, at rest in the frame (n,), N·m."""
        apart = np.array([name not in ("", "w", "ww", "dw") for name, _ in self.parts])
        zero = np.zeros_like(q)
        return -self.value(weights * apart, q, zero, zero)

    def value(self, weights: Array, q: Array, v: Array, a: Array) -> Array:
        """Return G of states (n, m), (n,)."""
        value, slopes, matrices = self._sums(weights)
        out = value + sum(np.einsum("ni,ni->n", slopes[k], x) for k, x in (("q", q), ("v", v), ("a", a)))
        for pair, x, y, factor in (("qq", q, q, 0.5), ("vv", v, v, 0.5), ("vq", v, q, 1.0), ("aq", a, q, 1.0)):
            out = out + factor * np.einsum("ni,nij,nj->n", x, matrices[pair], y)
        return np.asarray(out)

    def slopes(self, weights: Array, q: Array, v: Array, a: Array) -> tuple[Array, Array, Array]:
        """Return the derivatives of G by q, v and a at states (n, m), (n, m) each."""
        _, slopes, H = self._sums(weights)

        def times(A: Array, x: Array) -> Array:
            return np.asarray(np.einsum("nij,nj->ni", A, x))

        turned = {pair: H[pair].transpose(0, 2, 1) for pair in PAIRS}
        by_q = slopes["q"] + times(H["qq"], q) + times(turned["vq"], v) + times(turned["aq"], a)
        return by_q, slopes["v"] + times(H["vq"], q) + times(H["vv"], v), slopes["a"] + times(H["aq"], q)

    def _sums(self, weights: Array) -> tuple[Array, dict[str, Array], dict[str, Array]]:
        parts = list(self.parts.values())
        value = weights @ np.array([p.value for p in parts])
        slopes = {k: weights @ np.array([p.slopes[k] for p in parts]) for k in SHIFTS}
        matrices = {k: np.tensordot(weights, np.array([p.matrices[k] for p in parts]), 1) for k in PAIRS}
        return value, slopes, matrices
