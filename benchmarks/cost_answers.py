"""What `rotfem cost --quick` answers to scenes of different character, and whether its promises hold.

    ./with-fenicsx python3 benchmarks/cost_answers.py [--scenes NAME …] [--budget 60s]

Each scene is studied once. The recommended setting is then run again. Its output is compared with that of a setting
that took no part in the study: half the steps and twice the elements of the finest one (a degree more of a mesh file).

Columns: accuracy; error promised, what is uncertain of it, and error found again; CPU time (s, with set-up) promised
and found again; CPU time of the study, and its settings. A promise is kept where the error is within the accuracy, and
within 1.5 times the promised one, or what is uncertain of it if that is more, and where the time is within twice.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

from mpi4py import MPI

import rotfem
from rotfem.commands.cost.bench import Bench
from rotfem.commands.cost.result import CostResult
from rotfem.refinement.distance import distance, distance_each
from rotfem.refinement.refine import HIGHEST, Clock, Setting, grown
from rotfem.scene import Scene, load_scene

ROOT = Path(__file__).resolve().parents[1]

ALUMINIUM = {"E": 70e9, "nu": 0.3, "rho": 2700.0}
BLADE = {"EA": 4e7, "GA2": 1.2e7, "GA3": 1.2e7, "GJ": 2e4, "EI2": 3e4, "EI3": 1.1e5, "mass_per_length": 2.1}
THIN = {"EA": 1.4e7, "GA": 5.0e6, "EI": 6.0e3, "mass_per_length": 0.8, "rotary_inertia": 4.0e-4}
PLATE = {"type": "plate", "length": 0.8, "width": 0.4, "thickness": 0.008} | ALUMINIUM

#: Name ↦ (scene, accuracy asked for, output or None for the scene's own).
SCENES: dict[str, tuple[Any, float, str | None]] = {
    "planar, kicked": (
        {
            "structure": {"type": "planar_beam", "length": 6.0, "hub_radius": 0.2, "section": THIN},
            "motion": {"type": "constant", "speed": 8.0},
            "loads": {"tip_force": [[0, 0, 0], [0.2, 0, 15.0], [0.4, 0, 0]]},
            "mesh": {"elements": 8},
            "time": {"end": 3.0, "step": 0.005},
        },
        1e-3,
        None,
    ),
    "planar, braked": (
        {
            "structure": {"type": "planar_beam", "length": 4.0, "section": THIN, "tip_mass": 0.4},
            "motion": {"type": "table", "table": [[0.0, 6.0], [0.5, 6.0], [2.0, 0.0], [3.0, 0.0]]},
            "time": {"end": 3.0, "tolerance": 1e-3},
        },
        1e-3,
        None,
    ),
    "planar, rough": (
        {
            "structure": {"type": "planar_beam", "length": 10.0, "section": THIN},
            "motion": {"type": "spin_up", "speed": 4.0, "duration": 10.0},
            "time": {"end": 12.0, "step": 0.01},
        },
        3e-2,
        None,
    ),
    "spatial, gravity": (
        {
            "structure": {"type": "spatial_beam", "length": 8.0, "hub_radius": 0.4, "section": BLADE},
            "motion": {"type": "constant", "speed": 6.0, "axis": [0, 1, 0]},
            "loads": {"gravity": [0.0, 0.0, -9.81]},
            "mesh": {"elements": 6},
            "time": {"end": 1.5, "step": 0.01},
        },
        1e-3,
        None,
    ),
    "spatial, spun up": (
        {
            "structure": {"type": "spatial_beam", "length": 8.0, "section": BLADE, "precone": 0.05},
            "motion": {"type": "spin_up", "speed": 7.0, "duration": 2.0},
            "mesh": {"elements": 6},
            "time": {"end": 2.5, "step": 0.01},
        },
        1e-3,
        None,
    ),
    "plate, pressed": (
        {
            "structure": PLATE | {"hub_radius": 0.1},
            "motion": {"type": "constant", "speed": 30.0, "axis": [0, 1, 0]},
            "loads": {"pressure": [[0.0, 0.0], [0.05, 40.0], [0.1, 0.0]]},
            "mesh": {"elements": [6, 3]},
            "time": {"end": 0.15, "step": 0.001},
        },
        1e-2,
        None,
    ),
    "free hub": (
        {
            "structure": {"type": "planar_beam", "length": 5.0, "hub_radius": 0.3, "section": THIN},
            "motion": {"type": "torque", "hub_inertia": 40.0, "pulses": [[0.0, 0.5, 60.0], [1.0, 1.5, -60.0]]},
            "mesh": {"elements": 6},
            "time": {"end": 2.0, "step": 0.005},
        },
        1e-3,
        None,
    ),
    "inertial frame": (
        {
            "structure": {"type": "planar_beam", "length": 5.0, "section": THIN},
            "motion": {"type": "spin_up", "speed": 5.0, "duration": 2.0},
            "model": {"frame": "inertial"},
            "mesh": {"elements": 6},
            "time": {"end": 2.5, "step": 0.005},
        },
        1e-3,
        None,
    ),
    "damped": (
        {
            "structure": {"type": "planar_beam", "length": 6.0, "section": THIN, "damping": {"modal": 0.02}},
            "motion": {"type": "spin_up", "speed": 10.0, "duration": 1.0},
            "time": {"end": 2.0, "step": 0.004},
        },
        1e-4,
        None,
    ),
    "steady, loaded": (
        {
            "structure": {"type": "spatial_beam", "length": 8.0, "section": BLADE, "pretwist": 0.3},
            "motion": {"type": "constant", "speed": 9.0},
            "loads": {"distributed": [0.0, 5.0, 30.0]},
            "mesh": {"elements": 8},
        },
        1e-5,
        "tip",
    ),
    "steady plate": (
        {
            "structure": PLATE,
            "motion": {"type": "constant", "speed": 20.0, "axis": [0, 1, 0]},
            "loads": {"pressure": 60.0},
            "mesh": {"elements": [8, 4]},
        },
        1e-3,
        "tip",
    ),
    "modes of a blade": (
        {
            "structure": {"type": "spatial_beam", "length": 8.0, "section": BLADE, "pretwist": 0.5},
            "motion": {"type": "constant", "speed": 9.0},
            "modes": {"count": 5},
        },
        1e-5,
        None,
    ),
    "Campbell, planar": (
        {
            "structure": {"type": "planar_beam", "length": 6.0, "section": THIN},
            "motion": {"type": "constant", "speed": 15.0},
            "modes": {"count": 4},
        },
        1e-4,
        "campbell",
    ),
    "modes of a plate": (ROOT / "tests" / "scenes" / "plate_modes.toml", 1e-3, None),
}


def outsider(result: CostResult) -> Setting:
    """Return a setting finer than what the study computed, of the theory that it holds for the truth."""
    finest = result.references[result.summary["truth"]].setting
    if finest.elements is None:
        finer = replace(finest, degree=min(finest.degree + 1, HIGHEST))
    else:
        finer = replace(finest, elements=grown(finest.elements, 2.0))
    return finer if finer.tolerance is None else replace(finer, tolerance=finer.tolerance / 16.0)


def again(scene: Scene, result: CostResult, row: dict[str, Any]) -> tuple[float, float]:
    """Return error and CPU time (s) of the recommended setting, computed anew."""
    clock = Clock(None, MPI.COMM_WORLD)
    bench = Bench(scene.replace({"output.error": False}), result.summary["output"], MPI.COMM_WORLD)
    anew, truth = (bench.measure(s, n, None, clock) for s, n in ((Setting.of(row), 2), (outsider(result), 1)))
    if anew.values is None or truth.values is None:
        raise SystemExit(f"{scene.name}: {anew.reason}{truth.reason}")
    apart = distance if result.summary["output"] == "tip" else distance_each
    return apart(truth.values, anew.values), anew.cost


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=list(SCENES))
    parser.add_argument("--budget", default="60s")
    arguments = parser.parse_args()
    print("scene               asked  promised ± known   again   CPU (s)  again | study (s)  settings")
    for name in arguments.scenes:
        source, accuracy, output = SCENES[name]
        scene = load_scene(source) if isinstance(source, Path) else Scene.from_dict(source, name)
        clock = process_time()
        try:
            result = rotfem.cost(scene, quick=True, accuracy=accuracy, output=output, budget=arguments.budget)
        except rotfem.ComputationError as error:
            print(f"{name:<18} {accuracy:>6.0e}  failed: {error}", flush=True)
            continue
        spent, s = process_time() - clock, result.summary
        row = s["recommended"]
        if row is None:
            print(f"{name:<18} {accuracy:>6.0e}  none: {s['missing']} | {spent:>6.1f}", flush=True)
            continue
        error, cost = again(scene, result, row)
        promised, known = s["promise"]["error"], s["uncertainty"]
        kept = error <= 1.5 * max(promised, known) and error <= accuracy and 0.5 <= cost / row["cost"] <= 2.0
        print(
            f"{name:<18} {accuracy:>6.0e}  {promised:.1e} ± {known:.0e} {error:>8.1e} {row['cost']:>9.3f} {cost:>7.3f} "
            f"| {spent:>6.1f} {s['settings']:>4} {'kept' if kept else 'NOT KEPT'}: {Setting.of(row).words()}",
            flush=True,
        )


if __name__ == "__main__":
    main()
