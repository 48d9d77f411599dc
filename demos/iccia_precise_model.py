"""The "precise" model of the ICCIA paper, and how much of its stiffness is a hub counted twice.

The paper compares three models of a beam on a hub of radius R. The zero-order one lacks the stiffness that the spin
gives, the one-order one has it, and the "precise" one is found to be stiffer still when R is not zero. Its additional
stiffness for constant speed, eq. (16), is

    K₁ = θ̇² D + R θ̇² C + R θ̇² C,

where the last two terms are one and the same: the hub's part of the centrifugal force on the beam (docs/theory.md,
errata C). The stiffness is affine in R, so the model as printed can be put together from two right ones,

    K_printed = K(R) + [K(R) − K(0)],

and its frequencies compared with those of the right stiffness, and with the exact theory, linearised about the exact
steady state of the stretched beam, which owes nothing to the paper. Without a hub all agree.
"""

from __future__ import annotations

from pathlib import Path

from _demo import command_line, report, say

import rotfem
from rotfem.numerics.eigenproblem import Pencil
from rotfem.results.modes import ModesResult

SCENE = Path(__file__).with_name("iccia_hub_beam.toml")
REFERENCE = 100 * (8.079190 / 6.417749 - 1)  # %; Legendre–Ritz, Euler–Bernoulli (docs/theory.md, errata)


def modes(theory: str, radius: float, speed: float) -> ModesResult:
    """Return the modes at a hub radius (m) and a speed (rad/s)."""
    changes = {
        "model.theory": theory,
        "structure.hub_radius": radius,
        "motion": {"type": "constant", "speed": speed},
        "initial": {},
        "time": None,
    }
    return rotfem.modes(rotfem.load_scene(SCENE).replace(changes))


def first(theory: str, radius: float, speed: float) -> float:
    """Return the lowest frequency (rad/s), 0 where there is growth instead."""
    return float(modes(theory, radius, speed).rows[0]["frequency"])


def first_as_printed(radius: float, speed: float) -> float:
    """Return the lowest frequency (rad/s) with eq. (16) as it is printed."""
    hub, none = (modes("consistent_linear", r, speed) for r in (radius, 0.0))
    M, C, K = (getattr(hub.spinning.pencil, name) for name in "MCK")
    printed = K.copy()
    printed.axpy(1.0, K)
    printed.axpy(-1.0, none.spinning.pencil.K)
    return float(Pencil(M, C, printed).solve(4).values[0].imag)


def main(figure: Path | None = None) -> float:
    """Return by how much (%) the printed model overestimates the first frequency at R = 2 m, 8 rad/s."""
    say("   R, m   speed, rad/s   zero-order   one-order   as printed   exact")
    for radius, speed in ((0.0, 2.0), (1.0, 2.0), (0.0, 4.0), (1.0, 4.0), (2.0, 8.0)):
        zero, right, exact = (first(theory, radius, speed) for theory in ("linear", "consistent_linear", "reissner"))
        printed = first_as_printed(radius, speed)
        softened = f"{zero:10.4f}" if zero > 0.0 else "  unstable"
        say(f"{radius:7.0f} {speed:14.0f}   {softened} {right:11.4f} {printed:12.4f} {exact:7.4f}")
    excess = 100 * (printed / right - 1)
    report(f"excess at R = {radius:g} m, {speed:g} rad/s", excess, REFERENCE, "%")
    return excess


if __name__ == "__main__":
    command_line(main)
