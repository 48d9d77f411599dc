"""Choices that are known to fail when they meet: to be mended, and taken from this list, which must become empty."""

from __future__ import annotations

from dataclasses import dataclass

from tests.pairs.covering import Levels


@dataclass(frozen=True)
class Failure:
    """One failure that is known.

    Attributes:
        choices: factor ↦ levels that fail when all factors have one of them.
        fails: what happens.
    """

    choices: Levels
    fails: str


KNOWN: tuple[Failure, ...] = (
    Failure(
        {
            "theory": ("linear", "consistent_linear", "von_karman_linear"),
            "motion": ("rest", "spin_up", "torque", "controller"),
            "root": ("hinge",),
            "time": ("accuracy",),
        },
        "the error of a linear theory is without bound where nothing holds a hinge, so no accuracy is met",
    ),
    Failure(
        {
            "command": ("modes", "campbell", "response"),
            "structure": ("spatial",),
            "theory": ("second_order",),
            "root": ("hinge",),
            "loads": ("tip",),
        },
        "the equilibrium on a hinge that a force turns is not found in the first step of the load",
    ),
)
