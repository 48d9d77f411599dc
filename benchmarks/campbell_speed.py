"""What a Campbell diagram costs: 50 speeds × 6 modes, by theory and mesh, with the error of its last speed.

    python3 benchmarks/campbell_speed.py [REPETITIONS]

A beam of slenderness 30 on 0 … 12 (unit √(EI/A_rho L⁴)). `reissner` and `von_karman` find the steady state at every
speed and assemble the tangents there, the linear theories only weigh operators assembled once. All cases are run turn
by turn in one process after one that compiles; the fastest turn counts. "total" is everything but compilation, with
tracking, self-checks and the rows of the result; "ratio" is to the first line of the same mesh. The error is the
largest of the first four frequencies at the last speed against a Legendre–Galerkin method.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from rotfem import campbell
from rotfem.results import CampbellResult

#: First four frequencies at the last speed, with Coriolis force; no finite elements, converged to the digits shown.
REFERENCE = {
    "consistent_linear": (4.44710181059, 33.2255568524, 51.6684967211, 69.5287071412),
    "von_karman_linear": (4.52311122562, 33.4282513391, 51.6738952432, 70.4119283573),
    "von_karman": (4.578521022, 33.6219646786, 51.6714211, 70.5367235909),
    "reissner": (4.30814567538, 32.9924152597, 51.6493927524, 68.3937383009),
}
MESHES = ((16, 3), (32, 3))
SPEEDS = [float(s) for s in np.linspace(0.0, 12.0, 50)]


def scene(theory: str, elements: int, degree: int) -> dict[str, Any]:
    """Return the beam with one theory and mesh."""
    section = {"EA": 900.0, "GA": 900.0 / 3.059, "EI": 1.0, "mass_per_length": 1.0, "rotary_inertia": 1 / 900.0}
    return {
        "structure": {"type": "planar_beam", "length": 1.0, "section": section},
        "motion": {"type": "constant", "speed": 0.0},
        "model": {"theory": theory},
        "mesh": {"elements": elements, "degree": degree},
        "modes": {"count": 6},
    }


def seconds(result: CampbellResult) -> dict[str, float]:
    """Return times without compilation: total, and its parts for equilibrium, assembly and eigenproblems (s)."""
    t = result.summary["timings"]
    return {"total": t["total"] - t["compile"]} | {k: t[k] for k in ("equilibrium", "assemble", "eigen")}


def error(result: CampbellResult, theory: str) -> float:
    """Return the largest relative error of the first four frequencies at the last speed."""
    last = sorted(row["frequency"] for row in result.rows if row["speed"] == SPEEDS[-1])[:4]
    return float(np.max(np.abs(np.array(last) / REFERENCE[theory] - 1)))


def main(repetitions: int) -> None:
    """Print one line a mesh and theory."""
    print(
        f"{'theory':<18}{'unknowns':>9}{'solved':>8}{'total s':>9}{'balance':>9}{'assemble':>9}{'eigen':>8}"
        f"{'ms/speed':>10}{'ratio':>7}{'error':>9}"
    )
    for elements, degree in MESHES:
        cases = {theory: scene(theory, elements, degree) for theory in REFERENCE}
        for tables in cases.values():
            campbell(tables, SPEEDS[:2], orders=0)
        best: dict[str, tuple[dict[str, float], CampbellResult]] = {}
        for _ in range(repetitions):
            for theory, tables in cases.items():
                result = campbell(tables, SPEEDS, orders=0)
                time = seconds(result)
                if theory not in best or time["total"] < best[theory][0]["total"]:
                    best[theory] = time, result
        first = next(iter(best.values()))[0]["total"]
        for theory, (time, result) in best.items():
            s = result.summary
            print(
                f"{theory:<18}{s['dofs']:>9}{s['speeds_solved']:>8}{time['total']:>9.3f}{time['equilibrium']:>9.3f}"
                f"{time['assemble']:>9.3f}{time['eigen']:>8.3f}{1e3 * time['total'] / s['speeds_solved']:>10.2f}"
                f"{time['total'] / first:>7.2f}{error(result, theory):>9.1e}"
            )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
