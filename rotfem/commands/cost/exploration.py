"""One work–precision study: references, the grid, proposals, one after the other, all within the budget.

The error of a setting is its distance to the converged output of the same theory, found by refinement with an
uncertainty of its own; what the theory itself misses is the distance of its converged output from the exact one's. What
errors and times say of settings that were not tried is proposed, computed and judged in its turn, until nothing cheaper
is in sight; so what is recommended has been run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import floor, inf, log2
from pathlib import Path
from typing import Any

import numpy as np

from rotfem import registry
from rotfem.commands.cost.bench import check_degrees
from rotfem.commands.cost.budget import Budget
from rotfem.commands.cost.front import Row, describe, model_errors, recommend, rows_of, setting_of, truth_of
from rotfem.commands.cost.laboratory import Laboratory
from rotfem.commands.cost.proposals import Knowledge
from rotfem.commands.cost.reference import Reference, Samples, distance, neighbour
from rotfem.commands.cost.refinement import Plan, Refinement
from rotfem.commands.cost.result import CostResult
from rotfem.commands.cost.settings import (
    Setting,
    cells,
    estimating_schemes,
    grid,
    own_setting,
    sample_interval,
    scaled,
    unique,
)
from rotfem.commands.cost.summary import study_summary
from rotfem.errors import ComputationError, SceneError
from rotfem.listeners import Progress
from rotfem.mechanics.theories import richest
from rotfem.scene import Scene

#: Name of the file that keeps what has been measured.
RECORD = "cost.jsonl"

#: What a setting does not have outside a history.
STILL: dict[str, Any] = {"scheme": None, "step": None, "tolerance": None, "every": 1}

#: Part of the accuracy that a reference of the richest theory may be off by; of another theory, of the theory's error.
CERTAIN, CERTAIN_OF_MODEL = 1 / 5, 1 / 10

#: The same where the time does not suffice for that: half of the accuracy is left to settings.
ENOUGH = 1 / 2

#: Uncertainty with which the richest theory's reference begins in a quick study.
ROUGH = 0.02

#: Uncertainty below which no reference is refined: what Newton leaves is not far below.
LEAST_GOAL = 1e-8

#: Parts of the time left that one computation may take: of the richest theory's reference, of this and of a proposal
#: where nothing could be recommended without it, of others', of the scene's own setting, of the rest of the grid, of a
#: proposal, of a repetition.
SHARES = {"truth": 0.4, "last": 0.8, "reference": 0.1, "own": 0.5, "grid": 0.1, "proposal": 0.5, "repeat": 0.3}

#: Part of the budget that the grid leaves to proposals.
RESERVE = 0.4

#: Proposals in a row, and what one must promise to save to be tried when a good setting is known.
MOST_ROUNDS, WORTH = 12, 0.85

#: An accuracy must be this many times what is uncertain for settings to be told apart by it.
TOLD_APART = 2.0

#: A setting whose cost is within this factor of the recommended one's is timed as often as that.
CLOSE = 1.3

#: References go on until their steps are at most this part of the shortest tried (not in a quick study).
FINER_STEPS = 1 / 4


class Study:
    """One work–precision study.

    Args:
        scene: validated scene.
        output: one of OUTPUTS.
        repeat: repetitions of every setting that may be recommended.
        budget: time and memory.
        folder: where the record is kept, or None.
        resume: whether to go on with the record that is there.
    """

    def __init__(self, scene: Scene, output: str, repeat: int, budget: Budget, folder: Path | None, resume: bool):
        self.scene, self.output, self.repeat, self.budget = scene, output, repeat, budget
        self.each = output != "tip"
        self.laboratory = Laboratory(scene, output, budget, None if folder is None else folder / RECORD, resume)
        self.own = own_setting(scene) if output == "tip" else replace(own_setting(scene), **STILL)
        self.references: dict[str, Reference] = {}
        self.failures: dict[str, str] = {}
        self.chosen: Mapping[str, Sequence[Any] | None] = {}

    def run(
        self, quick: bool, accuracy: float, chosen: Mapping[str, Sequence[Any] | None], progress: Progress
    ) -> CostResult:
        """Return the result (see `cost`)."""
        self.chosen = chosen
        base = self.base_step()
        settings = grid(self.scene, self.output, quick, base, chosen)
        check_degrees(self.scene, chosen.get("degrees") or (), self.laboratory.comm)
        self.plan = self._plan(settings, base, quick, chosen)
        self.refinement = Refinement(self.plan, lambda s, share: self.laboratory.get(s, share, "reference"))
        self._refer(unique([richest().name, *(s.theory for s in settings)]), accuracy, quick)
        progress(0.4)
        self._try(settings, RESERVE, progress)
        rows = [row for row in self.rows() if row["candidate"]]
        if not any(row["status"] == "done" for row in rows):
            row = rows[-1] if rows else None
            why = "the budget is too small" if row is None else f"{describe(row)}: {row['reason']}"
            raise ComputationError(f"no setting could be computed ({why})")
        truth = truth_of(self.references)
        if not self.each and truth is not None and not np.any(self.references[truth].samples.values):
            raise SceneError(self.scene.file, "cost --of", "tip", 'the tip does not move; try output "frequencies"')
        self._propose(accuracy)
        self._repeat(accuracy)
        self._try(settings, 0.0, progress)
        progress(1.0)
        rows = self.rows()
        return CostResult(study_summary(self, rows, accuracy, quick), rows, self.scene, self.references)

    def rows(self) -> list[Row]:
        """Return one row a setting that was measured."""
        return rows_of(self.laboratory.measured, self.references, self.each, self.chosen.get("theories"))

    @property
    def uncertainty(self) -> float:
        """How far what errors are measured against may be off; infinite where there is nothing."""
        truth = truth_of(self.references)
        return inf if truth is None else self.references[truth].uncertainty

    # --- what is tried -----------------------------------------------------------------------------------------------

    def _plan(
        self, settings: Sequence[Setting], base: float | None, quick: bool, chosen: Mapping[str, Sequence[Any] | None]
    ) -> Plan:
        """Return what references begin with."""
        finest = max((s.elements for s in settings), key=cells)
        mesh = self.own.elements if any(s.elements == self.own.elements for s in settings) else finest
        own = replace(self.own, elements=mesh, degree=max(s.degree for s in settings))
        plan = Plan(own, self.each, least_mesh=None if quick else scaled(finest, 2.0))
        comm, bench = self.laboratory.comm, self.laboratory.bench
        plan.warming = lambda: float(comm.bcast(bench.warming))  # all processes decide alike
        if base is None:
            return plan
        plan.interval = sample_interval(self.scene, base)
        steps = unique([s.step for s in settings if s.step is not None]) or [base]
        # Steps whose samples are those of others: the interval times a power of two.
        alike = [h for h in steps if abs(log2(plan.interval / h) - round(log2(plan.interval / h))) < 1e-6] or steps
        plan.first_step = min(alike) * 2.0 ** floor(log2(max(alike) / min(alike)) + 1e-9)
        plan.least_step = None if quick else FINER_STEPS * min(alike)
        others = chosen.get("schemes") or registry.schemes.names
        plan.schemes = [name for name in others if name != own.scheme]
        if chosen.get("schemes") and own.scheme not in others:
            plan.own, plan.schemes = replace(own, scheme=others[0]), list(others[1:])
        return plan

    def _refer(self, theories: Sequence[str], accuracy: float, quick: bool) -> None:
        """Make the references, that of the richest theory first; in a quick study others are told from it."""
        truth, goal = theories[0], max(CERTAIN * accuracy, LEAST_GOAL)
        self._refine(truth, max(goal, ROUGH) if quick else goal, SHARES["truth"], self.plan.schemes)
        beside = {theory: self._beside(theory, truth) for theory in theories[1:]}
        if quick:  # the others are known now, however much time the rest takes
            self._refine(truth, goal, SHARES["truth"], self.plan.schemes)
        if self.uncertainty > max(accuracy / TOLD_APART, goal):  # nothing could be recommended
            self._refine(truth, self.enough(accuracy), SHARES["last"], self.plan.schemes)
        for theory, there in beside.items():
            if quick and there is not None and truth in self.references:
                self.references[theory] = neighbour(self.references[truth], *there, self.refinement.errors[truth])
            elif not quick or truth not in self.references:
                apart = 0.0 if there is None else distance(*there, self.each)
                self._refine(theory, max(goal, CERTAIN_OF_MODEL * apart), SHARES["reference"], ())

    def _refine(self, theory: str, goal: float, share: float, schemes: Sequence[str]) -> None:
        found = self.refinement.reference(theory, goal, share, schemes)
        known = self.references.get(theory)
        if found is None and known is None:
            self.failures[theory] = self.refinement.reasons.get(theory, "")
        elif found is not None and (known is None or found.uncertainty <= known.uncertainty):
            self.references[theory] = found

    def _beside(self, theory: str, other: str) -> tuple[Samples, Samples] | None:
        """Return the output of two theories for one setting; None, and why, where there is none."""
        base = self.refinement.base.get(other)
        if base is None:
            return None
        there, here = (
            self.laboratory.get(replace(base, theory=t), SHARES["own"], "reference") for t in (theory, other)
        )
        if there is None or there.samples is None or here is None or here.samples is None:
            self.failures[theory] = "the budget is too small for it" if there is None else there.reason
            return None
        return there.samples, here.samples

    def _try(self, settings: Sequence[Setting], reserve: float, progress: Progress) -> None:
        """Measure the grid, the scene's own setting first, then the cheapest, until a part of the budget is left."""
        get, known = self.laboratory.get, self.laboratory.prediction
        if self.own in settings:
            get(self.own, SHARES["own"], "grid")
        order = sorted(settings, key=lambda s: known.of(s)["cpu"] or 0.0)
        for i, setting in enumerate(order):
            if self.budget.left() < reserve * self.budget.seconds:
                return
            get(setting, SHARES["grid"], "grid")
            progress(0.4 + 0.4 * (i + 1) / len(order))

    def _propose(self, accuracy: float) -> None:
        """Compute what should be the cheapest good setting until nothing cheaper than what is known is in sight."""
        truth = truth_of(self.references)
        if truth is None:
            return
        errors = {t: e for t, e in model_errors(self.references, self.each).items() if t in self.allowed}
        self._seed(truth, accuracy)
        goal = aim = self.attainable(accuracy)
        for _ in range(MOST_ROUNDS):
            rows = self.rows()
            best = recommend(rows, goal, self.uncertainty)
            knowledge = Knowledge(
                self.plan, rows, self.refinement.meshes, errors, self.uncertainty, self.laboratory.prediction
            )
            proposal = knowledge.best(aim, self.fixed)
            if proposal is None or (best is not None and proposal.cost > WORTH * best["cost"]):
                return
            share = SHARES["last" if best is None else "proposal"]
            found = self.laboratory.get(proposal.setting, share, "proposal")
            if found is None:
                return
            row = next(r for r in self.rows() if setting_of(r) == proposal.setting)
            aim = goal if recommend([row], goal, self.uncertainty) is not None else 0.8 * aim

    def _seed(self, truth: str, accuracy: float) -> None:
        """Try adaptive steps of the schemes that have them, so that tolerances can be proposed."""
        if self.plan.first_step is None or self.chosen.get("steps"):
            return
        for scheme in estimating_schemes(self.chosen.get("schemes")):
            adaptive = replace(self.plan.own, theory=truth, scheme=scheme, step=None, tolerance=accuracy, every=1)
            self.laboratory.get(adaptive, SHARES["grid"], "proposal")

    @property
    def allowed(self) -> Sequence[str]:
        """Theories that may be recommended."""
        return self.chosen.get("theories") or list(self.references)

    @property
    def fixed(self) -> frozenset[str]:
        """Which of "elements" and "steps" were chosen, so that no others are proposed."""
        return frozenset(name for name in ("elements", "steps") if self.chosen.get(name))

    def enough(self, accuracy: float) -> float:
        """Return the uncertainty of a reference that leaves settings enough of the accuracy to be recommended."""
        return max(ENOUGH * accuracy, LEAST_GOAL)

    def attainable(self, accuracy: float) -> float:
        """Return the accuracy, or the nearest one that can be told from what errors are measured against."""
        return max(accuracy, TOLD_APART * self.uncertainty)

    def _repeat(self, accuracy: float) -> None:
        """Time what may be recommended as often as was asked for, and the front, whose times are looked at."""
        accuracy = self.attainable(accuracy)
        rows = self.rows()
        best = recommend(rows, accuracy, self.uncertainty)
        near = [r for r in rows if best is not None and r["cost"] <= CLOSE * best["cost"]]
        near = [r for r in near if recommend([r], accuracy, self.uncertainty) is not None]
        for row in [*near, *(r for r in rows if r["pareto"])]:
            self.laboratory.get(setting_of(row), SHARES["repeat"], row["purpose"], self.repeat)

    # --- the scene ---------------------------------------------------------------------------------------------------

    def base_step(self) -> float | None:
        """Return the fixed step (s) around which steps are tried: the scene's own, or the mean of its adaptive ones.

        Raises:
            ComputationError: the scene as it is cannot be computed, so that the mean step is not known.
        """
        time = self.scene.time
        if self.output != "tip" or time is None:
            return None
        if time.step is not None:
            return time.step
        pilot = self.laboratory.get(self.own, 1.0, "grid")
        if pilot is None or pilot.status != "done":
            why = "" if pilot is None else f": {pilot.reason}"
            raise ComputationError(f"the scene as it is failed, so that no grid can be made around it{why}")
        return time.end / pilot.steps
