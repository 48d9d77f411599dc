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
from rotfem.pencil import Pencil

SCENE = Path(__file__).with_name("iccia_hub_beam.toml")
REFERENCE = 100 * (8.079190 / 6.417749 - 1)  # %; Legendre–Ritz model of the paper's beam, tests/verification/test_errata.py


def pencil(theory: str, radius: float, speed: float) -> Pencil:
    """Return M, C and K of small motion at a hub radius (m) and a speed (rad/s)."""
    changes = {
        "model.theory": theory,
        "structure.hub_radius": radius,
        "motion": {"type": "constant", "speed": speed},
        "initial": {},
        "time": None,
    }
    return rotfem.modes(rotfem.load_scene(SCENE).replace(changes)).spinning.pencil


def first(p: Pencil) -> float:
    """Return the lowest frequency (rad/s)."""
    return float(p.solve(4).values[0].imag)


def as_printed(radius: float, speed: float) -> Pencil:
    """Return the pencil with eq. (16) as it is printed."""
    p = pencil("consistent_linear", radius, speed)
    K = p.K.copy()
    K.axpy(1.0, p.K)
    K.axpy(-1.0, pencil("consistent_linear", 0.0, speed).K)
    return Pencil(p.M, p.C, K)


def main(figure: Path | None = None) -> float:
    """Return by how much (%) the printed model overestimates the first frequency at R = 2 m, 8 rad/s."""
    say("   R, m   speed, rad/s   zero-order   one-order   as printed   exact")
    for radius, speed in ((0.0, 2.0), (1.0, 2.0), (0.0, 4.0), (1.0, 4.0), (2.0, 8.0)):
        right = first(pencil("consistent_linear", radius, speed))
        printed, exact = first(as_printed(radius, speed)), first(pencil("reissner", radius, speed))
        zero = first(pencil("linear", radius, speed))
        softened = f"{zero:10.4f}" if zero > 0.0 else "  unstable"
        say(f"{radius:7.0f} {speed:14.0f}   {softened} {right:11.4f} {printed:12.4f} {exact:7.4f}")
    excess = 100 * (printed / right - 1)
    report(f"excess at R = {radius:g} m, {speed:g} rad/s", excess, REFERENCE, "%")
    return excess


if __name__ == "__main__":
    command_line(main)
