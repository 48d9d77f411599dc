"""Solution in time of the equations of a reduced model, by exact integration in modal coordinates.

Equations r(t, y, ẏ, ÿ) = 0 of few unknowns are those of a reference with constant matrices M, C, K and the rest g,

    M(ÿ − g) + C ẏ + K y = 0,    g = ÿ + M⁻¹(C ẏ + K y − r),    r(t, y, ẏ, ÿ) = 0.

With x = (y, ẏ), ẋ = A x + (0, g) and A = X Λ X⁻¹, the modal coordinates z = X⁻¹x of a step of length h from t follow

    z(t + τh) = e^{λτh} z(t) + Σ_d τh τᵈ d! φ_{d+1}(λτh) g_d,    g(t + τh) = Σ_{d=0..3} g_d τᵈ,

where φ_{d+1}(z) = (φ_d(z) − 1/d!)/z and φ_0 = exp (Hochbruck & Ostermann 2010, Exponential integrators, eq. 2.11). It
is exact for vibrations of any frequency. g goes through its values at the four Lobatto nodes of the step. These are
found by

    g ← g − M⁻¹ r(t, y, ẏ, ÿ)

for all nodes of a window of steps at once, Picard's iteration. It converges the quicker the shorter the window and the
nearer the reference, which is that of the middle of the window (section 2.2 there). With constant matrices and no
other terms in r its first iterate is the solution. The two eigenvectors of a double λ = 0, as of a hinge without a
spring or a free hub, are one: the reference is a little stiffer there.
"""

from __future__ import annotations

from math import factorial
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.linalg

from rotfem.errors import ComputationError

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

#: Nodes of Lobatto in a step, and from values there to coefficients of powers.
NODES = np.array([0.0, 0.5 * (1 - np.sqrt(0.2)), 0.5 * (1 + np.sqrt(0.2)), 1.0])
CUBIC = np.linalg.inv(np.vander(NODES, increasing=True))

#: Iterations in a window, steps in the first one where matrices change, and at most: memory is that of their weights.
ITERATIONS, WINDOW, LARGEST = 16, 64, 1024

#: States (n, m) at the times asked for: coordinates, rates, accelerations.
States = tuple[Array, Array, Array]


class Modes:
    """The reference in modal coordinates.

    Args:
        M, C, K: its matrices, (m, m).
        span: length of the window, s. Undamped modes that turn by less than ε^¼ = 1.2e-4 rad in it, with the round-off
            ε, get the stiffness of that: rates lose four digits in their coordinates.

    Raises:
        ComputationError: M is not positive definite, or a matrix not finite.

    Attributes:
        values: λ, (p,).
        out: X, from modal coordinates to coordinates and rates, (2m, p).
        into: its inverse.
    """

    def __init__(self, M: Array, C: Array, K: Array, span: float):
        m = len(M)
        self.M = M + 1e-14 * np.abs(np.diag(M)).max() * np.eye(m)  # of a mass that is round-off of the projection
        # in undamped modes S, and in units in which rates are as large as coordinates
        try:
            squares, S = scipy.linalg.eigh(0.5 * (K + K.T), 0.5 * (self.M + self.M.T))
        except (np.linalg.LinAlgError, ValueError) as error:
            raise ComputationError("the masses of the reduced model are not positive, or not finite") from error
        epsilon = np.finfo(float).eps
        least = max(np.sqrt(epsilon) * span**-2, epsilon * np.abs(squares).max())
        w = np.sqrt(np.maximum(np.abs(squares), least))
        stiff, damped = (np.linalg.solve(S, np.linalg.solve(self.M, A @ S)) for A in (K, C))
        stiff += np.diag(np.where(np.abs(squares) < least, least - squares, 0.0))
        for part in (1.0, 0.9):  # less damping where eigenvectors are so dependent that half the digits are lost
            A = np.block([[np.zeros((m, m)), np.diag(w)], [-stiff / w, -part * damped]])
            self.values, vectors = np.linalg.eig(A)
            if np.linalg.cond(vectors) < 1e8:
                break
        self.out: Complex = np.vstack([S / w @ vectors[:m], S @ vectors[m:]])
        self.into: Complex = np.asarray(np.linalg.inv(self.out))

    def weights(self, s: Array) -> tuple[Complex, list[Complex]]:
        """Return e^{λs} and s^{d+1} d! φ_{d+1}(λs), d = 0 … 3, at times s (n,) from the start of a step, (n, p)."""
        digits = np.round(s / max(s.max(initial=0.0), 1e-300), 12)  # lengths that are the same but for rounding
        _, one, same = np.unique(digits, return_index=True, return_inverse=True)
        t = s[one, None]
        phi = functions(t * self.values, len(NODES))
        return phi[0][same], [(t ** (d + 1) * factorial(d) * phi[d + 1])[same] for d in range(len(NODES))]


