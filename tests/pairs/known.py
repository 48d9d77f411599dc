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

#: Meetings in which some scenes fail and others do not: they are tried, and a failure is expected.
OPEN: tuple[Failure, ...] = (
    Failure(
        {"command": ("modes", "campbell", "response"), "root": ("hinge",), "loads": ("follower",)},
        "a follower turns a hinge: no equilibrium is found that modes could be about",
    ),
    Failure(
        {"motion": ("controller",), "structure": ("spatial", "mesh", "plate")},
        "psi of a run that goes on, or that has all unknowns, differs by up to 1e-3 under a torque that is a function",
    ),
    Failure(
        {"root": ("hinge",), "time": ("steady",), "loads": ("gravity",)},
        "the force at the root of a steady state that hangs on a hinge does not balance the weight",
    ),
)
