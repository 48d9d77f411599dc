"""What a run counts, and what it watches in its states: the range of its theory, finite numbers, and energy.

Energy and momentum that a history has from nowhere show what steps that are too long do before anything else is seen.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.march import LARGEST_LINEAR_DEFLECTION
from rotfem.analysis.schemes import State
from rotfem.analysis.stability import Stability
from rotfem.analysis.theory_error import Farthest
from rotfem.errors import ComputationError
from rotfem.mechanics.theories import Theory, richest, theories

Array = npt.NDArray[np.float64]

#: Growth of the Jacobi integral, relative to the energy exchanged, that is reported.
GROWN = 0.02


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


def growth(history: dict[str, Array], between: bool = False) -> float:
    """Return by how much the Jacobi integral grew, relative to the energy exchanged; 0 where that is nothing.

    Schemes let it fluctuate with the motion by h²; so the largest of the last tenth of the rows is compared with the
    largest of the first tenth. What is exchanged is the range of the strain energy or of the kinetic one.

    Args:
        history: columns by name; a row that is not finite and all after it are left out.
        between: whether rows lie between steps, see `_growth`.
    """
    energies = np.array([history[name] for name in ("jacobi", "kinetic", "strain")])
    return _growth(energies[0], energies[1:], between)


def growth_on_hub(history: dict[str, Array], between: bool = False) -> float:
    """Return by how much the energy of hub and structure grew beyond the work of torque and brake (see `growth`)."""
    kinetic = history["kinetic"] + history["hub_kinetic"]
    return _growth(kinetic + history["strain"] - history["work"], np.array([kinetic, history["strain"]]), between)


def _growth(constant: Array, moving: Array, between: bool) -> float:
    """Return the growth of what should stay, shape (n,), relative to the range of energies, shape (m, n).

    Where rows lie between steps a polynomial in time stretches what turns far in a step, which the steps themselves do
    not; the rows next to their ends have least of it, so the least of the last rows counts there, and not the largest.
    """
    fine: npt.NDArray[np.bool_] = np.all(np.isfinite(np.vstack([constant, moving])), axis=0)
    n = len(fine) if fine.all() else int(np.argmin(fine))
    if n < 20:  # too few to distinguish a growth from a fluctuation
        return 0.0
    constant, moving, part = constant[:n], moving[:, :n], n // 10
    exchanged = float(np.max(np.ptp(moving, axis=1)))
    last = np.min(constant[-part:]) if between else np.max(constant[-part:])
    grown = float(last - np.max(constant[:part]))
    round_off = 1e-9 * float(np.max(np.abs(moving)))
    return grown / exchanged if exchanged > round_off and grown > 0.0 else 0.0


def energy_warning(system: Any, history: dict[str, Array], between: bool = False) -> str:
    """Return what a run says of energy that came from nowhere; nothing where something gives it, or none came.

    `between` is whether rows of the history lie between steps, see `_growth`.
    """
    if system.hub is None:
        share = growth(history, between) if system.model.closed else 0.0
        said = (
            f"the energy has grown by {100 * share:.2g} % of the energy exchanged, though nothing supplies any: the "
            "time steps are too long for this motion, or unstable; give a smaller time.step, "
            'time.scheme = "energy_conserving", or numerical damping'
        )
        return said if share >= GROWN else ""
    cause = "the time steps do not resolve the motion of the hub, as where it has little inertia of its own"
    momentum, impulse = history["angular_momentum"], history["impulse"]
    largest = max(np.max(np.abs(momentum), initial=0.0), np.max(np.abs(impulse), initial=0.0))
    off = float(np.ptp(momentum - impulse)) if len(momentum) else 0.0
    if off > 0.01 * largest:  # of what there was or was given
        return (
            f"the angular momentum of hub and structure differs by {100 * off / largest:.2g} % from the impulse of the "
            f'torque: {cause}; give a smaller time.step, or time.scheme = "radau5" or "energy_conserving"'
        )
    share = growth_on_hub(history, between) if system.inner.model.driven_by_hub else 0.0
    said = (
        f"the energy of hub and structure has grown by {100 * share:.2g} % of the energy exchanged beyond the work of "
        f"the torque: {cause}, or are unstable; give a smaller time.step or more motion.hub_inertia"
    )
    return said if share >= GROWN else ""


def with_cause(
    error: ComputationError, system: Any, history: dict[str, Array], between: bool = False
) -> ComputationError:
    """Return a failure of a history, with the energy that it had gained before as its cause."""
    cause = energy_warning(system, history, between)
    if not cause or type(error) is not ComputationError:
        return error
    why, _, advice = cause.partition("; ")
    return ComputationError(f"{error.what}; before that {why}", time=error.time, advice=advice.removeprefix("give "))


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
