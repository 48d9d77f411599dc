"""What cannot meet: choices that are refused together, with the key that is named."""

from __future__ import annotations

from typing import NamedTuple

from tests.pairs.covering import Levels
from tests.pairs.scenes import LEVELS


class Refusal(NamedTuple):
    """Factor ↦ levels that are refused when all factors have one of them, and a regular expression of the error."""

    choices: Levels
    says: str


def but(factor: str, *levels: str) -> tuple[str, ...]:
    """Return all levels of a factor but these."""
    return tuple(level for level in LEVELS[factor] if level not in levels)


FREE = ("torque", "controller")
RUN, STEADY = {"command": ("run",)}, {"command": ("run",), "time": ("steady",)}
ACROSS = ("gravity", "tip", "span", "harmonic")
#: What a hinge without a spring cannot meet at rest: loads that turn it, in theories in which it does not go to hang.
#: Modes of a free hub, and the first speed of a Campbell diagram, are those at rest; a response is about no harmonic.
LOOSE = tuple(
    {"root": ("hinge",), **loaded, **asked}
    for loaded in (
        {"theory": ("second_order",), "structure": ("planar",), "loads": ACROSS},
        {"theory": ("reissner",), "structure": ("planar",), "loads": ("follower",)},
    )
    for asked in (
        {**STEADY, "motion": ("rest",)},
        {"command": ("modes",), "motion": ("rest", *FREE)},
        {"command": ("campbell",)},
    )
) + tuple(
    {"root": ("hinge",), "theory": ("consistent_linear",), **STEADY, "motion": ("rest",), **loaded}
    for loaded in (
        {"structure": ("planar",), "loads": (*ACROSS, "follower")},
        {"structure": ("spatial",), "loads": ("tip",)},
    )
)
REFUSALS = (
    Refusal({"structure": ("plate",), "root": but("root", "clamped")}, r"structure\.root"),
    Refusal({"structure": ("planar",), "root": ("pitch",)}, r"structure\.root\.pitch"),
    Refusal({"frame": ("inertial",), "structure": but("structure", "planar")}, r"model\.frame"),
    Refusal({"frame": ("inertial",), "theory": but("theory", "reissner")}, r"model\.frame"),
    Refusal({"frame": ("inertial",), "motion": FREE}, r"model\.frame"),
    Refusal({"frame": ("inertial",), "damping": ("modal",)}, r"structure\.damping"),
    Refusal({"root": ("pitch",), "motion": FREE}, r"structure\.root\.pitch"),
    Refusal({**STEADY, "motion": but("motion", "rest", "constant")}, "time: missing"),
    Refusal({**STEADY, "checkpoint": ("resumed",)}, "--(checkpoint|resume): needs a scene with"),
    Refusal({**RUN, "time": ("accuracy",), "checkpoint": ("resumed",)}, "--(checkpoint|resume): cannot be combined"),
    Refusal({**STEADY, "structure": ("planar",), "loads": ("gravity",), "motion": but("motion", "rest")}, "gravity"),
    Refusal({"command": ("response",), "loads": but("loads", "harmonic")}, "needs a harmonic load"),
    *(Refusal(choices, "nothing holds the root's hinge") for choices in LOOSE),
)
#: What would compile long for little: estimates compare with richer theories; and the double zero of a hub and a hinge
#: that nothing holds, which has one eigenvector, so half the digits, and fails in words.
UNTRIED: tuple[Levels, ...] = (
    {"command": ("modes", "campbell"), "root": ("hinge",), "motion": FREE, "loads": ("follower",)},
    {"structure": ("spatial", "plate"), "output": ("estimated",)},
    {"structure": ("spatial", "plate"), "time": ("accuracy",)},
    {"structure": ("spatial",), "ranks": ("2",)},
    {"structure": ("spatial",), "theory": ("second_order",)},
)
