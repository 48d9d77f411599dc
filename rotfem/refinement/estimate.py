"""The error of an answer by its distance to a coarser one, and what a result says of its own error.

Let u_h be an answer in steps or cells of size h, of order p. In the asymptotic range

    |u_h − u| = |u_h − u_rh| / (r^p − 1)

(Richardson's extrapolation; Hairer, Nørsett & Wanner 1993, section II.4). Beyond it, or where no order is known, the
error reported is the difference itself. What cannot be computed is unknown.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

#: Relative difference of two answers up to which their order is believed.
ASYMPTOTIC = 0.05

#: Sum of the contributions above which it is reported, where no accuracy was asked for.
NOTICED = 0.01

#: What the shares are called in text.
WORDS = {"time": "steps", "space": "mesh", "model": "model", "round_off": "round-off"}


def error_of(difference: float, order: float, ratio: float = 2.0) -> float:
    """Return the error of the finer of two answers.

    Args:
        difference: relative.
        order: of convergence; 0 where none is known.
        ratio: of their step or cell sizes.
    """
    if difference > ASYMPTOTIC or order < 1.0:
        return difference
    return float(difference / (ratio**order - 1.0))


@dataclass(frozen=True)
class ErrorEstimate:
    """Shares of an error, relative to `scale` of a run and to each frequency of modes; None where nothing is known.

    Attributes:
        contributions: name (`time`, `space`, `model`, `round_off`) ↦ relative error.
        found: further facts: instants, the scale, how a share was found.
    """

    contributions: dict[str, float | None]
    found: dict[str, Any] = field(default_factory=dict)

    @property
    def total(self) -> float | None:
        """Sum of the shares; None where one is unknown."""
        known = [float(share) for share in self.contributions.values() if share is not None]
        return sum(known) if known and len(known) == len(self.contributions) else None

    def summary(self) -> dict[str, Any]:
        """Return what a summary has of it."""
        return {**self.contributions, "total": self.total, **self.found}


def error_line(summary: dict[str, Any]) -> str:
    """Return the line about `error` of a summary."""
    if summary["total"] is None:
        return "error: unknown"
    parts = ", ".join(f"{WORDS[n]} {percent(summary[n])}" for n in WORDS if n in summary)
    return f"error (estimated): {percent(summary['total'])} ({parts})"


def percent(share: float | None) -> str:
    """Return a share in per cent with two digits."""
    if share is None:
        return "unknown"
    return "0 %" if share < 5e-9 else f"{100 * share:.2g} %" if share < 0.995 else f"{100 * share:.3g} %"
