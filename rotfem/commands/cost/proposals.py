"""The setting that should be the cheapest for an accuracy, from errors that were measured. No dolfinx in it.

The error of a setting is at most the sum of those of its theory, its mesh and its step. That of the mesh follows a
power of the size of elements, that of the step one of the step; between settings that were measured both are
interpolated, beyond them they are continued with the order of the method. What is proposed is computed and judged like
all others.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil, exp, floor, inf, log

from rotfem.commands.cost.front import Row, setting_of
from rotfem.commands.cost.prediction import Prediction, order, power_law
from rotfem.commands.cost.refinement import Plan
from rotfem.commands.cost.settings import LONGEST, Elements, Setting, samples_every, scaled

#: Part of the accuracy that a proposal aims at.
AIM = 0.8

#: Parts of what theory and uncertainty leave that are given to the mesh, with steps and without.
MESH_SHARES, ALL = (0.03, 0.1, 0.3, 0.6), (1.0,)

#: How much longer a step, or how much coarser a mesh, is proposed than any that was measured.
LEAP = 3.0

#: Part of an error that is the step's at least, however much of it the mesh seems to make.
OWN_SHARE = 0.1

#: Errors below this are round-off, which follows no power.
ROUND_OFF = 1e-12


@dataclass(frozen=True)
class Proposal:
    """A setting with the error it should have, and the CPU time (s, with set-up) it should take."""

    setting: Setting
    error: float
    cost: float


@dataclass
class Knowledge:
    """What a study knows when it proposes.

    Attributes:
        plan: what references began with.
        rows: settings measured, with their errors.
        meshes: theory ↦ settings on different meshes, alike in all else, and the error of each one's mesh.
        model_errors: of the theories that may be proposed.
        uncertainty: of what errors are measured against.
        prediction: of time.
    """

    plan: Plan
    rows: Sequence[Row]
    meshes: Mapping[str, Sequence[tuple[Setting, float]]]
    model_errors: Mapping[str, float]
    uncertainty: float
    prediction: Prediction

    def best(self, accuracy: float, fixed: Set[str] = frozenset()) -> Proposal | None:
        """Return the proposal that should be cheapest of those that have not been tried; None if there is none.

        Args:
            accuracy: relative.
            fixed: "elements" and "steps", where only those that were measured may be proposed.
        """
        tried = {setting_of(row) for row in self.rows}
        meshes, steps = ({getattr(s, name) for s in tried} for name in ("elements", "step"))
        found = []
        for proposal in (p for theory in self.model_errors for p in self._of_theory(theory, accuracy)):
            setting = proposal.setting
            known = setting in tried or ("elements" in fixed and setting.elements not in meshes)
            if not known and not ("steps" in fixed and setting.step not in steps):
                found.append(proposal)
        return min(found, key=lambda proposal: proposal.cost, default=None)

    def _of_theory(self, theory: str, accuracy: float) -> Iterator[Proposal]:
        floor_error = self.model_errors[theory] + self.uncertainty
        room = AIM * accuracy - floor_error
        if not 0.0 < room < inf:  # what is uncertain without bound leaves none
            return
        for elements, degree, error in self._meshes(theory, room):
            base = replace(self.plan.own, theory=theory, elements=elements, degree=degree)
            if self.plan.own.scheme is None:
                yield self._proposal(base, floor_error + error)
                continue
            for scheme in dict.fromkeys(row["scheme"] for row in self.rows):
                yield from self._in_time(replace(base, scheme=scheme), room - error, floor_error + room)

    def _proposal(self, setting: Setting, error: float) -> Proposal:
        cost = self.prediction.of(setting)["cpu"]
        return Proposal(setting, error, float("inf") if cost is None else cost)

    # --- in space ----------------------------------------------------------------------------------------------------

    def _meshes(self, theory: str, room: float) -> Iterator[tuple[Elements, int, float]]:
        """Return number of elements, degree and error of meshes whose error leaves room for that of the step."""
        known = self.meshes.get(theory) or next(iter(self.meshes.values()), [])
        for degree in dict.fromkeys(setting.degree for setting, _ in known):
            points = [(s.elements, e) for s, e in known if s.degree == degree]
            most = room * (MESH_SHARES if self.plan.own.scheme is not None else ALL)[-1]
            yield from ((elements, degree, e) for elements, e in points if e <= most)
            sizes = [(1 / _number(n), e) for n, e in points if n is not None and e > ROUND_OFF]
            law = power_law(sizes, 1.0, 2.0 * degree + 2.0)
            if law is None or self.plan.own.elements is None:
                continue
            c, p = law
            for share in MESH_SHARES if self.plan.own.scheme is not None else ALL:
                wanted = ceil((c / (share * room)) ** (1 / p) - 1e-9)
                coarsest = ceil(min(_number(n) for n, _ in points) / LEAP)
                elements = scaled(self.plan.own.elements, max(wanted, coarsest) / _number(self.plan.own.elements))
                error = c * _number(elements) ** -p
                if error <= most * (1 + 1e-9):
                    yield elements, degree, error

    def mesh_error(self, row: Row) -> float:
        """Return the error that a row's mesh makes by itself, as far as it is known."""
        known = self.meshes.get(row["theory"]) or next(iter(self.meshes.values()), [])
        setting = setting_of(row)
        return next((e for s, e in known if s.elements == setting.elements and s.degree == setting.degree), 0.0)

    # --- in time -----------------------------------------------------------------------------------------------------

    def _in_time(self, base: Setting, room: float, error: float) -> Iterator[Proposal]:
        """Return proposals for the step, or the tolerance, of a scheme whose error has some room."""
        steps = self._points(base, "step")
        if steps and room > 0.0:
            wanted = self._step(where(steps, room, order(base)))
            unstable = [row["step"] for row in self._rows(base) if row["status"] == "failed" and row["step"]]
            if wanted > 0.0 and all(wanted < step for step in unstable):
                every = samples_every(self.plan.interval, wanted)
                yield self._proposal(replace(base, step=wanted, tolerance=None, every=every), error)
        tolerances = self._points(base, "tolerance")
        if tolerances and room > 0.0:
            tolerance = _rounded(where(tolerances, room, 1.0))
            yield self._proposal(replace(base, step=None, tolerance=tolerance, every=1), error)

    def _rows(self, base: Setting) -> list[Row]:
        """Return the rows of a scheme: of the theory itself, or of those that may be proposed where it has none."""
        there = [row for row in self.rows if row["scheme"] == base.scheme and row["theory"] in self.model_errors]
        return [row for row in there if row["theory"] == base.theory and row["status"] == "done"] or there

    def _points(self, base: Setting, knob: str) -> list[tuple[float, float]]:
        """Return (step or tolerance, error) of a scheme, by step, without what the mesh adds."""
        least: dict[float, float] = {}
        for row in self._rows(base):
            if row[knob] is None or row["status"] != "done" or row["error"] is None:
                continue
            error = max(row["error"] - self.mesh_error(row), OWN_SHARE * row["error"], self.uncertainty, ROUND_OFF)
            least[row[knob]] = min(least.get(row[knob], float("inf")), error)
        return sorted(least.items())

    def _step(self, wanted: float) -> float:
        """Return a step (s) at most as long as the wanted one, whose samples are among those of the reference."""
        wanted = min(wanted, LONGEST * self.prediction.end)
        if wanted >= self.plan.interval:
            return self.plan.interval * floor(wanted / self.plan.interval * (1 + 1e-9))
        return self.plan.interval / ceil(self.plan.interval / wanted * (1 - 1e-9)) if wanted > 0.0 else 0.0


def where(points: Sequence[tuple[float, float]], wanted: float, highest: float) -> float:
    """Return the largest x at which an error is at most what is wanted, from points (x, error) in order of x.

    Between points log e is linear in log x. Below the smallest x the slope there goes on, within 1 and the highest one;
    above the largest x the highest one does, and not far.
    """
    x, e = points[-1]
    if e <= wanted:
        return float(min(x * (wanted / e) ** (1 / highest), LEAP * x))
    for (x0, e0), (x1, e1) in reversed(list(pairwise(points))):
        if e0 <= wanted < e1:
            return exp(log(x0) + (log(wanted) - log(e0)) / (log(e1) - log(e0)) * (log(x1) - log(x0)))
    law = power_law(points, 1.0, highest)
    assert law is not None
    c, p = law
    return float(min((wanted / c) ** (1 / p), points[0][0]))


def _number(elements: Elements) -> int:
    """Return the number of elements, along the first direction of a plate."""
    return elements[0] if isinstance(elements, tuple) else elements or 1


def _rounded(value: float) -> float:
    """Return a number with two digits, not above the value."""
    digit = 10.0 ** (floor(log(value, 10)) - 1)
    return float(f"{floor(value / digit * (1 + 1e-9)) * digit:.2g}")
