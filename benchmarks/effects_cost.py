"""What effects cost: solve time per step with all of them and with only those the scene needs, in the same run.

    python3 benchmarks/effects_cost.py [REPETITIONS]

The spin-up beam (10 elements of degree 3) takes 500 steps of 0.004 s at rest, at constant speed and in spin-up: with
effects = "auto", and with data for every effect, each so small that motion and iterations stay what they were. Both are
run turn by turn in one process, the fastest turn counts, and the ratio is what including everything costs. The counts
of integrals in residual F and tangent J show that what is off leaves nothing behind.
"""

from __future__ import annotations

import sys
from typing import Any

from rotfem import Scene, run

SPIN_UP: dict[str, Any] = {
    "structure": {
        "type": "planar_beam",
        "length": 10.0,
        "section": {"EA": 2.8e7, "GA": 1.0e7, "EI": 1.4e4, "mass_per_length": 1.2, "rotary_inertia": 6.0e-4},
    },
    "mesh": {"elements": 10, "degree": 3},
    "time": {"end": 2.0, "step": 0.004, "output_every": 500},
}
#: Motions, each as the scene needs it and with an Euler force (and base acceleration) that is there but negligible.
REST = {"type": "constant", "speed": 0.0}
SPIN = {"type": "constant", "speed": 1.0}
SPINNING_UP = {"type": "spin_up", "speed": 6.0, "duration": 15.0}
BASE = {"base_acceleration": [[0, 0.0, 0.0], [2, 1e-9, 0.0]]}


def nearly(speed: float) -> dict[str, Any]:
    """Return a motion that might change its speed, and does not."""
    return {"type": "callable", "speed": lambda t: speed, "rate": lambda t: 0.0, "angle": lambda t: speed * t}


RELEASED = {"initial.tip_displacement": 0.1}
CASES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "at rest": ({"motion": REST, **RELEASED}, {"motion": nearly(0.0) | BASE, **RELEASED}),
    "constant spin": ({"motion": SPIN}, {"motion": nearly(1.0) | BASE}),
    "spin-up": ({"motion": SPINNING_UP}, {"motion": SPINNING_UP | BASE}),
}
#: Data for the other effects.
EVERYTHING: dict[str, Any] = {
    "structure.tip_mass": 1e-9,
    "structure.tip_inertia": 1e-12,
    "structure.damping.kelvin_voigt": 1e-12,
    "structure.damping.rayleigh": [1e-12, 0.0],
    "loads.gravity": [0.0, -1e-9],
}


def measure(changes: dict[str, Any], theory: str) -> dict[str, Any]:
    """Return the summary of one run, with the time for assembly and solution per step in ms."""
    scene = Scene.from_dict({**SPIN_UP, "motion": SPIN}).replace({**changes, "model.theory": theory})
    summary = run(scene).summary
    summary["ms"] = 1e3 * (summary["timings"]["assemble"] + summary["timings"]["solve"]) / summary["steps"]
    return summary


def main(repetitions: int = 5) -> None:
    """Print a table of effects, integrals, iterations and time per step, and the ratio of all to needed."""
    print(f"{'theory':18} {'scene':14} {'effects':>7} {'F':>3} {'J':>3} {'iterations':>10} {'ms/step':>8} {'ratio':>6}")
    for theory in ("reissner", "consistent_linear"):
        for name, (needed, everything) in CASES.items():
            both = [needed, everything | EVERYTHING]
            turns = [[measure(changes, theory) for changes in both] for _ in range(repetitions)]
            best = [min(column, key=lambda s: s["ms"]) for column in zip(*turns, strict=True)]
            for s in best:
                print(
                    f"{theory:18} {name:14} {len(s['effects']):7} {s['integrals']['F']:3} {s['integrals']['J']:3} "
                    f"{s['newton_iterations']:10} {s['ms']:8.4f} {s['ms'] / best[0]['ms']:6.2f}"
                )


if __name__ == "__main__":
    main(*(int(a) for a in sys.argv[1:]))
