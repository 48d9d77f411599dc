"""What a run counts, and what it watches in its states: the range of its theory, and finite numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np

from rotfem.analysis.march import LARGEST_LINEAR_DEFLECTION
from rotfem.analysis.schemes import State
from rotfem.analysis.stability import Stability
from rotfem.analysis.theory_error import Farthest
from rotfem.errors import ComputationError
from rotfem.mechanics.theories import Theory, richest, theories


@dataclass
class Log:
    """What a run counts and has to say.

    Attributes:
        started: `perf_counter()` then, s.
        steps: number of the last step.
        elapsed: time that it had taken before it went on from a checkpoint, s.
        warnings, advice: texts.
        resumed: time (s) and number of ranks of every checkpoint that it went on from.
    """

    started: float = field(default_factory=perf_counter)
    steps: int = 0
    elapsed: float = 0.0
    warnings: list[str] = field(default_factory=list)
    advice: list[str] = field(default_factory=list)
    resumed: list[dict[str, Any]] = field(default_factory=list)


class Monitor:
    """Sees that the theory of a run holds for its states; an observer of these.

    Args:
        system: equations of motion.
        critical: speed at which the stiffness of its theory is singular, rad/s; None if there is none.

    Attributes:
        since: from when on (s) the speed was above the critical one; None before.
        farthest: largest state so far.
        stability: of the equilibrium that is computed, or that a history starts from; None where there is none.
    """

    def __init__(self, system: Any, critical: float | None):
        self.system, self.critical = system, critical
        self.since: float | None = None
        self.farthest = Farthest(system)
        self.stability: Stability | None = None

    def step(self, state: State) -> None:
        """Stop a history that has left the range of its theory."""
        if not self.system.linear:
            return
        speed = abs(self.system.motion.speed(state.t))
        if self.since is None and self.critical is not None and speed > self.critical:
            self.since = state.t
        size = self.system.size(state.q)
        if np.isfinite(size) and size <= LARGEST_LINEAR_DEFLECTION:
            return
        raise self._diverged(state.t)

    def _diverged(self, time: float) -> ComputationError:
        """Return the error of a linear solution that has diverged, and which theories to use in its place."""
        theory: Theory = self.system.model.problem.theory
        loose = [hinge.name for hinge in self.system.structure.hinges.values() if hinge.stiffness == 0.0]
        why = "the motion is unstable, or the load is too large for a linear theory"
        if loose:
            why = f"no spring holds the root's hinge ({', '.join(loose)}), which turns beyond what is linear"
        if self.since is not None:
            why = f"its stiffness is not definite above {self.critical:.6g} rad/s, passed at t = {self.since:.4g} s"
            if not theory.prestress:
                why += ": first-order strains have the softening by the centrifugal force but not the stiffening"
        what = f"the {theory.name} solution diverged (a displacement exceeds the length, or a rotation 1 rad; {why})"
        exact = richest().name
        advice = f'use model.theory = "{exact}", which holds for any deflection'
        if not theory.prestress and not loose:
            stiffened = next(t.name for t in theories() if t.linear and t.prestress)
            advice = f'use model.theory = "{stiffened}" for small or "{exact}" for any deflection'
        return ComputationError(what, time=time, advice=advice)

    def row(self, state: State) -> None:
        """Take note of a state that is recorded."""
        if not self.system.linear:
            self.system.structure.check_range(state.q, state.t)
        self.farthest(state.q, state.t)


def check_finite(values: Iterable[tuple[str, Any]], time: float | None = None, where: str = "") -> None:
    """See that all named values, computed at a time (s), are finite; what is no number passes.

    Raises:
        ComputationError: names those that are not, and where.
    """
    wrong = [name for name, value in values if isinstance(value, float) and not math.isfinite(value)]
    if wrong:
        more = f" and {len(wrong) - 3} more" if len(wrong) > 3 else ""
        advice = "check the units of the scene, whose numbers are out of all proportion, or use a shorter time step"
        raise ComputationError(f"not a finite number{where}: {', '.join(wrong[:3])}{more}", time, advice)


def check_rows(rows: Iterable[Mapping[str, Any]]) -> None:
    """See that all numbers of modes, or of branches over speed, are finite."""
    for number, row in enumerate(rows, start=1):
        where = f" at {row['speed']:g} rad/s" if "speed" in row else ""
        check_finite(row.items(), where=f" of mode {row.get('branch', number)}{where}")
