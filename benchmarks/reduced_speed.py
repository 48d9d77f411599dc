"""Processor time of reduced models against reissner's march, at what accuracy, in one process.

    ./with-fenicsx python3 benchmarks/reduced_speed.py [--scenes plate blade]

The truth is reissner by ESDIRK4 with a short step. Every row has been run once before, so that its forms are compiled;
seconds are those of the processor for the whole run, recording included, and those of them that the set-up of the forms
takes (`compile`). The error is the largest difference of the tip, relative to its largest displacement, at the times of
the shortest history. Ratios are to the reduced model with foreshortening.
"""

from __future__ import annotations

import argparse
from time import process_time
from typing import Any

import numpy as np
import numpy.typing as npt

import rotfem

Array = npt.NDArray[np.float64]

#: Wanted total error, length of the history (s), step of the truth (s), and steps of the march (s) of each scene.
SCENES = {"plate": (1e-2, 20.0, 0.1, (0.01, 0.05, 0.1)), "blade": (1e-3, 100.0, 0.02, (0.0025, 0.01, 0.05))}

#: Rows of every history.
ROWS = 201


def plate() -> dict[str, Any]:
    """Return the spin-up of the plate of demos/rotating_plate.toml, four times as wide, with 6125 unknowns."""
    thickness = 0.07745966692414834
    structure = {
        "type": "plate",
        "length": 10.0,
        "width": 4.0,
        "thickness": thickness,
        "nu": 0.0,
        "E": 361478445.6460256,
    }
    return {
        "structure": structure | {"rho": 15.491933384829666, "shear_correction": 0.7142857142857143},
        "motion": {"type": "spin_up", "speed": 6.0, "duration": 15.0, "axis": [0, -1, 0]},
        "mesh": {"elements": [24, 12]},
    }


def blade() -> dict[str, Any]:
    """Return a damped blade at constant speed under a tabulated gust of 100 s."""
    rng, t = np.random.default_rng(5), np.arange(0.0, 100.01, 0.5)
    gust = 0.25 + 0.1 * np.sin(0.7 * t) + 0.05 * rng.standard_normal(len(t))
    table = [[float(a), 0.0, 0.0, float(b)] for a, b in zip(t, gust, strict=True)]
    section = {"EA": 2.8e7, "GA2": 1e7, "GA3": 1e7, "GJ": 1e4, "EI2": 1.4e4, "EI3": 4e4, "mass_per_length": 1.2}
    structure = {"type": "spatial_beam", "length": 10.0, "hub_radius": 0.5, "pretwist": 0.2}
    return {
        "structure": structure
        | {"section": section | {"rotary_inertia2": 6e-4, "rotary_inertia3": 1e-3}, "damping": {"kelvin_voigt": 5e-3}},
        "motion": {"type": "constant", "speed": 4.0},
        "loads": {"distributed": {"kind": "dead", "table": table}},
        "initial": {"state": "steady"},
        "mesh": {"elements": 6},
    }


def tips(result: Any) -> Array:
    """Return the displacement of the tip in all rows."""
    return np.stack([result.history[f"tip_u{i}"] for i in (1, 2, 3)], axis=1)


def computed(
    scene: dict[str, Any], end: float, step: float, scheme: str, **model: Any
) -> tuple[float, float, Array, Any]:
    """Return processor seconds of a run and of its set-up, the tip in all rows, and the result."""
    rows = max(step, end / (ROWS - 1))
    every = round(rows / step)
    time = {"end": end, "step": rows / every, "output_every": every, "scheme": scheme}
    began = process_time()
    result = rotfem.run(scene | {"model": model, "time": time})
    return process_time() - began, result.summary["timings"]["compile"], tips(result), result


def measure(name: str) -> None:
    """Print the rows of a scene."""
    wanted, end, fine, steps = SCENES[name]
    scene = {"plate": plate, "blade": blade}[name]()
    *_, truth, result = computed(scene, end, fine, "esdirk4", theory="reissner")
    size, row = float(np.linalg.norm(truth, axis=1).max()), end / (ROWS - 1)
    print(
        f"\n{name}: {result.summary['dofs']} unknowns, {end:g} s, displacements up to {size:.4g} m, wanted {wanted:g}"
    )
    print(f"{'model':<32}{'scheme':<20}{'step':>8}{'error':>10}{'cpu s':>9}{'set-up':>9}{'ratio':>8}")
    linear = {"theory": "consistent_linear"}
    reduced = linear | {"reduced": wanted / 10}
    cases: list[tuple[str, str, float, dict[str, Any]]] = [
        ("reduced, foreshortening", "generalised_alpha", row, reduced | {"foreshortening": True}),
        ("reduced", "generalised_alpha", row, reduced),
        *(("reissner", "generalised_alpha", step, {"theory": "reissner"}) for step in steps),
        ("reissner", "esdirk4", min(row, 0.1), {"theory": "reissner"}),
        ("consistent_linear", "generalised_alpha", steps[0], linear),
    ]
    first = None
    for label, scheme, step, model in cases:
        computed(scene, 2 * step, step, scheme, **model)  # compiles
        seconds, compiled, found = computed(scene, end, step, scheme, **model)[:3]
        error, first = float(np.linalg.norm(found - truth, axis=1).max()) / size, first or seconds
        numbers = f"{error:>10.2e}{seconds:>9.2f}{compiled:>9.2f}{seconds / first:>8.1f}"
        print(f"{label:<32}{scheme:<20}{step:>8g}{numbers}", flush=True)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=list(SCENES), choices=list(SCENES))
    for name in parser.parse_args().scenes:
        measure(name)


if __name__ == "__main__":
    main()
