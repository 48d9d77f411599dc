"""A Campbell diagram: modes at the speeds asked for, followed from each to the next, and what they meet on the way.

1. The modes are solved at the speeds asked for.
2. Two neighbouring speeds are joined by the bi-orthogonal correlation of left vectors at one with right vectors at the
   other, by an optimal one-to-one assignment.
3. Where it is weak, or where two modes change places, the branches are followed through a model of the pencil between
   both (see `rotfem.analysis.reduced_basis`), in steps as small as it takes. A veering then shows itself as two
   branches that keep their order, a true crossing as two that change it.
4. A speed is inserted where that leaves a branch ambiguous, or where the model is unstable in another way than both.
5. A branch meets kΩ where it does so in the model. The modes are solved there, and the slope of the model gives the
   next place. Where an instability begins and ends is found likewise, by halving.

Where the model is that of a basis over the whole range, it is exact, and nothing more is solved in 4 and 5.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise, product
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.linalg import norm
from scipy.linalg import eigh
from scipy.optimize import brentq, linear_sum_assignment

from rotfem.analysis.modal import ModalAnalysis, Spinning, correlation, stability
from rotfem.analysis.reduced_basis import SpeedModel, between, with_errors
from rotfem.errors import ComputationError
from rotfem.listeners import Progress
from rotfem.numerics.eigenproblem import EQUAL_EIGENVALUES, repeated
from rotfem.numerics.projection import sparse_part
from rotfem.structures.mode_names import Wave, ordinal_ending

Array = npt.NDArray[Any]

#: Correlation (squared) from which a step needs no refinement, and below which it is called ambiguous.
SURE, AMBIGUOUS = 0.9, 0.5

#: Least step of the model between two speeds, in parts of their distance (a narrower veering passes as a crossing), and
#: most of its steps: a veering takes 34.
FINEST, MOST_STEPS = 1e-5, 200

#: Relative error of zeros of a model; in parts of the distance of two speeds, the last step of Newton's method, whose
#: error is about the square, 1e-7, and that of differences in it. Solutions for a zero, usually one.
ZEROS, LAST, NEAR, SOLUTIONS = 1e-11, 3e-4, 1e-4, 5

#: Least distance of a node of a model from others, in parts of that of two speeds: round-off of the matrices is
#: multiplied by about its reciprocal.
NODES_APART = 1e-4

#: Relative difference of matrices that are one, and unknowns of which all synchronous whirls are solved together.
SAME, MOST_DENSE = 1e-9, 2000

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


def assign(point: SpeedPoint, following: SpeedPoint) -> None:
    """Join the branches of a point with the columns of the following one.

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


def swapped(a: SpeedPoint, b: SpeedPoint, count: int) -> bool:
    """Return whether one of the first branches changes its order by frequency with another between two points."""
    both = np.flatnonzero((a.order >= 0) & (b.order >= 0))
    wa, wb = (n.spinning.pairs.values[n.order[both]].imag for n in (a, b))
    da, db = wa[:, None] - wa[None, :], wb[:, None] - wb[None, :]
    level = EQUAL_EIGENVALUES * max(float(np.max(np.abs(wa), initial=0.0)), float(np.max(np.abs(wb), initial=0.0)))
    asked = both < count
    return bool(np.any((da > level) & (db < -level) & (asked[:, None] | asked[None, :])))


