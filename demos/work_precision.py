"""What accuracy costs: the spin-up down the ladder of theories and schemes.

Each point is one way to compute the scene of spin_up.toml: its error, relative to the largest displacement of the tip,
against the CPU time it takes. Errors are measured against the last rung of the exact theory. What a theory itself
misses is a floor that no rung gets under: 3 % for the consistent linear theory, most of it the shortening by bending,
which it does not have.

Without a figure only two theories are computed, in the first eight seconds. The picture in docs/commands.md is this
demo's, saved with --figure docs/figures/work_precision.png.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from _demo import FIRST_RANK, command_line, report, save, say

import rotfem

SCENE = Path(__file__).with_name("spin_up.toml")
REFERENCE = 0.032757  # |Δu|/|u| of the consistent linear theory at 7 s (Legendre–Galerkin histories of both)
FEW: dict[str, Any] = {"theories": ["consistent_linear", "reissner"], "schemes": ["esdirk4"], "accuracy": 1e-3}
MANY = FEW | {
    "theories": ["consistent_linear", "second_order", "reissner"],
    "schemes": ["esdirk4", "generalised_alpha"],
}
MANY |= {"accuracy": 1e-4}


def main(figure: Path | None = None) -> float:
    """Return the error of the consistent linear theory."""
    scene = rotfem.load_scene(SCENE)
    if figure is None:
        scene = scene.replace({"time.end": 8.0})
    result = rotfem.cost(scene, **(FEW if figure is None else MANY))
    for theory, floor in result.summary["model_errors"].items():
        say(f"{theory:18s} least error {100 * floor:.4f} %")
    for accuracy in (1e-2, 1e-3, 1e-4):
        if (row := result.recommend(accuracy)) is not None:
            say(f"for {accuracy:g}: {row['words']}, {row['cost']:.3f} s")
    error = float(result.summary["model_errors"]["consistent_linear"])
    report("error of the consistent linear theory", error, REFERENCE, "(–)")
    if figure is not None and FIRST_RANK:
        save(result.plot(), figure)
    return error


if __name__ == "__main__":
    command_line(main)
