"""What `rotfem cost --quick` answers to scenes of different character, and whether its promises hold.

    ./with-fenicsx python3 benchmarks/cost_answers.py [--scenes spin-up hub …] [--budget 2min] [--only-cost]

Each scene is studied once. The recommended setting is then run again, and its output compared with that of a setting
that took no part in the study: twice the elements of its finest mesh that is not much larger than the one recommended,
and half the shortest step of the scheme that was refined. Columns: accuracy, the setting, error promised (with what is
uncertain of it) and found again, CPU time (s, with set-up) promised and found again; of the references the most
unknowns, the longest time (s) and the most memory (MB); CPU time of the study, and of the scene as it is.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from time import process_time
from typing import Any

import rotfem
from rotfem.commands.cost.bench import Bench
from rotfem.commands.cost.reference import distance
from rotfem.commands.cost.result import CostResult, describe, setting_of
from rotfem.commands.cost.settings import Setting, scaled
from rotfem.scene import Scene, load_scene

ROOT = Path(__file__).resolve().parents[1]

BLADE = {"EA": 2e7, "GA2": 6e6, "GA3": 6e6, "GJ": 8e3, "EI2": 1e4, "EI3": 4e4, "mass_per_length": 1.5}
THIN = {"EA": 2.8e7, "GA": 1.0e7, "EI": 1.4e4, "mass_per_length": 1.2, "rotary_inertia": 6.0e-4}
PLATE = {"type": "plate", "length": 1.0, "width": 0.5, "thickness": 0.01, "E": 70e9, "nu": 0.3, "rho": 2700.0}

#: Name ↦ (scene, accuracy asked for, output or None for the scene's own).
SCENES: dict[str, tuple[Any, float, str | None]] = {
    "spin-up": (ROOT / "demos" / "spin_up.toml", 1e-4, None),
    "hub": (ROOT / "tests" / "scenes" / "hub_torque.toml", 1e-4, None),
    "gusts on a blade": (
        {
            "structure": {"type": "spatial_beam", "length": 10.0, "hub_radius": 0.5, "section": BLADE},
            "motion": {"type": "constant", "speed": 5.0},
            "loads": {"tip_force": [[0, 0, 0, 0], [0.5, 0, 0, 20], [1, 0, 3, 5], [2, 0, 0, 12], [3, 0, 0, 0]]},
            "mesh": {"elements": 8},
            "time": {"end": 4.0, "step": 0.01},
        },
        1e-3,
        None,
    ),
    "gravity at 1/rev": (
        {
            "structure": {"type": "planar_beam", "length": 10.0, "section": THIN, "tip_mass": 0.5},
            "motion": {"type": "constant", "speed": 3.0},
            "loads": {"gravity": [0.0, -0.5]},
            "model": {"theory": "consistent_linear"},
            "time": {"end": 20.0, "step": 0.02},
        },
        1e-3,
        None,
    ),
    "plate, spin-up": (
        {
            "structure": PLATE | {"hub_radius": 0.3},
            "motion": {"type": "spin_up", "speed": 40.0, "duration": 0.5, "axis": [0, 1, 0]},
            "model": {"theory": "consistent_linear"},
            "mesh": {"elements": [8, 4]},
            "time": {"end": 0.8, "step": 0.002},
        },
        1e-3,
        None,
    ),
    "moment pulse": (
        {
            "structure": {"type": "planar_beam", "length": 2.0, "hub_radius": 0.3, "section": THIN | {"EI": 3.0e3}},
            "motion": {"type": "table", "table": [[0.0, 0.0], [0.5, 20.0], [1.5, 20.0]]},
            "loads": {"tip_moment": [[0, 0], [0.6, 0], [0.7, 40.0], [0.8, 0]]},
            "mesh": {"elements": 8},
            "time": {"end": 1.5, "step": 0.002},
        },
        1e-3,
        None,
    ),
    "steady blade": (
        {
            "structure": {"type": "spatial_beam", "length": 10.0, "section": BLADE, "precone": 0.1},
            "motion": {"type": "constant", "speed": 8.0},
            "loads": {"distributed": [0.0, 0.0, 12.0]},
            "mesh": {"elements": 8},
        },
        1e-5,
        None,
    ),
    "modes of a plate": (ROOT / "tests" / "scenes" / "plate_modes.toml", 1e-4, None),
    "Campbell of a blade": (ROOT / "demos" / "pretwisted_blade.toml", 1e-4, "campbell"),
    "disk": (ROOT / "demos" / "disk_campbell.toml", 1e-3, "frequencies"),
}


def outsider(result: CostResult, row: dict[str, Any]) -> Setting:
    """Return a setting finer than what the study computed, of the theory that it holds for the truth."""
    rows = [r for r in result.rows if r["theory"] == result.summary["truth"] and r["status"] == "done"]
    near = [setting_of(r) for r in rows if (r["dofs"] or 0) <= 4.5 * row["dofs"]]
    finest = max(
        near, key=lambda s: (math.prod(s.elements) if isinstance(s.elements, tuple) else s.elements or 0, s.degree)
    )
    changes: dict[str, Any] = {
        "elements": scaled(finest.elements, 2.0),
        "degree": finest.degree + (finest.elements is None),
    }
    if row["scheme"] is not None:
        schemes = [s for s in map(setting_of, rows) if s.step is not None]
        order = {s: rotfem.registry.schemes[s.scheme or ""].order for s in schemes}
        best = min(schemes, key=lambda s: (-order[s], s.step or 0.0))
        changes |= {"scheme": best.scheme, "step": (best.step or 0.0) / 2, "every": 1, "tolerance": None}
    return Setting(**(vars(finest) | changes))


def again(scene: Scene, result: CostResult, row: dict[str, Any]) -> tuple[float, float]:
    """Return error and CPU time (s) of the recommended setting, computed anew."""
    bench = Bench(scene, result.summary["output"])
    anew, truth = bench.measure(setting_of(row), 3), bench.measure(outsider(result, row), 1)
    if anew.samples is None or truth.samples is None:
        raise SystemExit(f"{scene.name}: {anew.reason}{truth.reason}")
    return distance(anew.samples, truth.samples, result.summary["output"] != "tip"), anew.cost


def own_cost(result: CostResult, scene: Scene) -> float:
    """Return the CPU time (s) of the scene's own setting; nan where it was left out."""
    own = [r for r in result.rows if r["purpose"] == "grid" and r["theory"] == scene.model.theory]
    step = scene.time.step if scene.time is not None and result.summary["output"] == "tip" else None
    mesh = getattr(scene.mesh, "elements", None)
    wanted = list(mesh) if isinstance(mesh, tuple) else mesh
    found = [r["cost"] for r in own if r["step"] == step and (r["elements"] in (wanted, None))]
    return found[0] if found else math.nan


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=list(SCENES))
    parser.add_argument("--budget", default=None)
    parser.add_argument("--only-cost", action="store_true", help="nothing is computed again")
    arguments = parser.parse_args()
    print("scene                 asked  promised        again    CPU (s)   again  own | dofs  time (s)  MB | study (s)")
    for name in arguments.scenes:
        source, accuracy, output = SCENES[name]
        scene = load_scene(source) if isinstance(source, Path) else Scene.from_dict(source, name)
        clock = process_time()
        result = rotfem.cost(scene, quick=True, accuracy=accuracy, output=output, budget=arguments.budget)
        spent, s = process_time() - clock, result.summary
        row, large = s["recommended"], s["reference_largest"]
        made = f"{large['dofs']:>7} {large['time']:>6.1f} {large['memory'] / 1e6:>5.0f} | {spent:>6.1f}"
        if row is None:
            print(f"{name:<20} {accuracy:>6.0e}  none: {s['missing']} | {made}", flush=True)
            continue
        error, cost = (math.nan, math.nan) if arguments.only_cost else again(scene, result, row)
        print(
            f"{name:<20} {accuracy:>6.0e}  {s['promise']['error']:.1e} ± {s['uncertainty']:.0e} {error:>8.1e}"
            f" {row['cost']:>9.3f} {cost:>7.3f} {own_cost(result, scene):>6.2f} | {made}",
            flush=True,
        )
        print(f"    {describe(row)}", flush=True)


if __name__ == "__main__":
    main()
