"""The cheapest model that is good enough: `effects = "auto"` with `model.tolerance`.

The full model has the richest allowed theory (that of the problem) and all effects there are data for. The choice is
the poorest of its cheaper theories, and then as many effects left out, as keep

    SAFETY · (change by the theory + Σ changes by the effects left out) ≤ tolerance.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.errors import ComputationError
from rotfem.mechanics.problem import Problem
from rotfem.selection.case import Case
from rotfem.selection.coarse_model import Dear, Trial
from rotfem.selection.distance import HISTORY, Bound, change
from rotfem.selection.estimate import SAFETY

Array = npt.NDArray[Any]

#: What is left out is taken to grow as the square of the motion up to this multiple of the motion that was tried out.
GROWTH = 3.0

#: Motion (over L, or rad) that round-off makes of none, and estimates that it makes of zero.
REST, UNKNOWN = 1e-12, 1e-9


class RangeExceeded(ComputationError):
    """A run has left the range its model was chosen for.

    Attributes:
        sizes: displacement over L, or rotation in rad, that each component has met.
    """

    def __init__(self, what: str, time: float | None, sizes: Array) -> None:
        super().__init__(what, time, 'model.on_exceed = "upgrade", or a richer model.theory without model.tolerance')
        self.sizes = sizes


@dataclass(kw_only=True)
class Choice:
    """A model, and what was left out of the full one.

    Attributes:
        theory, effects: of the model, by name.
        tolerance: relative change of the outputs that was allowed.
        richest: name of the theory of the full model.
        everything: its effects.
        estimated_error: SAFETY times the estimated changes of all that was left out, relative to the full model.
        dropped: one dictionary each: `kind`, `name`, `estimate`.
        errors: theory of the ladder, from the poorest on ↦ estimated change when it takes the place of the richest,
            all effects in it.
        sizes: largest displacement over L, or rotation in rad, of each component that the estimates found.
        seconds: what choosing took.
        remark: why nothing was tried out, where nothing was.
        upgrades: what was given up during a run, and why.
    """

    theory: str
    effects: tuple[str, ...]
    tolerance: float
    richest: str
    everything: tuple[str, ...]
    estimated_error: float = 0.0
    dropped: list[dict[str, Any]] = field(default_factory=list)
    errors: dict[str, float] = field(default_factory=dict)
    sizes: Array = field(default_factory=lambda: np.zeros(0))
    seconds: float = 0.0
    remark: str = ""
    upgrades: list[dict[str, Any]] = field(default_factory=list)

    @property
    def full(self) -> bool:
        """Whether nothing is left out."""
        return self.theory == self.richest and self.effects == self.everything

    @property
    def size(self) -> float:
        """Largest displacement over L, or rotation in rad, that the estimates found."""
        return float(np.max(self.sizes, initial=0.0))

    @property
    def limits(self) -> Array:
        """Displacement over L, or rotation in rad, of each component up to which the model may serve.

        What is left out of a model is taken to grow as the square of the motion: estimate · (size/expected size)²; the
        safety factor is used up where that reaches the tolerance. The law holds for the motion that was tried out, so
        it is not trusted beyond `GROWTH` times that, in each component: a beam that was only stretched says nothing
        of one that bends. Only what is too small to change the outputs by the tolerance may be any motion.
        """
        factor = GROWTH
        if self.estimated_error > 0.0:
            factor = min(factor, float(np.sqrt(SAFETY * self.tolerance / self.estimated_error)))
        return np.maximum(factor * self.sizes, max(REST, self.tolerance / SAFETY * self.size))

    @property
    def limit(self) -> float:
        """Largest of the limits; infinite where nothing is left out."""
        return np.inf if self.full else float(np.max(self.limits, initial=0.0))

    def applied(self, problem: Problem) -> Problem:
        """Return the problem that this model was chosen for with the model."""
        poorer = {} if self.theory == self.richest else {"theory": self.theory}
        return problem.replace(effects=self.effects, **poorer)

    def check(self, sizes: Array) -> str:
        """Return why a state of this size is outside the range of the choice; nothing where it is not.

        Args:
            sizes: displacement over L, or rotation in rad, of each component.
        """
        if self.full or bool(np.all(sizes <= self.limits)):
            return ""
        worst = int(np.argmax(sizes / self.limits))
        return (
            f"the run has left the range of its model: {self.theory} with {', '.join(self.effects) or 'no effects'} "
            f"was chosen for displacements up to {self.sizes[worst]:.3g} L (or rad), may serve up to "
            f"{self.limits[worst]:.3g}, and {sizes[worst]:.3g} was met"
        )

    def richer(self, sizes: Array, time: float | None, why: str) -> Choice:
        """Return the next richer model that is good enough for a state of this size, all effects in it.

        Args:
            sizes: displacement over L, or rotation in rad, that each component has met.
            time: when (s).
            why: what happened.
        """
        size, moves = float(np.max(sizes)), sizes > self.limits
        seen = np.where(self.sizes > REST, self.sizes, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            growth = float(np.max(np.divide(sizes, seen)[moves], initial=1.0)) ** 2
        ladder = tuple(self.errors)
        theory, error = self.richest, 0.0
        for poorer in ladder[ladder.index(self.theory) + 1 : -1]:
            expected = SAFETY * max(self.errors[poorer], UNKNOWN) * growth
            if expected <= self.tolerance:
                theory, error = poorer, expected
                break
        note = {"time": time, "size": size, "from": self.theory, "to": theory, "why": why}
        dropped = [theory_step(self.richest, theory, self.errors[theory])] if theory != self.richest else []
        return replace(
            self,
            theory=theory,
            effects=self.everything,
            estimated_error=error,
            sizes=np.maximum(self.sizes, sizes),
            dropped=dropped,
            upgrades=[*self.upgrades, note],
        )

    def upgrade_warnings(self) -> list[str]:
        """Return what a run says of the models it has given up."""
        return [
            f"{note['why']}{'' if note['time'] is None else ' at t = {:.6g} s'.format(note['time'])}; "
            f"started again with {note['to']} and all effects"
            for note in self.upgrades
        ]

    def summary(self) -> dict[str, Any]:
        """Return what summary.json says of the choice."""
        expected = {"largest_expected": self.size, "largest_allowed": self.limit if np.isfinite(self.limit) else None}
        out: dict[str, Any] = {
            "theory": self.theory,
            "effects": list(self.effects),
            "estimated_error": self.estimated_error,
            "tolerance": self.tolerance,
            "dropped": self.dropped,
            "full_model": {"theory": self.richest, "effects": list(self.everything)},
            **(expected if self.size > 0.0 else {}),
            "seconds": self.seconds,
            **({"remark": self.remark} if self.remark else {}),
        }
        return out | ({"upgrades": self.upgrades} if self.upgrades else {})


def choose(
    case: Case,
    outputs: Collection[str],
    speeds: Collection[float] | None = None,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> Choice:
    """Return the cheapest model whose estimated error is below the tolerance of a case.

    Args:
        case: problem, what is to be computed of it, and the tolerance.
        outputs: which of "history", "steady" and "modes" count.
        speeds: speeds of the modes, rad/s; by default the final one.
        comm: MPI communicator.

    Raises:
        InputError: the case has none of the outputs; a mesh or a section that cannot be computed with.
    """
    started = perf_counter()
    tolerance, richest = case.tolerance, case.problem.theory.name
    assert tolerance is not None
    trial = Trial(case, outputs, speeds=speeds, comm=comm, thrifty=True)
    try:
        choice = cheapest(trial, tolerance, richest)
    except Dear as dear:
        choice = Choice(
            theory=richest,
            effects=trial.effects,
            tolerance=tolerance,
            richest=richest,
            everything=trial.effects,
            remark=f"trying models out would take longer than running the full one: {dear.what}",
        )
    choice.seconds = perf_counter() - started
    return comm.bcast(choice) if comm.size > 1 else choice


def ladder_of(trial: Trial, richest: str) -> tuple[str, ...]:
    """Return the theories to choose from, cheapest first: those the richest names that the structure has, and it."""
    return (*(name for name in trial.theories[richest].poorer if name in trial.theories), richest)


def cheapest(trial: Trial, tolerance: float, richest: str) -> Choice:
    """Return the cheapest model (see `choose`).

    Args:
        trial: the case to be tried out.
        tolerance: relative change of the outputs that is allowed.
        richest: name of the theory of the full model.

    Raises:
        Dear: trying out would not pay.
    """
    allowed, ladder = tolerance / SAFETY, ladder_of(trial, richest)
    errors = {name: _error(trial, allowed, richest, name) for name in ladder}
    theory = next(name for name in ladder if errors[name] <= allowed or name == richest)
    spent = errors[theory]
    dropped = [theory_step(richest, theory, spent)] if theory != richest else []
    costs = sorted((_error(trial, allowed, theory, theory, {name}), name) for name in trial.effects)
    left_out: list[tuple[float, str]] = []
    for cost, name in costs:
        if spent + sum(c for c, _ in left_out) + cost <= allowed:
            left_out.append((cost, name))
    together = 0.0
    while left_out:
        together = _error(trial, allowed, richest, theory, {name for _, name in left_out})
        if together <= allowed:
            break
        left_out.pop()  # the effects leave more out together than one by one
        together = 0.0
    dropped += [{"kind": "effect", "name": name, "estimate": cost} for cost, name in left_out]
    without = {name for _, name in left_out}
    return Choice(
        theory=theory,
        effects=tuple(name for name in trial.effects if name not in without),
        tolerance=tolerance,
        estimated_error=SAFETY * max(spent + sum(cost for cost, _ in left_out), together),
        dropped=dropped,
        richest=richest,
        everything=trial.effects,
        errors=errors,
        sizes=trial.outputs(theory, without).sizes,
    )


def _error(trial: Trial, allowed: float, base: str, theory: str, without: Collection[str] = ()) -> float:
    """Return the change from a theory with all effects to a model; one larger than allowed may come out infinite."""
    of = trial.outputs(base)
    bound = None if HISTORY in of.failed else Bound(of, allowed)
    other = trial.outputs(theory, without, bound)
    # Where the other needed shorter steps, the first one is computed again with them.
    return max(change(trial.outputs(base), other, trial.wanted).values(), default=np.inf)


def theory_step(richest: str, theory: str, estimate: float) -> dict[str, Any]:
    """Return the row of `Choice.dropped` that says which theory took the place of the richest."""
    return {"kind": "theory", "name": f"{richest} → {theory}", "estimate": estimate}
