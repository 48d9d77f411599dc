"""What accuracy costs: the spin-up in every theory, with many meshes and steps.

Each point is one way to compute the scene of spin_up.toml: its error, relative to the largest displacement of the tip,
against the time it takes. Errors are measured against a reference that rotfem makes by refinement. Those of
generalised-α fall with the second power of the step. What a theory itself misses
is a floor that no refinement gets under: 3 % for the consistent linear theory, most of it the shortening by bending,
which it does not have. A step of half the length costs twice the time and is four times as exact, until the mesh
counts: two elements of degree 2 stop at 9e-4, two of degree 3 at 6e-5.

Without a figure only a few settings are computed, of the first eight seconds. The picture in docs/commands.md is this
demo's, saved with --figure docs/figures/work_precision.png; that takes some minutes.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from _demo import FIRST_RANK, command_line, report, save, say

import rotfem

SCENE = Path(__file__).with_name("spin_up.toml")
REFERENCE = 2.0  # order of generalised-α (Chung & Hulbert 1993)
#: What tells settings apart.
BY = ("theory", "elements", "degree", "step")
FEW: dict[str, Any] = {
    "theories": ["consistent_linear", "reissner"],
    "elements": [5],
    "degrees": [3],
    "steps": [0.04, 0.02],
}
MANY: dict[str, Any] = {"elements": [2, 5, 10], "degrees": [2, 3], "steps": [0.08, 0.04, 0.02, 0.01, 0.005, 0.0025]}


def main(figure: Path | None = None) -> float:
    """Return the order at which the time stepping is seen to converge in the exact theory."""
    scene = rotfem.load_scene(SCENE)
    if figure is None:
        scene = scene.replace({"time.end": 8.0})
    choice = FEW | {"repeat": 1} if figure is None else MANY | {"repeat": 3}
    result = rotfem.cost(scene, schemes=["generalised_alpha"], **choice)
    for theory, floor in result.summary["model_errors"].items():
        known = result.references[theory].uncertainty
        say(f"{theory:18s} error of the model {100 * floor:.4f} %, its reference known to {100 * known:.0e} %")
    for theory, reason in result.summary["reference_failures"].items():
        say(f"{theory:18s} failed: {reason.split(' (')[0]}")
    for entry in result.summary["recommendations"]:
        if entry["row"] is not None:
            say(f"for {entry['accuracy']:g}: {entry['setting']}, {entry['row']['time']:.3f} s")
    long, short = (
        next(row["error"] for row in result.rows if [row[key] for key in BY] == ["reissner", 5, 3, step])
        for step in (0.04, 0.02)
    )
    order = math.log2(long / short)
    report("order in the time step", order, REFERENCE, "(–)")
    if figure is not None and FIRST_RANK:
        from rotfem.commands.cost.result import cost_figure

        save(cost_figure(result), figure)
    return order


if __name__ == "__main__":
    command_line(main)
