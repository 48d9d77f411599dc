"""The path of equilibria F(q, s) = 0 as speed and loads grow, past limit points where that is wanted.

Loads, gravity, base acceleration and Ω² are linear in s, so F is, too. The unknown is (q, s), and a step of length
l along the unit tangent t is corrected in the plane across it (Riks 1979; Keller's pseudo-arclength),

    [ K   F_s ] [dq]     [ F                          ]
    [ t_q t_s ] [ds] = − [ t·((q, s) − (q_0, s_0)) − l ],

by block elimination with one factor of K. A step is taken back where the tangent turns too far, or where K changes the
number of its negative eigenvalues though s has not turned: Newton was then on its way to another branch. What remains
of that at the shortest steps is a branch point on the path itself.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from rotfem.analysis.load_steps import LoadFactors, balance, check_inside_out, recounted
from rotfem.errors import ComputationError
from rotfem.numerics.linear import DirectSolver, negative_count
from rotfem.numerics.newton import Newton

Array = npt.NDArray[np.float64]

#: Shortest step, in units of s and of the root mean square of q in its scales.
SHORTEST = 1e-6

#: Steps before the path is given up, and iterations of a step.
MOST_STEPS, ITERATIONS = 500, 8


@dataclass
class Point:
    """One equilibrium of the path.

    Attributes:
        q: local dof array.
        s: share of speed squared and loads.
        t_q, t_s: unit tangent.
        negative: number of eigenvalues of K that are negative beyond round-off; None where they are not counted.
    """

    q: Array
    s: float
    t_q: Array
    t_s: float
    negative: int | None


@dataclass
class LoadPath:
    """Where the path of equilibria led.

    Attributes:
        q: the equilibrium at the full load; the last one where that was not reached.
        share: of the load there.
        limits: shares at which the load has a maximum or minimum on the path, in their order.
        branches: shares at which another path crosses.
        why: why the full load was not reached; empty if it was.
    """

    q: Array
    share: float = 0.0
    limits: list[float] = field(default_factory=list)
    branches: list[float] = field(default_factory=list)
    why: str = ""


class Tracer:
    """Follows the path of a system at a speed.

    Args:
        system: equations of motion, the hub held.
        growth: what grows with s.
        newton: tolerance of the corrections; their count is added to.
    """

    def __init__(self, system: Any, growth: LoadFactors, newton: Newton):
        self.system, self.growth, self.newton = system, growth, newton
        self._count = system.V.dofmap.index_map.size_global * system.V.dofmap.index_map_bs

    def follow(self, past_limits: bool) -> LoadPath:
        """Return where the path leads from its start.

        Args:
            past_limits: whether to go on where the load has a maximum.
        """
        q = self.growth.begin(self.system)
        path, point, length = LoadPath(q), self._point(q, 0.0, None), 0.05
        for _ in range(MOST_STEPS):
            try:
                new, used = self._step(point, length)
            except ComputationError as error:
                if length <= SHORTEST:
                    path.why = error.what
                    break
                length = max(length / 4, SHORTEST)
                continue
            turned = new.t_s * point.t_s < 0.0
            crossed = new.negative != point.negative and not turned
            cosine = self._product(new.t_q, point.t_q) + new.t_s * point.t_s
            if length > SHORTEST and (crossed or cosine < 0.9):
                length = max(length / 4, SHORTEST)
                continue
            if turned:
                path.limits.append(self._limit(point, length))
                if not past_limits:
                    path.why = "limit point"
                    break
            elif crossed:
                path.branches.append((point.s + new.s) / 2)
            if new.s >= 1.0:
                path.q, path.share = self._end(point, new), 1.0
                return path
            if new.s < 0.0:
                path.why = "the load would have to be reversed"
                break
            point, length = self._counted(new), min(length * min(2.0, 4.0 / used), 0.25)
            path.q, path.share = point.q, point.s
        else:
            path.why = f"{MOST_STEPS} steps were not enough"
        path.q, path.share = point.q, point.s
        return path

    # --- one step ----------------------------------------------------------------------------------------------------

    def _step(self, point: Point, length: float) -> tuple[Point, int]:
        """Return the point at a distance along the path, and the iterations that it took."""
        q, s = point.q + length * point.t_q, point.s + length * point.t_s
        for iteration in range(1, ITERATIONS + 1):
            y, z = self._solutions(q, s)
            ahead = self._product(point.t_q, q - point.q) + point.t_s * (s - point.s) - length
            ds = -(ahead + self._product(point.t_q, y)) / (point.t_s + self._product(point.t_q, z))
            dq = y + ds * z
            q, s = q + dq, s + ds
            self.newton.iterations += 1
            size = max(self.system.size(dq), abs(ds))
            if not np.isfinite(size) or size > 10.0:
                raise ComputationError("the corrections of a step along the path diverged")
            if size <= self.newton.tolerance:
                self._set(q, s)
                check_inside_out(self.system)
                self.system.structure.check_range(q)
                self.system.check_reach(q)
                return self._point(q, s, point), iteration
        raise ComputationError(f"a step along the path did not converge in {ITERATIONS} iterations")

    def _counted(self, point: Point) -> Point:
        """Return a point with rotations that are counted from its own shape, where they are large."""
        turns = self.system.structure.turns
        if turns is None or not turns.is_due(point.q):
            return point
        q, t_q = recounted(self.system, point.q, point.t_q)
        size = np.sqrt(self._product(t_q, t_q) + point.t_s**2)
        return Point(q, point.s, t_q / size, point.t_s / size, point.negative)

    def _set(self, q: Array, s: float) -> None:
        self.growth.set(self.system, s)
        self.system.set_state(q)

    def _solutions(self, q: Array, s: float) -> tuple[Array, Array]:
        """Return −K⁻¹ F and −K⁻¹ F_s; F is linear in s, so a difference over any distance is exact."""
        self._set(q, s + 1.0)
        slope = self.system.residual().copy()
        self._set(q, s)
        residual = self.system.residual()
        slope.axpy(-1.0, residual)
        solver = DirectSolver(self.system.tangent(1.0, 0.0, 0.0)[0])
        return self.system.local(solver.solve(residual)), self.system.local(solver.solve(slope))

    def _point(self, q: Array, s: float, before: Point | None) -> Point:
        """Return an equilibrium with the tangent of the path there, in the direction from the one before."""
        z = self._solutions(q, s)[1]
        with np.errstate(all="ignore"):
            size = np.sqrt(self._product(z, z) + 1.0)
        if not np.isfinite(size):
            raise ComputationError("the slope of the path is beyond all numbers")
        t_q, t_s = z / size, 1.0 / size
        if before is not None and self._product(t_q, before.t_q) + t_s * before.t_s < 0.0:
            t_q, t_s = -t_q, -t_s
        K = self.system.matrix(1.0, 0.0, 0.0, 1.0)
        return Point(q, s, t_q, t_s, negative_count(K, sure=True))

    def _product(self, a: Array, b: Array) -> float:
        """Return the mean of the products of two arrays in the scales of the unknowns, over all ranks."""
        return float(self.system.product(a, b) / self._count)

    # --- special points ----------------------------------------------------------------------------------------------

    def _limit(self, point: Point, length: float) -> float:
        """Return the load where the tangent of the path has none in s, between a point and one at a distance.

        ds/dl = t_s has a simple zero there, so that the load itself is accurate to the square.
        """
        slopes = {0.0: point.t_s}

        def slope(distance: float) -> float:
            return slopes[distance] if distance in slopes else self._step(point, distance)[0].t_s

        return self._step(point, float(brentq(slope, 0.0, length, xtol=1e-5 * length)))[0].s

    def _end(self, before: Point, after: Point) -> Array:
        """Return q at the full load, between two points of the path."""
        part = (1.0 - before.s) / (after.s - before.s)
        q = before.q + part * (after.q - before.q)
        return balance(self.system, self.growth, 1.0, q, self.newton, checked=False)
