"""What cannot meet: choices that are refused together, with what is said and where that is documented.

Rows have none of these, so that no combination counts that was not computed; each is met by a scene of its own, which
must be refused in these words.
"""

from __future__ import annotations

from dataclasses import dataclass

from tests.pairs.covering import Levels
from tests.pairs.scenes import HISTORIES, LEVELS, LINEAR


@dataclass(frozen=True)
class Refusal:
    """One documented refusal.

    Attributes:
        choices: factor ↦ levels that are refused when all factors have one of them.
        says: regular expression of the error.
        page: file that documents it, from the repository's folder.
        text: words of that page.
    """

    choices: Levels
    says: str
    page: str
    text: str


def but(factor: str, *levels: str) -> tuple[str, ...]:
    """Return all levels of a factor but these."""
    return tuple(level for level in LEVELS[factor] if level not in levels)


SCENE = "docs/scene.md"
PLATES = ("plate", "mesh")
FREE = ("torque", "controller")
IN_PLANE = ("gravity", "tip", "span", "harmonic")
#: What a hinge without a spring cannot meet at rest: loads that turn it, in theories in which it does not go to hang.
#: Modes of a free hub, and the first speed of a Campbell diagram, are those at rest; a response is about no harmonic.
AT_REST: tuple[Levels, ...] = tuple(
    {**loaded, **asked}
    for loaded in (
        {"theory": ("second_order",), "structure": ("planar",), "loads": IN_PLANE},
        {"theory": ("second_order",), "structure": ("spatial",), "loads": ("gravity", "tip")},
        {"theory": ("reissner",), "structure": ("planar",), "loads": ("follower",)},
    )
    for asked in (
        {"command": ("run",), "time": ("steady",), "motion": ("rest",)},
        {"command": ("modes",), "motion": ("rest", *FREE)},
        {"command": ("campbell",)},
    )
) + tuple(
    {"theory": LINEAR, "command": ("run",), "time": ("steady",), "motion": ("rest",), **loaded}
    for loaded in (
        {"structure": ("planar",), "loads": (*IN_PLANE, "follower")},
        {"structure": ("spatial",), "loads": ("tip", "weight")},
    )
)
REFUSALS = (
    Refusal(
        {"structure": PLATES, "root": but("root", "clamped")},
        r"structure\.root",
        SCENE,
        "A beam may have hinges and springs at its root.",
    ),
    Refusal(
        {"structure": ("planar",), "root": ("pitch",)},
        r"structure\.root\.pitch",
        SCENE,
        "`pitch` of a spatial beam turns the whole blade",
    ),
    Refusal(
        {"structure": ("planar",), "loads": ("weight",)},
        r"loads\.gravity.*third component must be 0",
        SCENE,
        "A planar beam moves in the plane (1, 2) of the frame",
    ),
    Refusal(
        {"structure": ("planar", "spatial"), "loads": ("pressure",)},
        r"loads\.pressure",
        SCENE,
        "A dead pressure on a plate is along direction 3",
    ),
    Refusal(
        {"frame": ("inertial",), "structure": but("structure", "planar")},
        r'model\.frame.*needs structure\.type = "planar_beam"',
        SCENE,
        "That frame is for a planar beam with an exact theory",
    ),
    Refusal(
        {"frame": ("inertial",), "theory": but("theory", "reissner")},
        r"model\.frame.*model\.theory = .*reissner",
        SCENE,
        "That frame is for a planar beam with an exact theory",
    ),
    Refusal(
        {"frame": ("inertial",), "motion": FREE},
        r'model\.frame.*is not available with motion\.type = "torque"',
        SCENE,
        "a planar beam with an exact theory and a prescribed speed",
    ),
    Refusal(
        {"frame": ("inertial",), "damping": ("modal",)},
        r"structure\.damping\.modal",
        SCENE,
        'small motions, and needs `frame = "rotating"`',
    ),
    Refusal(
        {"root": ("pitch",), "motion": FREE},
        r"structure\.root\.pitch.*needs a speed that is prescribed",
        SCENE,
        "A free hub needs a constant pitch.",
    ),
    Refusal(
        {"time": ("accuracy",), "output": ("error off",)},
        r"output\.error.*cannot be combined with accuracy",
        SCENE,
        "an `accuracy` needs it",
    ),
    Refusal(
        {"command": ("run",), "time": ("steady",), "motion": but("motion", "rest", "constant")},
        r"time: missing; with motion\.type",
        SCENE,
        "Without `[time]`, a scene with constant motion asks for the steady state.",
    ),
    Refusal(
        {"command": ("run",), "time": ("steady",), "checkpoint": ("resumed",)},
        r"--(checkpoint|resume): needs a scene with \[time\]",
        "docs/results.md",
        "A steady state has no steps, so no checkpoints.",
    ),
    Refusal(
        {"command": ("run",), "time": ("accuracy",), "checkpoint": ("resumed",)},
        r"--(checkpoint|resume): cannot be combined with accuracy",
        "docs/results.md",
        "A run to an `accuracy` takes several answers, and has none either.",
    ),
    Refusal(
        {"command": ("run",), "time": ("steady",), "loads": ("gravity",), "motion": but("motion", "rest")},
        r"loads\.gravity.*gravity across the spin axis turns",
        "docs/theory.md",
        "So a spinning beam under gravity across the axis has no steady state in the frame",
    ),
    Refusal(
        {"command": ("response",), "loads": but("loads", "harmonic")},
        r"loads: a frequency response needs a harmonic load",
        SCENE,
        "it needs a `harmonic` load",
    ),
    *(
        Refusal(
            {"root": ("hinge",), **choices},
            r"nothing holds the root's hinge \(lag\): no steady state at 0 rad/s",
            SCENE,
            "Without an equilibrium (a load on a free hinge at rest)",
        )
        for choices in AT_REST
    ),
)

#: What leaves no unknown out: no row of these has any that symmetry keeps at zero.
ACROSS = ("weight", "span", "harmonic", "pressure")
WHOLE: tuple[Levels, ...] = tuple(
    {"unknowns": ("left out",), **choices}
    for choices in (
        {"structure": ("planar",)},
        {"damping": ("modal",)},
        {"root": ("pitch",)},
        {"time": but("time", *HISTORIES)},
        {"loads": ("follower", "function")},
        {"structure": ("spatial",), "loads": ACROSS},
        {"structure": PLATES, "loads": ACROSS, "motion": but("motion", "rest")},
        {"structure": PLATES, "loads": ACROSS, "theory": but("theory", *LINEAR)},
    )
)
