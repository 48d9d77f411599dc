"""Adaptive steps: error against tolerance, steps against the fixed step that is as good, for motions of every kind.

    python3 benchmarks/adaptive_table.py [-m MOTION …] [-s SCHEME …] [-t TOLERANCE …]

Error is the largest of the tip's u2 over all rows, relative to its largest; the reference is Radau's method in fixed
steps, whose own error is that of halving them. "taken back" counts all steps that are no part of the history, those by
which the size of a motion is found too. "× fixed" is the number of steps, those taken back among them, over the number
of fixed steps of the same scheme with the same error, by its order from a run with a third of the steps. CPU seconds
are those of the whole run, set-up and all.
"""

from __future__ import annotations

import argparse
from time import process_time
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

import rotfem
from rotfem.registry import schemes

#: Kane's beam (Kane, Ryan & Banerjee 1987).
BEAM: dict[str, Any] = {
    "type": "planar_beam",
    "length": 10.0,
    "section": {"EA": 2.8e7, "GA": 1.0e7, "EI": 1.4e4, "mass_per_length": 1.2, "rotary_inertia": 6.0e-4},
}
STILL = {"type": "constant", "speed": 0.0}
LATE = [[0.0, 0.0, 0.0], [61.0, 0.0, 0.0], [61.001, 0.0, 5.0], [62.0, 0.0, 5.0], [62.001, 0.0, 0.0]]
STOP = [[0.0, 0.2], [1.0033, 0.2], [1.0043, 0.0]]
BOX = [[0.0, 0.0, 0.0], [0.999, 0.0, 0.0], [0.99901, 0.0, 500.0], [1.001, 0.0, 500.0], [1.00101, 0.0, 0.0]]
WAVES = [[t, 30.0 * np.sin(3.0 * t) * np.sin(0.4 * t)] for t in np.linspace(0.0, 8.0, 41)]

#: Motion ↦ (tables, end in s, fixed steps of the reference).
MOTIONS: dict[str, tuple[dict[str, Any], float, int]] = {
    "spin-up": ({"motion": {"type": "spin_up", "speed": 6.0, "duration": 15.0}}, 20.0, 4000),
    "torque pulse": (
        {"motion": {"type": "torque", "hub_inertia": 100.0, "pulses": [[0.5, 1.5, 100.0]]}},
        4.0,
        8000,
    ),
    "tip release": ({"motion": STILL, "initial": {"tip_displacement": 1.0}}, 5.0, 40_000),
    "late pulse": ({"motion": STILL, "loads": {"tip_force": {"table": LATE}}}, 100.0, 40_000),
    "sudden stop": ({"motion": {"type": "table", "table": STOP, "interpolation": "linear"}}, 3.0, 24_000),
    "box of 2 ms": ({"motion": STILL, "loads": {"tip_force": {"table": BOX}}}, 2.0, 20_000),
    "moment in waves": ({"motion": STILL, "loads": {"tip_moment": {"table": WAVES}}}, 8.0, 8000),
    "up and down": (
        {"motion": {"type": "table", "table": [[0.0, 0.0], [2.0, 4.0], [3.0, 4.0], [6.0, 1.0]]}},
        8.0,
        8000,
    ),
    "hub there and back": (
        {"motion": {"type": "torque", "hub_inertia": 20.0, "pulses": [[0.2, 0.7, 40.0], [1.1, 1.6, -40.0]]}},
        3.0,
        8000,
    ),
}


def moved(name: str, **time: Any) -> Any:
    """Return the result of a motion, with its CPU time (s) in the summary."""
    tables, end, _ = MOTIONS[name]
    started = process_time()
    result = rotfem.run({"structure": BEAM, "mesh": {"elements": 4}, "time": {"end": end, **time}} | tables)
    result.summary["cpu"] = process_time() - started
    return result


def reference(name: str) -> tuple[CubicSpline, float, float]:
    """Return u2 over time, its largest value (m), and the error of that (relative)."""
    _, end, number = MOTIONS[name]
    coarse, fine = (moved(name, step=end / n, scheme="radau5") for n in (number // 2, number))
    spline = CubicSpline(fine.history["t"], fine.history["tip_u2"])
    size = float(np.abs(fine.history["tip_u2"]).max())
    return spline, size, off(coarse, spline, size)


def off(result: Any, spline: CubicSpline, size: float) -> float:
    """Return the largest error of u2 over the rows of a result, relative."""
    return float(np.abs(result.history["tip_u2"] - spline(result.history["t"])).max() / size)


def row(name: str, scheme: str, tolerance: float, exact: tuple[CubicSpline, float, float]) -> str:
    """Return a line of the table."""
    try:
        result = moved(name, tolerance=tolerance, scheme=scheme)
    except rotfem.ComputationError as error:
        return f"| {name} | {scheme} | {tolerance:.0e} | {error} | | | | |"
    error, steps = off(result, *exact[:2]), result.summary["steps"]
    back = result.summary.get("rejected_steps", 0)
    fixed = max((steps + back) // 3, 5)
    try:
        worse = off(moved(name, step=MOTIONS[name][1] / fixed, scheme=scheme), *exact[:2]) / error
        times = f"{(steps + back) / (fixed * worse ** (1 / schemes[scheme].order)):.1f}"
    except rotfem.ComputationError:
        times = "none runs"
    cells = [
        name,
        scheme,
        f"{tolerance:.0e}",
        f"{error / tolerance:.2g}",
        steps,
        back,
        times,
        f"{result.summary['cpu']:.1f}",
    ]
    return f"| {' | '.join(map(str, cells))} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-m", "--motions", nargs="+", default=list(MOTIONS))
    parser.add_argument("-s", "--schemes", nargs="+", default=["generalised_alpha", "esdirk4", "radau5"])
    parser.add_argument("-t", "--tolerances", nargs="+", type=float, default=[1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
    given = parser.parse_args()
    print("| motion | scheme | tolerance | error/tolerance | steps | taken back | × fixed | CPU s |")
    print("|---|---|---|---|---|---|---|---|")
    for name in given.motions:
        exact = reference(name)
        for scheme in given.schemes:
            for tolerance in given.tolerances:
                print(row(name, scheme, tolerance, exact), flush=True)
        print(f"| {name} | reference | | {exact[2]:.1e} (relative) | {MOTIONS[name][2]} | | | |", flush=True)


if __name__ == "__main__":
    main()