class BranchPath:
    """Branches on the way from one solved speed to another, whose `order` is set.

    Args:
        left: the first speed, its branches known.
        right: the other one.
        model: makes the model of some solved modes, by speed; called only where it is needed.
        count: number of branches that matter.

    Attributes:
        points: both, and those of the model between which a step is sure, or cannot be smaller.
        weak: branch ↦ squared correlation, of those that are ambiguous.
        hidden: a speed between, where a mode is unstable in another way than at both ends; None without.
    """

    def __init__(
        self, left: SpeedPoint, right: SpeedPoint, model: Callable[[Sequence[Spinning]], SpeedModel], count: int
    ):
        self.left, self.right, self.count, self._make = left, right, count, model
        self._solved = [left.spinning, right.spinning]
        self.points = [left, right]
        self.weak = dict[int, float]()
        self.hidden: float | None = None
        assign(left, right)
        if self._unsure(left, right):
            self._follow()

    @cached_property
    def model(self) -> SpeedModel:
        """Model of the modes between the two speeds."""
        return self._make(self._solved)

    def take(self, spinning: Spinning) -> SpeedPoint:
        """Make modes that are solved between the two speeds a node of the model, and return them joined."""
        first, *inner, last = self._solved

        def apart(s: Spinning) -> bool:
            return abs(s.speed - spinning.speed) > NODES_APART * (last.speed - first.speed)

        if apart(first) and apart(last):
            inner = sorted([spinning, *filter(apart, inner)], key=lambda s: s.speed)
            self._solved = [first, *inner, last]
            self.model = self._make(self._solved)
        return self.joined(spinning)

    def inside(self, point: SpeedPoint) -> SpeedPoint:
        """Return a point as the model has it."""
        return replace(point, spinning=self.model.inside(point.spinning))

    def _unsure(self, a: SpeedPoint, b: SpeedPoint) -> bool:
        weak = b.confidence[: self.count][a.order[: self.count] >= 0] < SURE
        return bool(np.any(weak)) or swapped(a, b, self.count)

    def _follow(self) -> None:
        """Follow the branches through the model, halving each step that is not sure."""
        last, left, distance = self.inside(self.right), MOST_STEPS, self.right.speed - self.left.speed
        points, targets = [self.inside(self.left)], [SpeedPoint(self.model.modes(self.right.speed), False)]
        while targets:
            before, target = points[-1], targets[-1]
            assign(before, target)
            if self._unsure(before, target):
                if left and target.speed - before.speed > 2 * FINEST * distance:
                    left -= 1
                    targets.append(SpeedPoint(self.model.modes(0.5 * (before.speed + target.speed)), False))
                    continue
                for b in range(self.count):
                    if before.order[b] >= 0 and target.confidence[b] < AMBIGUOUS:
                        self.weak[b] = min(self.weak.get(b, 1.0), float(target.confidence[b]))
            points.append(targets.pop())
        least = np.min([p.confidence for p in points[1:]], axis=0)
        assign(points[-1], last)  # the same modes, of which the model has more
        self.right.order, self.right.conjugate = last.order, last.conjugate
        self.right.confidence = np.where(last.order < 0, 0.0, least)
        self.points = [self.left, *points[1:-1], self.right]
        count = len(self.left.spinning.pairs.values)
        known = {None, unstable(self.left.spinning), unstable(self.right.spinning)}
        hidden = [p.spinning for p in points[1:-1] if unstable(p.spinning.first(count)) not in known]
        if hidden:
            self.hidden = max(hidden, key=lambda s: float(np.max(s.pairs.values.real))).speed

    def joined(self, spinning: Spinning) -> SpeedPoint:
        """Return modes between the two speeds, joined with the branches."""
        before = [self.left, *(p for p in self.points[1:-1] if p.speed <= spinning.speed)][-1]
        point = SpeedPoint(self.model.inside(spinning), False)
        assign(self.inside(before), point)
        return point

    def zero(self, f: Callable[[SpeedPoint], float], low: SpeedPoint, high: SpeedPoint) -> float | None:
        """Return the speed between two points where a function of a point changes its sign.

        Where it jumps, as from one mode to another that round-off confuses, there is none.
        """
        known = {low.speed: f(low), high.speed: f(high)}

        def g(x: float) -> float:
            return known[x] if x in known else f(self.joined(self.model.modes(x)))

        speed = float(brentq(g, *known, xtol=ZEROS * (high.speed - low.speed), rtol=ZEROS))
        return speed if abs(g(speed)) < 1e-2 * min(map(abs, known.values())) + 1e-6 * abs(speed) else None


