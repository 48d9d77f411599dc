"""Whether answers to an accuracy keep it: true error over what was asked, of the tip and of the moment at the root.

    ./with-fenicsx python benchmarks/accuracy_kept.py [--cache FOLDER] [--new] [--of tip|root_moment] [NAME …]

The scenes are those of accuracy_scenes.py, or with --new those below, written after the code. The truth is an answer by
`radau5` to TOLERANCE on twice the elements of one degree more; CPU seconds are those of the answer, all attempts
included, BUDGET at most. What is not met in that counts as refused.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import tempfile
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import numpy.typing as npt
from accuracy_scenes import SCENES, Tables, finer

import rotfem

Array = npt.NDArray[np.float64]

ACCURACIES, TOLERANCE, BUDGET = (1e-2, 1e-3, 1e-4), 1e-6, 15.0
COLUMNS = {"tip": "tip_u", "root_moment": "root_m"}

BAR = {"EA": 1.1e7, "GA": 3.5e6, "EI": 3.0e3, "mass_per_length": 0.9, "rotary_inertia": 2.5e-4}
VANE = {"EA": 1.5e7, "GA2": 5e6, "GA3": 5e6, "GJ": 4e3, "EI2": 6e3, "EI3": 3e4, "mass_per_length": 1.1}
LEAF = {"type": "plate", "length": 0.8, "width": 0.4, "thickness": 0.008, "E": 70e9, "nu": 0.3, "rho": 2700.0}

ROD = {"EA": 2.4e7, "GA": 8e6, "EI": 2.2e4, "mass_per_length": 1.8, "rotary_inertia": 5e-4}
FIN = {"EA": 9e6, "GA2": 3e6, "GA3": 3e6, "GJ": 2.5e3, "EI2": 2.2e3, "EI3": 1.5e4, "mass_per_length": 0.8}
SHEET = {"type": "plate", "length": 0.6, "width": 0.5, "thickness": 0.006, "E": 72e9, "nu": 0.33, "rho": 2780.0}


def _bar(**more: Any) -> Tables:
    return {"type": "planar_beam", "length": 4.0, "section": BAR, "hub_radius": 0.2, **more}


def _vane(**more: Any) -> Tables:
    return {"type": "spatial_beam", "length": 5.0, "section": VANE, "hub_radius": 0.3, **more}


def _rod(**more: Any) -> Tables:
    return {"type": "planar_beam", "length": 6.0, "section": ROD, "hub_radius": 0.4, **more}


def _fin(**more: Any) -> Tables:
    return {"type": "spatial_beam", "length": 4.0, "section": FIN, "hub_radius": 0.2, **more}


def _turning(speed: float, **more: Any) -> Tables:
    return {"type": "constant", "speed": speed, **more}


NEW: dict[str, Tables] = {
    "bar spun up": {
        "structure": _bar(),
        "motion": {"type": "spin_up", "speed": 12.0, "duration": 3.0},
        "time": {"end": 4.0, "step": 0.02},
    },
    "bar braked": {
        "structure": _bar(tip_mass=0.4),
        "motion": {"type": "table", "table": [[0, 8.0], [1.0, 8.0], [2.0, 1.0], [3.0, 1.0]]},
        "time": {"end": 3.0, "step": 0.02},
    },
    "bar in a gale": {
        "structure": _bar(damping={"rayleigh": [0.5, 0.0]}),
        "motion": _turning(5.0),
        "loads": {"distributed": {"harmonic": {"amplitude": [0, 6.0], "frequency": 7.0}}},
        "time": {"end": 3.0, "step": 0.02},
    },
    "bar pulled aside": {
        "structure": _bar(),
        "motion": _turning(3.0),
        "loads": {"tip_force": [[0, 0, 0], [0.4, 0, 40.0], [0.8, 0, 0], [2.5, 0, 0]]},
        "time": {"end": 2.5, "step": 0.02},
    },
    "bar let go": {
        "structure": _bar(),
        "motion": _turning(0.0),
        "initial": {"tip_displacement": 0.8},
        "time": {"end": 2.0, "step": 0.01},
    },
    "bar on a driven hub": {
        "structure": _bar(),
        "motion": {"type": "torque", "hub_inertia": 12.0, "pulses": [[0.0, 0.5, 30.0], [1.0, 1.4, -20.0]]},
        "time": {"end": 2.0, "step": 0.01},
    },
    "bar in its weight": {
        "structure": _bar(),
        "motion": _turning(4.0),
        "loads": {"gravity": [0.0, -9.81]},
        "time": {"end": 3.0, "step": 0.02},
    },
    "vane in flap": {
        "structure": _vane(pretwist=[[0, 0.25], [5.0, 0.0]]),
        "motion": _turning(9.0),
        "loads": {"tip_force": [[0, 0, 0, 0], [0.3, 0, 0, 25.0], [0.6, 0, 0, 0], [1.5, 0, 0, 0]]},
        "mesh": {"elements": 5},
        "time": {"end": 1.5, "step": 0.015},
    },
    "vane spun up, preconed": {
        "structure": _vane(precone=0.06, damping={"kelvin_voigt": 1e-3}),
        "motion": {"type": "spin_up", "speed": 15.0, "duration": 1.5},
        "mesh": {"elements": 5},
        "time": {"end": 2.0, "step": 0.02},
    },
    "vane on a shaken base": {
        "structure": _vane(),
        "motion": _turning(
            6.0, base_acceleration=[[0, 0, 0, 0], [0.3, 0, 0, 3.0], [0.9, 0, 1.0, -3.0], [1.2, 0, 0, 0]]
        ),
        "mesh": {"elements": 5},
        "time": {"end": 1.5, "step": 0.015},
    },
    "leaf spun up": {
        "structure": {**LEAF, "hub_radius": 0.2},
        "motion": {"type": "spin_up", "speed": 30.0, "duration": 0.5, "axis": [0, 1, 0]},
        "mesh": {"elements": [5, 3]},
        "time": {"end": 0.6, "step": 0.006},
    },
    "leaf under pressure": {
        "structure": {**LEAF, "damping": {"rayleigh": [4.0, 0.0]}},
        "motion": _turning(12.0, axis=[0, 0, 1]),
        "loads": {"pressure": [[0, 0], [0.1, 60.0], [0.2, 0.0], [0.4, 0.0]]},
        "mesh": {"elements": [5, 3]},
        "time": {"end": 0.4, "step": 0.004},
    },
    "vane at rest under load": {
        "structure": _vane(),
        "motion": _turning(8.0),
        "loads": {"tip_force": [0.0, 15.0, 40.0]},
        "mesh": {"elements": 4},
    },
    "rod spun up and braked": {
        "structure": _rod(tip_mass=0.6),
        "motion": {"type": "table", "table": [[0, 0], [0.8, 6.0], [1.6, 6.0], [2.4, 2.0], [3.0, 2.0]]},
        "time": {"end": 3.0, "step": 0.02},
    },
    "rod under a follower": {
        "structure": _rod(),
        "motion": _turning(2.0),
        "loads": {"tip_force": {"table": [[0, 0, 0], [1.0, 0, 60.0], [2.0, 0, 10.0]], "kind": "follower"}},
        "mesh": {"elements": 5},
        "time": {"end": 2.5, "step": 0.02},
    },
    "rod shaken": {
        "structure": _rod(damping={"rayleigh": [0.8, 0.0]}),
        "motion": _turning(4.0),
        "loads": {"distributed": {"harmonic": {"amplitude": [0, 9.0], "frequency": 11.0}}},
        "time": {"end": 2.5, "step": 0.02},
    },
    "rod on a hub, kicked": {
        "structure": _rod(),
        "motion": {"type": "torque", "hub_inertia": 40.0, "pulses": [[0.1, 0.4, 150.0], [0.9, 1.1, -120.0]]},
        "time": {"end": 1.8, "step": 0.01},
    },
    "rod struck at the tip": {
        "structure": _rod(),
        "motion": _turning(3.0),
        "loads": {"tip_moment": [[0, 0], [0.2, 90.0], [0.5, 0.0]]},
        "time": {"end": 1.5, "step": 0.01},
    },
    "fin in a gust": {
        "structure": _fin(pretwist=[[0, 0.4], [4.0, 0.05]]),
        "motion": _turning(7.0),
        "loads": {"distributed": [[0, 0, 0, 0], [0.25, 0, 0, 7.0], [0.6, 0, 0, -3.0], [1.0, 0, 0, 0]]},
        "mesh": {"elements": 4},
        "time": {"end": 1.2, "step": 0.012},
    },
    "fin spun down": {
        "structure": _fin(precone=0.05),
        "motion": {"type": "table", "table": [[0, 12.0], [0.4, 12.0], [1.2, 5.0], [1.6, 5.0]]},
        "mesh": {"elements": 4},
        "time": {"end": 1.6, "step": 0.016},
    },
    "sheet lifted": {
        "structure": {**SHEET, "damping": {"rayleigh": [6.0, 0.0]}},
        "motion": _turning(8.0, axis=[0, 0, 1]),
        "loads": {"pressure": [[0, 0], [0.15, 25.0], [0.3, 5.0], [0.4, 5.0]]},
        "mesh": {"elements": [5, 4]},
        "time": {"end": 0.4, "step": 0.004},
    },
}
for _tables in NEW.values():
    _tables.setdefault("mesh", {"elements": 6})


def output(run: Any, name: str) -> Array:
    """Return an output of a run over its rows, (n, components)."""
    return np.column_stack([x for key, x in run.history.items() if key.startswith(COLUMNS[name])])


def truth(tables: Tables, cache: Path) -> dict[str, Array]:
    """Return name of the output ↦ its history, kept in a folder."""
    plate = tables["structure"]["type"] == "plate"
    fine = finer(tables, mesh=2)
    fine["mesh"] = {**fine["mesh"], "degree": tables["mesh"].get("degree", 2 if plate else 3) + (not plate)}
    if "time" in tables:
        fine["time"] = {"end": tables["time"]["end"], "scheme": "radau5", "tolerance": TOLERANCE}
        fine["time"]["output_step"] = rows_every(tables)
    text = json.dumps({**fine, "version": rotfem.__version__}, sort_keys=True)
    file = cache / f"{hashlib.sha256(text.encode()).hexdigest()[:24]}.npz"
    if not file.exists():
        run = rotfem.run({**fine, "output": {"error": False}}, hint=None)
        np.savez(file, **{name: output(run, name) for name in COLUMNS})
    return dict(np.load(file))


def rows_every(tables: Tables) -> float:
    """Return the time from row to row, s."""
    return float(tables["time"].get("step", tables["time"]["end"] / 500))


def main() -> None:
    """Print a line for every scene and accuracy, and how many are kept."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cache", type=Path, default=Path(tempfile.gettempdir()) / "rotfem-kept")
    parser.add_argument("--new", action="store_true")
    parser.add_argument("--of", choices=COLUMNS, nargs="*", default=list(COLUMNS))
    parser.add_argument("names", nargs="*", metavar="NAME")
    arguments = parser.parse_args()
    arguments.cache.mkdir(parents=True, exist_ok=True)
    scenes, found = NEW if arguments.new else SCENES, []
    for name in arguments.names or scenes:
        tables = {key: value for key, value in scenes[name].items() if key != "model"}
        exact = truth(tables, arguments.cache)
        if "time" in tables:
            tables = {**tables, "time": {"end": tables["time"]["end"], "output_step": rows_every(tables)}}
            tables["time"]["tolerance"] = 1e-3
        for of in arguments.of:
            size = np.linalg.norm(exact[of], axis=1).max()
            for accuracy in ACCURACIES:
                started, said = process_time(), ""
                try:
                    run = rotfem.run(
                        {**tables, "accuracy": accuracy, "accuracy_of": of, "accuracy_budget": BUDGET}, hint=None
                    )
                except rotfem.ComputationError as failure:
                    said, run = f"  {failure.what[:90]}", getattr(failure, "result", None)
                seconds, off = process_time() - started, np.nan
                if run is not None and len(there := output(run, of)) == len(exact[of]):
                    off = float(np.linalg.norm(there - exact[of], axis=1).max() / size) / accuracy
                estimate = run.summary.get("error", {}).get("total") if run is not None else None
                shown = "unknown" if estimate is None else f"{estimate / accuracy:.3f}"
                print(
                    f"{name:<36}{of:<12}{accuracy:7.0e}  true {off:8.3f} said {shown:>8}{seconds:8.2f} s{said}",
                    flush=True,
                )
                found.append((of, accuracy, off, bool(said)))
    for of in arguments.of:
        for accuracy in ACCURACIES:
            these = [(off, missed) for name, asked, off, missed in found if (name, asked) == (of, accuracy)]
            answered = np.array([off for off, missed in these if not missed])
            kept, refused = np.sum(answered <= 1.0), len(these) - len(answered)
            print(f"{of} {accuracy:g}: {kept} of {len(answered)} kept, {refused} refused", end="")
            print(f", median {np.median(answered):.2f}, largest {np.max(answered):.2f}")


if __name__ == "__main__":
    main()
