"""Modes followed over speed: which mode at one speed is which at the next.

Two neighbouring speeds are joined by the bi-orthogonal correlation of left vectors at one with right vectors at the
other, by an optimal one-to-one assignment. Where it is weak, or where two modes change places, the speed is refined:
a veering then shows itself as two branches that keep their order, a true crossing as two that change it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq, linear_sum_assignment

from rotfem.analysis.modal import ModalAnalysis, Spinning, stability
from rotfem.errors import ComputationError
from rotfem.listeners import Progress
from rotfem.numerics.eigenproblem import SAME
from rotfem.structures.mode_names import Wave


def root(f: Callable[[float], float], ends: tuple[float, float], at_ends: Sequence[float]) -> float | None:
    """Return a number between two where f changes sign; None where f has no value on the way.

    Args:
        f: the function.
        ends: the two numbers.
        at_ends: f there, of different signs. Computed anew, a value near zero may come out with the other sign.
    """
    known, lost = dict(zip(ends, at_ends, strict=True)), []

    def value(x: float) -> float:
        found = known[x] if x in known else f(x)
        lost.extend([] if np.isfinite(found) else [x])
        return found if np.isfinite(found) else 0.0

    found = float(brentq(value, *ends, xtol=1e-12, rtol=1e-10))
    return None if lost else found


Array = npt.NDArray[Any]

#: Correlation (squared) from which a step needs no refinement, and below which it is called ambiguous.
SURE, AMBIGUOUS = 0.9, 0.5


#: Modes computed beyond those asked for, so that a branch that falls in the order is still there.
SPARE = 3


@dataclass
class SpeedPoint:
    """Modes at one speed of a sweep; `order[b]` is the column of branch b, −1 where it was lost.

    Attributes:
        requested: whether the speed was asked for (else it refines a step).
        confidence: squared correlation with the previous point, a branch each.
        conjugate: of which branches it is λ̄ that goes on with what λ was at the first point: ω has passed zero.
    """

    spinning: Spinning
    requested: bool
    order: Array = field(default_factory=lambda: np.empty(0, dtype=int))
    confidence: Array = field(default_factory=lambda: np.empty(0))
    conjugate: Array = field(default_factory=lambda: np.empty(0, dtype=bool))

    @property
    def speed(self) -> float:
        """Ω, rad/s."""
        return self.spinning.speed

    def value(self, branch: int) -> complex:
        """Return λ of a branch, nan where it was lost."""
        column = self.order[branch]
        return complex(self.spinning.pairs.values[column]) if column >= 0 else complex(np.nan, np.nan)

    def signed(self, branch: int) -> float:
        """Return ω of a branch (rad/s), negative from where it has passed zero."""
        return -self.value(branch).imag if self.conjugate[branch] else self.value(branch).imag


def correlation(a: Spinning, b: Spinning, conjugate: bool = False) -> tuple[Array, Array]:
    """Return the squared correlations of the modes at two speeds, shape (m_a, m_b): 1 for equal modes, 0 for different.

    With `conjugate` they are those of the modes at a with the modes of λ̄ at b: real matrices have both.

    That of two modes is |y_i^H [(λ_i + μ_j) M + C] x_j|², scaled. Both pencils serve in turn and the mean is taken, so
    the two speeds are treated alike. The second array is this. In the first, modes with one frequency are not
    distinguished, for any combination of them is a mode too: what counts is how much of the other is in their span,
    the trace of the product of both projections by the smaller dimension.
    """
    ya, yb, xa, xb = a.pairs.left, b.pairs.left, a.pairs.right, b.pairs.right
    la, lb = a.nonzero, b.nonzero
    if conjugate:
        yb, xb, lb = yb.conj(), xb.conj(), lb.conj()
    here, there = a.pencil.gram(ya, la, xb, lb), b.pencil.gram(yb, lb, xa, la)
    own_a, own_b = a.own, b.own.conj() if conjugate else b.own
    # The two products cancel the unknown scaling of x_b and y_b against each other.
    scale = np.outer(*(np.maximum(np.abs(np.diag(own)), 1e-300) for own in (own_a, own_b)))
    single = np.abs(here) * np.abs(there.T) / scale
    joint = single.copy()
    groups_a, groups_b = repeated(la, a.pairs.bounds), repeated(lb, b.pairs.bounds)
    if len(groups_a) == len(la) and len(groups_b) == len(lb):
        return joint, single
    for i in groups_a:
        for j in groups_b:
            if len(i) > 1 or len(j) > 1:
                part_a, part_b = np.linalg.pinv(own_a[np.ix_(i, i)]), np.linalg.pinv(own_b[np.ix_(j, j)])
                product = part_a @ here[np.ix_(i, j)] @ part_b @ there[np.ix_(j, i)]
                joint[np.ix_(i, j)] = abs(np.trace(product)) / min(len(i), len(j))
    return joint, single


def repeated(values: Array, bounds: Array) -> list[list[int]]:
    """Return the indices of eigenvalues (sorted by size) in groups of those that are one.

    Args:
        values: the eigenvalues, 1/s.
        bounds: their relative error bounds; what is no farther apart than these, or SAME, is one.
    """
    sizes = np.abs(values)
    off = bounds * sizes
    one = np.abs(values[1:] - values[:-1]) <= np.maximum(SAME * sizes[1:], off[1:] + off[:-1])
    out = [[0]] if len(values) else []
    for i, same in enumerate(one.tolist(), start=1):
        out[-1].append(i) if same else out.append([i])
    return out


def assign(point: SpeedPoint, following: SpeedPoint) -> float:
    """Join the branches of a point with the columns of the following one; return the least squared correlation.

    A branch whose best partner is a stranger has the order −1 from there on.
    """
    known = np.flatnonzero(point.order >= 0)

    def likeness(conjugate: bool) -> list[Array]:
        return [
            np.clip(x[point.order[known]], 0.0, 1.0) for x in correlation(point.spinning, following.spinning, conjugate)
        ]

    c, single = likeness(False)
    a, b = point.spinning.pairs.values[point.order[known]], following.spinning.pairs.values
    # |dω/dΩ| in the rotor of a mode whose ω passes zero is at most 3: 1 of the frame, and at most 2 of gyroscopic
    # moments, as the polar moment of inertia of a body is at most twice its diametral one.
    may_pass = a.imag[:, None] + b.imag[None, :] <= 3.0 * abs(following.speed - point.speed)
    passed = np.zeros_like(may_pass)
    if np.any(may_pass):
        c_bar, single_bar = likeness(True)
        passed = may_pass & (c_bar > c)
        c, single = np.where(passed, c_bar, c), np.where(passed, single_bar, single)
    rows, columns = linear_sum_assignment(-c - 1e-3 * single)
    following.order = np.full(len(point.order), -1)
    following.confidence = np.zeros(len(point.order))
    following.conjugate = point.conjugate.copy()
    following.conjugate[known[rows]] ^= passed[rows, columns]
    following.confidence[known[rows]] = c[rows, columns]
    kin = c[rows, columns] >= 0.02  # else they have nothing in common, and the branch is lost
    following.order[known[rows[kin]]] = columns[kin]
    return float(np.min(c[rows, columns], initial=1.0))


def swapped(a: SpeedPoint, b: SpeedPoint, count: int) -> bool:
    """Return whether one of the first branches changes its order by frequency with another between two points."""
    both = np.flatnonzero((a.order >= 0) & (b.order >= 0))
    wa, wb = (n.spinning.pairs.values[n.order[both]].imag for n in (a, b))
    da, db = wa[:, None] - wa[None, :], wb[:, None] - wb[None, :]
    level = SAME * max(float(np.max(np.abs(wa), initial=0.0)), float(np.max(np.abs(wb), initial=0.0)))
    asked = both < count
    return bool(np.any((da > level) & (db < -level) & (asked[:, None] | asked[None, :])))


class Sweep:
    """A Campbell diagram in the making.

    Args:
        analysis: compiled scene.
        count: number of branches.

    Attributes:
        known: speed ↦ modes there that are solved already.
        each: (items, work) ↦ what the work makes of every item; processes may share them out.
    """

    def __init__(self, analysis: ModalAnalysis, count: int):
        self.analysis, self.count = analysis, count
        self.known: dict[float, Spinning] = {}
        self.each: Callable[[Sequence[Any], Callable[[Any], Any]], list[Any]] = lambda items, work: [*map(work, items)]
        self.points: list[SpeedPoint] = []
        self.solves, self.most_solves, self.unresolved = 0, 0, False
        self.ambiguous: list[dict[str, float]] = []

    def solve(self, speed: float, start: Spinning | None, requested: bool) -> SpeedPoint:
        """Return the modes at a speed, its equilibrium continued from start."""
        self.solves += 1
        known = self.known.pop(speed, None)
        return SpeedPoint(known or self.analysis.at(speed, self.count + SPARE, start), requested)

    def run(self, speeds: Sequence[float], progress: Progress) -> None:
        """Follow the modes over increasing speeds."""
        first = self.solve(speeds[0], None, True)
        total = len(first.spinning.pairs.values)
        first.order, first.confidence = np.arange(total), np.ones(total)
        first.conjugate = np.zeros(total, dtype=bool)
        self.points = [first]
        self.finest = 1e-5 * max(speeds[-1] - speeds[0], 1e-300)  # a narrower veering passes as a crossing
        self.most_solves = 1000 + 41 * len(speeds)  # a veering takes 17
        for i, speed in enumerate(speeds[1:], start=1):
            if speeds[i - 1] < 0.0 < speed:  # where the lines ω = k|Ω| have a kink
                self._advance(self.solve(0.0, self.points[-1].spinning, False))
            self._advance(self.solve(speed, self.points[-1].spinning, True))
            progress(i / (len(speeds) - 1))

    def _advance(self, target: SpeedPoint) -> None:
        """Append a point, and points before it as long as the step is not sure."""
        last = self.points[-1]
        confidence = assign(last, target)
        near = self._may_meet(last, target)
        if (confidence < SURE and near) or swapped(last, target, self.count):
            self.unresolved |= self.solves >= self.most_solves
            if target.speed - last.speed > 2 * self.finest and not self.unresolved:
                middle = 0.5 * (last.speed + target.speed)
                self._advance(self.solve(middle, last.spinning, False))
                self._advance(target)
                return
            weak = [b for b in range(self.count) if last.order[b] >= 0 and target.confidence[b] < AMBIGUOUS]
            self.ambiguous += [
                {"branch": b + 1, "speed": target.speed, "confidence": float(target.confidence[b])} for b in weak
            ]
        self.points.append(target)

    def _may_meet(self, last: SpeedPoint, target: SpeedPoint) -> bool:
        """Return whether a branch that is asked for (not only a spare one) is unsure."""
        return bool(np.any(target.confidence[: self.count][last.order[: self.count] >= 0] < SURE))

    # --- what the diagram says ----------------------------------------------------------------------------------------

    def between(self, left: SpeedPoint, speed: float) -> SpeedPoint:
        """Return the modes at a speed to the right of a point, joined with its branches."""
        point = self.solve(speed, left.spinning, False)
        assign(left, point)
        return point

    def wave(self, point: SpeedPoint, branch: int) -> Wave | None:
        """Return how the mode of a branch precesses at a point; None where it is lost or no rotor's."""
        waves = self.analysis.described(point.spinning).waves
        return waves[point.order[branch]] if waves and point.order[branch] >= 0 else None

    def direction(self, point: SpeedPoint, branch: int) -> str:
        """Return "forward" or "backward", how a branch whirls at a point; "" where it stands or is no rotor's."""
        wave = self.wave(point, branch)
        return "" if wave is None else wave.direction(point.value(branch).imag, abs(point.speed))

    def critical_speeds(self, orders: Collection[int]) -> list[dict[str, Any]]:
        """Return the critical speeds of the branches: the synchronous ones of a rotor first, each kind by speed.

        - "forward": the frequency in the rotor is zero, so that an unbalance, which rests in it, has no stiffness
          against it. Order 1.
        - "backward", order 1: a shaft whirls against the spin at the frequency Ω in the fixed frame, 2Ω in the rotor.
          Order m: a disk's wave of m diameters against the spin stands still in the fixed frame, mΩ in the disk.
        - "per_rev": the frequency in the rotor is kΩ, order k of those given.

        Modes in the fixed frame are synchronous where their frequency is Ω, and per_rev where it is kΩ.
        """
        wanted, out = list[tuple[int, int, int | None]](), []
        for i, (left, right) in enumerate(pairwise(self.points)):
            for b in range(self.count):
                wave = self.wave(right, b)
                against = 0 if wave is None else wave.at_rest
                lines = (None, *sorted({*orders, against} - {0}))
                wanted += [(i, b, k) for k in lines if self._between(left, right, b, k)]
        for (i, b, k), (speed, solves) in zip(wanted, self.each(wanted, self._meeting), strict=True):
            self.solves += solves
            if speed is None:
                continue
            left, right = self.points[i : i + 2]
            wave = self.wave(left if k is None else right, b)
            way = self.direction(right, b)
            if k is None:
                if wave is not None and not wave.fixed:
                    out.append(self._critical(b, "forward", 1, 0, speed))
            elif wave is not None and k == wave.at_rest and (way == "backward" or (wave.fixed and way)):
                out.append(self._critical(b, way, wave.number, k, speed))
            elif k in orders:
                out.append(self._critical(b, "per_rev", k, k, speed))
        return sorted(out, key=lambda c: (c["kind"] == "per_rev", c["speed"]))

    def _critical(self, branch: int, kind: str, order: int, k: int, speed: float) -> dict[str, Any]:
        frequency = k * abs(speed)
        named = {"kind": kind, "order": order, "per_rev": k}
        return {"speed": speed, **named, "branch": branch + 1, "frequency": frequency}

    @staticmethod
    def _gap(point: SpeedPoint, b: int, k: int | None) -> float:
        """Return how far a branch is above the line kΩ at a point, or without k above zero, rad/s."""
        zero = point.order[b] >= 0 and point.spinning.pairs.bounds[point.order[b]] >= 1.0
        omega = 0.0 if zero else point.signed(b)
        return omega if k is None else abs(omega) - k * abs(point.speed)

    def _between(self, left: SpeedPoint, right: SpeedPoint, b: int, k: int | None) -> bool:
        """Return whether a branch has the frequency kΩ, or passes zero without k, between two points.

        What has no frequency at rest is on all lines there.
        """
        one, other = (self._gap(point, b, k) for point in (left, right))
        return one * other < 0.0 or (abs(one) > 0.0 and other == 0.0 and right.speed != 0.0)

    def _meeting(self, place: tuple[int, int, int | None]) -> tuple[float | None, int]:
        """Return the speed after the point i where a branch b has the frequency kΩ, or None, and solutions it took."""
        i, b, k = place
        left, right = self.points[i : i + 2]
        before, self.solves = self.solves, 0
        met = list[bool]()  # whether the frequency is on the line to its error bound; twice, then round-off is followed

        def f(speed: float) -> float:
            try:
                point = self.between(left, speed)
            except ComputationError:
                if k is None:
                    return 0.0  # K is singular: this is the speed
                raise
            gap, pairs, j = self._gap(point, b, k), point.spinning.pairs, point.order[b]
            met.append(k is not None and abs(gap) <= pairs.bounds[j] * abs(pairs.values[j]))
            return 0.0 if sum(met) == 2 else gap

        ends = [self._gap(point, b, k) for point in (left, right)]
        speed = right.speed if ends[1] == 0.0 else root(f, (left.speed, right.speed), ends)
        taken, self.solves = self.solves, before
        return speed, taken

    def onsets(self) -> list[dict[str, Any]]:
        """Return the ranges in which a mode is unstable, and how: `speed` where each begins, `kind`, and `until`.

        A range that the sweep begins with has the first speed; `until` is None where none of the speeds ends it. One in
        which no growth is above the error bound of its mode is none.
        """
        sure = [point.speed for point in self.points if unstable(point.spinning) is not None]
        if not sure:
            return []
        kinds = [unstable(point.spinning, bounded=False) for point in self.points]
        out: list[dict[str, Any]] = []
        if kinds[0] is not None:
            out.append({"speed": self.points[0].speed, "kind": kinds[0], "until": None})
        for i, (before, after) in enumerate(pairwise(kinds)):
            if before == after:
                continue
            speed = self._bisect(self.points[i], self.points[i + 1], before, after)
            if speed is None:
                continue
            if before is not None and out:
                out[-1]["until"] = speed
            if after is not None:
                out.append({"speed": speed, "kind": after, "until": None})
        ends = [np.inf if r["until"] is None else r["until"] for r in out]
        return [r for r, end in zip(out, ends, strict=True) if any(r["speed"] <= s <= end for s in sure)]

    def _bisect(self, left: SpeedPoint, right: SpeedPoint, before: str | None, after: str | None) -> float | None:
        """Return the lowest speed that is no longer of the kind before; None where growth ends as its mode is lost."""
        low, high = left.spinning, right.speed
        while high - low.speed > 1e-9 * max(abs(high), abs(low.speed)):
            speed = 0.5 * (low.speed + high)
            try:
                middle = self.solve(speed, low, False).spinning
            except ComputationError:  # K is singular: this is the speed
                return speed
            low, high = (middle, high) if unstable(middle, bounded=False) == before else (low, speed)
        worst = max(low.pairs.values, key=lambda lam: lam.real)
        return None if after is None and worst.real > 1e-2 * abs(worst) else high


def unstable(spinning: Spinning, bounded: bool = True) -> str | None:
    """Return the kind of instability of the worst mode at a speed, None if all are stable.

    Args:
        spinning: modes at one speed.
        bounded: whether growth within the error bound of its mode is none; a search for a speed takes it as it is.
    """
    values, bounds = spinning.pairs.values, spinning.pairs.bounds if bounded else np.zeros(len(spinning.pairs.values))
    kinds = [stability(complex(lam), float(bound)) for lam, bound in zip(values, bounds, strict=True)]
    growing = [j for j, kind in enumerate(kinds) if kind.endswith("instability")]
    return kinds[max(growing, key=lambda j: values[j].real)] if growing else None