def functions(z: Complex, most: int) -> list[Complex]:
    """Return φ_0 … φ_most at the entries of an array, near zero by 20 terms of the power series: 1/20! is round-off."""
    near = np.abs(z) < 1.0
    safe, small = np.where(near, 1.0, z), np.where(near, z, 0.0)
    out = [np.exp(z)]
    for k in range(most):
        series = sum(small**j / factorial(j + k + 1) for j in range(20))
        out.append(np.where(near, series, (out[k] - 1 / factorial(k)) / safe))
    return out


class Window:
    """The solution over the steps of a window.

    Args:
        equations: that are solved.
        ends: of the steps, s.
        x: coordinates and rates at the start, (2m,).

    Attributes:
        end: coordinates and rates at the end, (2m,).
        converged: whether it was found.
        iterations: how many were needed.
    """

    def __init__(self, equations: Any, ends: Array, x: Array):
        m, h = len(x) // 2, np.diff(ends)
        self.ends, self._powers = ends, h[:, None] ** -np.arange(len(NODES))
        M, C, K = equations.reference(0.5 * float(ends[0] + ends[-1]), x[:m], x[m:])
        self._modes = modes = Modes(M, C, K, float(ends[-1] - ends[0]))
        residual = equations.at(equations.within(ends[:-1], ends[1:], NODES).ravel())
        weights = [modes.weights(share * h) for share in NODES]
        self._g: Array = np.zeros((len(h), len(NODES), m))
        self._z: Complex = np.empty((len(ends), 2 * m), dtype=complex)
        self._z[0] = modes.into @ x
        before: Array = np.full((len(h) * len(NODES), m), np.nan)
        self.converged = False
        for self.iterations in range(1, ITERATIONS + 1):
            c = self._coefficients(slice(None))
            growth, added = weights[-1][0], _sum(weights[-1][1], c)
            for k in range(len(h)):
                self._z[k + 1] = growth[k] * self._z[k] + added[k]
            z = np.stack([e * self._z[:-1] + _sum(by_power, c) for e, by_power in weights], axis=1)
            y, v, a = self._states(z.reshape(-1, 2 * m), self._g.reshape(-1, m))
            if not np.all(np.isfinite(a)):
                break
            if np.abs(y - before).max(initial=0.0) <= 1e-10 * np.abs(y).max(initial=0.0):
                self.converged = True
                break
            before = y
            self._g -= np.linalg.solve(modes.M, residual(y, v, a).T).T.reshape(self._g.shape)
        self.end: Array = (modes.out @ self._z[-1]).real

    def at(self, t: Array, fastest: float = np.inf) -> States:
        """Return coordinates, rates and accelerations (n, m) at times within the window (n,), s (see `Solution.at`)."""
        i = np.clip(np.searchsorted(self.ends, t, side="right") - 1, 0, len(self.ends) - 2)
        s, c, values = t - self.ends[i], self._coefficients(i), self._modes.values
        growth, by_power = self._modes.weights(s)
        z = growth * self._z[i] + _sum(by_power, c)
        powers = s[:, None] ** np.arange(len(NODES))
        fast = np.abs(values) > fastest
        if np.any(fast):
            rates = np.arange(1, len(NODES)) * powers[:, :-1]
            static = -np.einsum("nd,ndp->np", powers, c) / values
            z = np.where(fast, static - np.einsum("nd,ndp->np", rates, c[:, 1:]) / values**2, z)
        g = np.einsum("nd,ndj,njm->nm", powers, CUBIC * self._powers[i][:, :, None], self._g[i])
        return self._states(z, g)

    def _coefficients(self, steps: slice | npt.NDArray[np.int64]) -> Complex:
        """Return the modal coefficients of the powers of time from the starts of steps, (n, 4, p)."""
        m = self._g.shape[2]
        c = np.einsum("dj,njm->ndm", CUBIC, self._g[steps]) * self._powers[steps][:, :, None]
        return np.asarray(c @ self._modes.into[:, m:].T)

    def _states(self, z: Complex, g: Array) -> States:
        """Return coordinates, rates and accelerations (n, m) of modal coordinates (n, p) under g (n, m)."""
        m = g.shape[1]
        x, rates = (z @ self._modes.out.T).real, ((z * self._modes.values) @ self._modes.out[m:].T).real
        return x[:, :m], x[:, m:], rates + g