class Sweep:
    """A Campbell diagram in the making.

    Args:
        analysis: compiled scene.
        count: number of branches.
        only: whether no other speeds may be solved than those asked for.
        model: that of the whole range, if there is one.

    Attributes:
        known: speed ↦ modes there that are solved already.
        paths: between each two points.
        solves, inserted: speeds solved, and those that are points though they were not asked for.
    """

    def __init__(self, analysis: ModalAnalysis, count: int, only: bool = False, model: SpeedModel | None = None):
        self.analysis, self.count, self.only, self.model = analysis, count, only, model
        self.known: dict[float, Spinning] = {}
        self.points, self.paths = list[SpeedPoint](), list[BranchPath]()
        self.solves = self.inserted = 0
        self.ambiguous: list[dict[str, float]] = []

    @property
    def final(self) -> bool:
        """Whether zeros of the model are not to be improved by solutions."""
        return self.only or self.model is not None

    def solve(self, speed: float, start: Spinning | None, requested: bool) -> SpeedPoint:
        """Return the modes at a speed, its equilibrium continued from start."""
        found, count = self.known.pop(speed, None), self.count + SPARE
        self.solves += found is None
        if found is None and self.model is not None:
            found = with_errors(self.model.modes(speed, count).first(count))
        found = found or self.analysis.at(speed, count, start)
        return SpeedPoint((found if self.model is None else self.model.inside(found)).first(count), requested)

    def run(self, speeds: Sequence[float], progress: Progress) -> None:
        """Follow the modes over increasing speeds.

        At most as many speeds are inserted as were asked for, and four.
        """
        first = self.solve(speeds[0], None, True)
        total = len(first.spinning.pairs.values)
        first.order, first.confidence = np.arange(total), np.ones(total)
        first.conjugate = np.zeros(total, dtype=bool)
        self.points, self._room = [first], 0 if self.only else len(speeds) + 4
        for i, speed in enumerate(speeds[1:], start=1):
            if speeds[i - 1] < 0.0 < speed and self._room:  # where the lines ω = k|Ω| have a kink
                self._insert(0.0)
            self._advance(self.solve(speed, self.points[-1].spinning, True))
            progress(i / (len(speeds) - 1))

    def _insert(self, speed: float) -> None:
        self._room, self.inserted = self._room - 1, self.inserted + 1
        self._advance(self.solve(speed, self.points[-1].spinning, False))

    def _advance(self, target: SpeedPoint) -> None:
        """Append a point, and one before it where the model between cannot tell the branches."""
        last = self.points[-1]
        path = BranchPath(last, target, self._model, self.count)
        wave = self.wave(target, 0)
        if path.hidden is None and wave is not None and wave.shaft and not wave.fixed:
            # A shaft that differs by direction is unstable between two speeds at which K is singular.
            ends = path.model.singular(last.speed, target.speed)
            path.hidden = float(np.mean(ends[:2])) if len(ends) == 2 else None
        if self._room and (path.hidden is not None or path.weak):
            self._insert(path.hidden or 0.5 * (last.speed + target.speed))
            self._advance(target)
            return
        self.ambiguous += [
            {"branch": b + 1, "speed": target.speed, "confidence": value} for b, value in sorted(path.weak.items())
        ]
        self.points.append(target)
        self.paths.append(path)

    def _model(self, solved: Sequence[Spinning]) -> SpeedModel:
        """Return the model between some speeds, which knows the points next to them, too."""
        if self.model is not None:
            return self.model
        points, low, high = [p.spinning for p in self.points], solved[0].speed, solved[-1].speed
        return between(solved, [s for s in points if s.speed < low][-1:] + [s for s in points if s.speed > high][:1])

    # --- what the diagram says ----------------------------------------------------------------------------------------

    def wave(self, point: SpeedPoint, branch: int) -> Wave | None:
        """Return how the mode of a branch precesses at a point; None where it is lost or no rotor's."""
        waves = point.spinning.waves
        return waves[point.order[branch]] if waves and point.order[branch] >= 0 else None

    def direction(self, point: SpeedPoint, branch: int) -> str:
        """Return "forward" or "backward", how a branch whirls at a point; "" where it stands or is no rotor's."""
        wave = self.wave(point, branch)
        return "" if wave is None else wave.direction(point.value(branch).imag, abs(point.speed))

    def critical_speeds(self, orders: Collection[int], ranges: Sequence[dict[str, Any]] = ()) -> list[dict[str, Any]]:
        """Return the critical speeds of the branches: the synchronous ones of a rotor first, each kind by speed.

        - "forward": the frequency in the rotor is zero, so that an unbalance, which rests in it, has no stiffness
          against it. Order 1. Of a shaft that differs by direction both ends of a range of static instability.
        - "backward", order 1: a shaft whirls against the spin at the frequency Ω in the fixed frame, 2Ω in the rotor.
          Order m: a disk's wave of m diameters against the spin stands still in the fixed frame, mΩ in the disk.
        - "per_rev": the frequency in the rotor is kΩ, order k of those given.

        Modes in the fixed frame are synchronous where their frequency is Ω, and per_rev where it is kΩ.

        Args:
            orders: k.
            ranges: of instability (see `onsets`).
        """
        static = [(r["speed"], r["until"] or np.inf) for r in ranges if r["kind"] == "static instability"]
        speeds = [point.speed for point in self.points]
        own = synchronous(self.analysis, max(-speeds[0], speeds[-1]), self.count)
        out: list[dict[str, Any]] = []

        def add(branch: int, kind: str, order: int, k: int, speed: float, **more: str) -> None:
            named = {"speed": speed, "kind": kind, "order": order, "per_rev": k}
            out.append(named | {"branch": branch + 1, "frequency": k * abs(speed), **more})

        for speed, way, n in own or ():
            for signed in (x for x in (-speed, speed) if speeds[0] <= x <= speeds[-1]):
                add(-1, way, 1, 1, signed, label=f"{n}{ordinal_ending(n)} {way} whirl")
        for i, b in product(range(len(self.paths)), range(self.count)):
            left, right = self.points[i : i + 2]
            before, wave, way = self.wave(left, b), self.wave(right, b), self.direction(right, b)
            if before is not None and not before.fixed:
                for speed in self._meetings(i, b, None):
                    within = [ends for ends in static if ends[0] <= speed <= ends[1]]
                    for end in filter(np.isfinite, within[0] if within else [speed]):
                        add(b, "forward", 1, 0, end)
            at_rest = 0 if wave is None else wave.at_rest
            known = {1} if own is not None and wave is not None and wave.number else set[int]()
            for k in sorted({*orders, at_rest} - {0} - known):
                for speed in self._meetings(i, b, k):
                    if wave is not None and k == at_rest and (way == "backward" or (wave.fixed and wave.number)):
                        add(b, way or ("forward" if wave.share > 0.0 else "backward"), wave.number, k, speed)
                    elif k in orders:
                        add(b, "per_rev", k, k, speed)
        return sorted(out, key=lambda c: (c["kind"] == "per_rev", c["speed"]))

    def _meetings(self, i: int, b: int, k: int | None) -> list[float]:
        """Return the speeds after the point i where a branch b has the frequency kΩ, or without k passes zero.

        What has no frequency at rest is on all lines there.
        """
        path = self.paths[i]

        def gap(point: SpeedPoint) -> float:
            """Return how far the branch is above the line, rad/s."""
            zero = point.order[b] >= 0 and point.spinning.pairs.bounds[point.order[b]] >= 1.0
            omega = 0.0 if zero else point.signed(b)
            return omega if k is None else abs(omega) - k * abs(point.speed)

        pairs = [(low, high) for low, high in pairwise(path.points) if gap(low) * gap(high) < 0.0]
        found = [speed for low, high in pairs if (speed := path.zero(gap, low, high)) is not None]
        if not self.final:
            found = [self._met(path, b, gap, speed) for speed in found]
        if gap(path.right) == 0.0 != gap(path.left) and path.right.speed != 0.0:
            found.append(path.right.speed)
        return found

    def _met(self, path: BranchPath, b: int, gap: Callable[[SpeedPoint], float], speed: float) -> float:
        """Return where a branch b has no gap, from the speed at which it has none in the model: Newton's method."""
        left, right = path.left.speed, path.right.speed
        h = NEAR * (right - left)
        for _ in range(SOLUTIONS):
            try:
                point = path.take(self.solve(speed, path.left.spinning, False).spinning)
            except ComputationError:  # K is singular: this is the speed
                break
            below, above = (gap(path.joined(path.model.modes(x))) for x in (speed - h, speed + h))
            step = -gap(point) * 2 * h / (above - below)
            pairs, j = point.spinning.pairs, point.order[b]
            if abs(gap(point)) <= pairs.bounds[j] * abs(pairs.values[j]) or not left < speed + step < right:
                break
            speed += step
            if abs(step) <= LAST * (right - left):
                break
        return float(speed)

    def onsets(self) -> list[dict[str, Any]]:
        """Return the ranges in which a mode is unstable, and how: `speed` where each begins, `kind`, and `until`.

        A range that the sweep begins with has the first speed; `until` is None where none of the speeds ends it. One in
        which no growth is above the error bound of its mode is none.
        """
        kinds = [unstable(point.spinning) for point in self.points]
        out: list[dict[str, Any]] = []
        if kinds[0] is not None:
            out.append({"speed": self.points[0].speed, "kind": kinds[0], "until": None})
        for path, (before, after) in zip(self.paths, pairwise(kinds), strict=True):
            speed = None if before == after else self._change(path, before, after)
            if speed is None:
                continue
            if before is not None and out:
                out[-1]["until"] = speed
            if after is not None:
                out.append({"speed": speed, "kind": after, "until": None})
        return out

    def _change(self, path: BranchPath, before: str | None, after: str | None) -> float | None:
        """Return the speed at which modes are no longer of the kind before; None where growth ends as its mode is lost.

        Where growth begins or ends, round-off of a λ near zero may call it static or dynamic.
        """
        low, high, count = path.left.speed, path.right.speed, len(path.left.spinning.pairs.values)
        least = 1e-9 * (high - low)

        def same(s: Spinning) -> bool:
            kind = unstable(s.first(count))  # a model has more modes
            return kind == before if before and after else (kind is None) == (before is None)

        def place() -> float:
            a, b = low, high
            while b - a > least:
                middle = 0.5 * (a + b)
                a, b = (middle, b) if same(path.model.modes(middle)) else (a, middle)
            return b

        speed = place()
        for _ in range(0 if self.final else SOLUTIONS):
            try:
                path.take(self.solve(speed, path.left.spinning, False).spinning)
            except ComputationError:  # K is singular: this is the speed
                break
            last, speed = speed, place()
            if abs(speed - last) <= 1e-6 * abs(speed):
                break
        grows = max((lam.real for lam, _ in growing(path.model.modes(speed - least, count))), default=0.0)
        typical = np.median(np.abs(path.left.spinning.pairs.values))
        return None if after is None and grows > 1e-2 * typical else speed


