"""The error of an answer by its difference to a coarser one, and the error table of a result.

Let u_h be an answer in steps or cells of size h, of order p. In the asymptotic range

    |u_h − u| = |u_h − u_rh| / (r^p − 1)

(Richardson's extrapolation; Hairer, Nørsett & Wanner 1993, section II.4). Beyond it, or where no order is known, the
error reported is the difference itself. The asymptotic range of meshes is one of small differences, that of steps one
of small phase errors (`rotfem.refinement.companion`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

#: Relative difference of answers on two meshes up to which they count as in the asymptotic range.
ASYMPTOTIC = 0.05

#: Total error above which a warning names its causes, where no accuracy was asked for.
NOTICED = 0.01

#: Contributions to an error as they are called in text.
WORDS = {"time": "steps", "space": "mesh", "model": "model", "round_off": "round-off"}


def error_of(difference: float, order: float, ratio: float = 2.0) -> float:
    """Return the error of the finer of two answers, relative.

    Args:
        difference: of the two, relative.
        order: of convergence.
        ratio: of their step or cell sizes.
    """
    return difference if difference > ASYMPTOTIC else extrapolated(difference, order, ratio)


def extrapolated(difference: float, order: float, ratio: float = 2.0) -> float:
    """Return the error of the finer of two answers in the asymptotic range: their difference over r^p − 1."""
    return float(difference / (ratio**order - 1.0))


@dataclass(frozen=True)
class ErrorEstimate:
    """Contributions to an error, relative to `scale` of a run or to each frequency of modes; None where unknown.

    Attributes:
        contributions: name (`time`, `space`, `model`, `round_off`) ↦ relative error.
        found: further entries of the summary: instants, the scale.
    """

    contributions: dict[str, float | None]
    found: dict[str, Any] = field(default_factory=dict)

    @property
    def total(self) -> float | None:
        """Sum of the contributions; None where one is unknown."""
        known = [float(part) for part in self.contributions.values() if part is not None]
        return sum(known) if known and len(known) == len(self.contributions) else None

    def summary(self) -> dict[str, Any]:
        """Return the table `error` of a summary."""
        return {**self.contributions, "total": self.total, **self.found}


def error_line(summary: dict[str, Any]) -> str:
    """Return the line about `error` of a summary."""
    if summary["total"] is None:
        return "error: unknown"
    parts = ", ".join(f"{WORDS[n]} {percent(summary[n])}" for n in WORDS if n in summary)
    return f"error (estimated): {percent(summary['total'])} ({parts})"


def percent(ratio: float | None) -> str:
    """Return a ratio in per cent with two digits, of large ones three."""
    if ratio is None:
        return "unknown"
    return "0 %" if ratio < 5e-9 else f"{100 * ratio:.2g} %" if ratio < 0.995 else f"{100 * ratio:.3g} %"
