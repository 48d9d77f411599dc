"""Tip releases of slender beams: which run at the default settings, halved steps, Newton iterations a step.

    python3 benchmarks/tip_releases.py [THEORY …]

A planar beam (L = 10 m, EI = 1.4e4 N·m², 1.2 kg/m, 10 elements of degree 3) is released from the static shape of a tip
displacement of 0.01 … 0.5 L and followed for 2 s, 1.2 periods of its first mode, in steps of 0.02 s. Its slenderness
L/r, r² = EI/EA, is that of its axial and shear stiffness. "stiff" has EI and so the period of the slenderness 447 in
all cases, "soft" has EA of it, so that the step resolves ever less or more of the first period. Energy is the change of
the energy from the first row to the last, relative to the energy at the start: conserved but for the scheme's damping,
so what grows or vanishes has not been computed.
"""

from __future__ import annotations

import sys
from typing import Any

from rotfem import ComputationError, run

LENGTH, EA, EI, MASS, SHEAR = 10.0, 2.8e7, 1.4e4, 1.2, 1 / 2.8
DISPLACEMENTS = (0.01, 0.05, 0.1, 0.2, 0.5)
SLENDERNESS = (1e2, 1e3, 1e4, 1e5)
FAMILIES = ("stiff", "soft")


def scene(theory: str, family: str, slenderness: float, displacement: float) -> dict[str, Any]:
    """Return the release of a beam of one slenderness from a tip displacement (in L)."""
    squared = (LENGTH / slenderness) ** 2
    axial, bending = (EI / squared, EI) if family == "stiff" else (EA, EA * squared)
    section = {"EA": axial, "GA": axial * SHEAR, "EI": bending, "mass_per_length": MASS}
    return {
        "structure": {
            "type": "planar_beam",
            "length": LENGTH,
            "section": section | {"rotary_inertia": MASS * squared},
        },
        "motion": {"type": "constant", "speed": 0.0},
        "model": {"theory": theory},
        "mesh": {"elements": 10, "degree": 3},
        "initial": {"tip_displacement": displacement * LENGTH},
        "time": {"end": 2.0, "step": 0.02},
    }


def release(theory: str, family: str, slenderness: float, displacement: float) -> dict[str, Any]:
    """Return what became of one release: whether it ran, steps, halved steps, iterations, change of the energy."""
    try:
        result = run(scene(theory, family, slenderness, displacement))
        why = ""
    except ComputationError as error:
        result, why = vars(error)["result"], str(error)
    halved = [w for w in result.summary["warnings"] if "halved" in w]
    energy = result.history["jacobi"]
    return {
        "ran": not why,
        "why": why,
        "steps": result.summary["steps"],
        "halved": int(halved[0].split()[0]) if halved else 0,
        "iterations": result.summary["newton_iterations"],
        "energy": float(energy[-1] / energy[0] - 1) if len(energy) else float("nan"),
        "seconds": sum(result.summary["timings"].get(part, 0.0) for part in ("assemble", "solve")),
    }


def main(theories: list[str]) -> None:
    """Print one line a release and one a family and theory."""
    print(
        f"{'theory':<14}{'family':<7}{'L/r':>7}{'u2/L':>6}{'ran':>5}{'halved':>8}{'iter/step':>11}{'energy':>10}{'s':>7}"
    )
    for theory in theories:
        for family in FAMILIES:
            rows = []
            for slenderness in SLENDERNESS:
                for displacement in DISPLACEMENTS:
                    row = release(theory, family, slenderness, displacement)
                    rows.append(row)
                    per_step = row["iterations"] / max(row["steps"], 1)
                    ran = "yes" if row["ran"] else "no"
                    print(
                        f"{theory:<14}{family:<7}{slenderness:>7.0e}{displacement:>6}{ran:>5}{row['halved']:>8}"
                        f"{per_step:>11.2f}{row['energy']:>10.1e}{row['seconds']:>7.2f}  {row['why']}",
                        flush=True,
                    )
            done = [row for row in rows if row["ran"]]
            steps, iterations, halved = (sum(row[key] for row in done) for key in ("steps", "iterations", "halved"))
            print(
                f"{theory:<14}{family:<7}{len(done)} of {len(rows)} ran, {halved} halved steps, "
                f"{iterations / max(steps, 1):.2f} iterations a step",
                flush=True,
            )


if __name__ == "__main__":
    main(sys.argv[1:] or ["reissner", "second_order", "von_karman"])