def synchronous(analysis: ModalAnalysis, top: float, count: int) -> list[tuple[float, str, int]] | None:
    """Return (speed, direction, number in it) of the first critical speeds of an undamped shaft; None of other rotors.

    Whirl e^{iΩt} at the speed Ω, at which C = ΩG, is an eigenvector of (K − Ω² (M − iG)) x = 0; all three are constant
    and the pencil is Hermitian, so that one solution has all of them (Genta 2005, section 4.5), whatever the grid.

    Args:
        analysis: of the shaft.
        top: a speed up to which the bearings are the same, rad/s.
        count: number of speeds, at most.
    """
    names = list(analysis.structure.unknowns)
    free = np.tile([n not in ("u1", "theta1") for n in names], analysis.system.V.dofmap.index_map.size_local)
    if not analysis.fixed or analysis.comm.size > 1 or len(free) > MOST_DENSE or top == 0.0 or analysis.mixed.used:
        return None
    free[analysis.system.clamped] = False
    at = [analysis.pencils(speed, analysis.equilibrium(speed))[0] for speed in (0.0, top)]
    if any(sparse_part(pencil.C) is not pencil.C for pencil in at):
        return None
    (M, C_0, K_0), (_, C, K) = ([A[:, :][np.ix_(free, free)] for A in (p.M, p.C, p.K)] for p in at)
    d = 1.0 / np.sqrt(np.abs(np.diag(K_0)))
    M, C_0, K_0, C, K = (d[:, None] * A * d for A in (M, C_0, K_0, C, K))
    damped = max(norm(C_0), norm(C + C.T)) > SAME * top * norm(M)
    if damped or max(norm(K - K_0), norm(K - K.T)) > SAME * norm(K):
        return None
    try:
        inverse, X = eigh(M - 1j * C / top, K)  # 1/Ω²
    except np.linalg.LinAlgError:  # nothing holds it
        return None
    kind, sense = np.array(names)[np.flatnonzero(free) % len(names)], np.sign(analysis.problem.motion.axis[0])
    found, X = 1.0 / np.sqrt(inverse[inverse > 0.0])[::-1], (d[:, None] * X)[:, ::-1]
    y, z, numbers = X[kind == "u2"], X[kind == "u3"] * sense, Counter[str]()
    out = list[tuple[float, str, int]]()
    for group in repeated(found, np.zeros(len(found))):
        with_it, against = (y[:, group] + sign * 1j * z[:, group] for sign in (1.0, -1.0))
        shares = np.linalg.eigvalsh(with_it.conj().T @ with_it - against.conj().T @ against)
        for speed, share in zip(found[group].tolist(), shares, strict=True):
            numbers[way := "forward" if share > 0.0 else "backward"] += 1
            out.append((speed, way, numbers[way]))
    return out[:count]


def growing(spinning: Spinning) -> list[tuple[complex, str]]:
    """Return (λ, kind of instability) of the modes that grow by more than their error bounds."""
    pairs = zip(spinning.pairs.values.tolist(), spinning.pairs.bounds.tolist(), strict=True)
    kinds = [(lam, stability(lam, bound)) for lam, bound in pairs]
    return [(lam, kind) for lam, kind in kinds if kind.endswith("instability")]


def unstable(spinning: Spinning) -> str | None:
    """Return the kind of instability of the mode that grows fastest at a speed, None if none grows."""
    return max(growing(spinning), key=lambda found: found[0].real, default=(0.0, None))[1]