def _sum(by_power: list[Complex], c: Complex) -> Complex:
    return np.asarray(sum(w * c[:, d] for d, w in enumerate(by_power)))


class Solution:
    """The solution over steps, window by window.

    Args:
        equations: that are solved, with `constant`, `within`, `reference` and `at` as `HeldEquations` has them.
        ends: of the steps, the first the start, s.
        y: coordinates at the start, (m,).
        v: rates there.

    Raises:
        ComputationError: the iteration converges in no window, or to nothing finite.
    """

    def __init__(self, equations: Any, ends: Array, y: Array, v: Array):
        self.ends, self._windows, x = ends, list[Window](), np.concatenate([y, v])
        n = len(ends) - 1 if len(y) else 0
        first, width = 0, LARGEST if equations.constant else WINDOW
        while first < n:
            width = min(width, n - first)
            with np.errstate(over="ignore", invalid="ignore"):  # what is not finite has not converged
                window = Window(equations, ends[first : first + width + 1], x)
            if window.converged:
                self._windows.append(window)
                x, first = window.end, first + width
                width = min(2 * width, LARGEST) if window.iterations <= ITERATIONS // 2 else width
            elif width == 1:
                raise ComputationError("the motion of the reduced model was not found", time=float(ends[first]))
            else:
                width //= 2

    @property
    def steps(self) -> int:
        """Number of steps."""
        return len(self.ends) - 1

    def at(self, t: Array, fastest: float = np.inf) -> States:
        """Return coordinates, rates and accelerations (n, m) at increasing times (n,), s; of a jump those after it.

        Args:
            t: times.
            fastest: vibrations of a higher frequency (rad/s) are put in their quasi-static place
                z = −g/λ − ġ/λ²: samples of their products would not resolve them.
        """
        none: Array = np.zeros((len(t), 0))
        if not self._windows:
            return none, none, none
        number = np.searchsorted([window.ends[0] for window in self._windows[1:]], t, side="right")
        found = [window.at(t[number == k], fastest) for k, window in enumerate(self._windows)]
        y, v, a = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return y, v, a


def cut(times: Array, longest: float) -> Array:
    """Return times with each interval cut into as few equal parts as are no longer than this, s."""
    parts = np.maximum(1, np.ceil(np.diff(times) / longest * (1 - 1e-9))).astype(int)
    pieces = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(times[:-1], times[1:], parts, strict=True)]
    return np.append(np.concatenate(pieces), times[-1])
