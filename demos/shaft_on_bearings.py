"""A shaft with two disks on two bearings: whirl, and the speeds at which an unbalance is dangerous.

A shaft that spins about its own axis whirls forward, with its spin, or backward. The disks' gyroscopic moments raise
the frequency of the one and lower that of the other. Seen from the fixed frame a forward whirl of the frequency Ω is
what an unbalance excites: in the rotating frame it has the frequency zero there, a backward one 2Ω.

The drive holds the root along and about the axis alone, the bearings hold the rest. The number is the first forward
critical speed; the reference is that of ROSS 2.3.0 with 48 elements, Timoshenko beams as here.
"""

from __future__ import annotations

from pathlib import Path

from _demo import FIRST_RANK, command_line, report, save, say

import rotfem

SCENE = Path(__file__).with_name("shaft_on_bearings.toml")
REFERENCE = 96.49728647  # rad/s


def main(figure: Path | None = None) -> float:
    """Return the lowest speed (rad/s) at which the shaft whirls forward as fast as it spins."""
    result = rotfem.campbell(SCENE, "0:120:4")
    synchronous = [c for c in result.critical_speeds if c.kind != "per_rev"]
    for c in synchronous:
        say(f"{c.kind:8s} whirl, {c.label}: {c.speed:.4f} rad/s")
    first = next(c.speed for c in synchronous if c.kind == "forward")
    report("forward critical speed", first, REFERENCE, "rad/s")
    if figure is not None and FIRST_RANK:
        save(result.plot(), figure)
    return first


if __name__ == "__main__":
    command_line(main)
