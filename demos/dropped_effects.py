"""What each inertia effect is worth: its error where it is left out, and the time that saves.

The scene of spin_up.toml is run with all effects and then without each of them. An effect that is off leaves no term in
the equations, so that fewer integrals are assembled:

    Coriolis          1e-4 of the deflection: the tip moves slowly, compared with 6 rad/s · 10 m
    centrifugal       20 %: nothing stiffens the beam
    Euler             100 %: nothing else bends this beam
    rotary inertia    2e-5: the beam is slender

None of them saves much: a step here is mostly Python and a solve of 93 unknowns. What is small in one scene is not in
another: of a thick beam at high speed (slenderness 30, 12 in units of √(EI/A_ρL⁴)) the first frequency in the plane is
12.7 % too high without the Coriolis force. That is the number of this demo.

The picture in docs/commands.md is this demo's, saved with --figure docs/figures/dropped_effects.png.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

import numpy as np
from _demo import FIRST_RANK, command_line, report, save, say
from matplotlib.figure import Figure

import rotfem

SCENE = Path(__file__).with_name("spin_up.toml")

# %: Legendre–Galerkin about the exact stretched state, 4.8570240429 without and 4.30814567538 with Coriolis force
REFERENCE = 100 * (4.8570240429 / 4.30814567538 - 1)

COARSE = {"time.step": 0.02, "time.output_every": 1}  # without a figure

THICK: dict[str, Any] = {
    "structure": {
        "type": "planar_beam",
        "length": 1.0,
        "section": {"EA": 900.0, "GA": 900.0 / 3.059, "EI": 1.0, "mass_per_length": 1.0, "rotary_inertia": 1 / 900},
    },
    "motion": {"type": "constant", "speed": 12.0},
    "mesh": {"elements": 10, "degree": 4},
    "modes": {"count": 4},
}


def main(figure: Path | None = None) -> float:
    """Return by how much (%) the lag frequency of the thick beam is off without the Coriolis force."""
    scene = rotfem.load_scene(SCENE)
    rows = dropped(scene, 9) if figure is not None else dropped(scene.replace(COARSE), 1)
    say(f"{'spin-up without':<18}{'error':>10}{'CPU time':>10}")
    for name, row in rows.items():
        say(f"{name:<18}{row['error']:>10.1e}{row['time']:>8.3f} s")
    off = frequency_error(rotfem.Scene.from_dict(THICK), "coriolis")
    report("1st edgewise of the thick beam without coriolis", off, REFERENCE, "%")
    if figure is not None and FIRST_RANK:
        plot(rows, figure)
    return off


def dropped(scene: rotfem.Scene, repeat: int) -> dict[str, dict[str, float]]:
    """Return effect ↦ error of the tip without it (relative), median CPU time (s); "nothing" comes first."""
    effects = rotfem.Problem.of(scene).effective_effects()
    times: dict[str, list[float]] = {name: [] for name in ("nothing", *effects)}
    results = {}
    for _ in range(repeat + 1):
        for name in times:  # in turn, so that what else the machine does hits all of them
            variant = scene.replace({"model.effects": [e for e in effects if e != name]})
            started = process_time()
            results[name] = rotfem.run(variant)
            times[name].append(process_time() - started)
    everything = tip(results["nothing"].history)
    largest = np.max(np.linalg.norm(everything, axis=1))
    return {
        name: {
            "error": float(np.max(np.linalg.norm(tip(result.history) - everything, axis=1)) / largest),
            "time": median(times[name][1:]),  # the first one may have compiled forms
        }
        for name, result in results.items()
    }


def tip(history: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the displacement of the tip, shape (times, 2), m."""
    return np.column_stack([history["tip_u1"], history["tip_u2"]])


def frequency_error(scene: rotfem.Scene, effect: str) -> float:
    """Return by how much (%) the lowest frequency is off without an effect."""
    effects = [e for e in rotfem.Problem.of(scene).effective_effects() if e != effect]
    with_it, without = (
        rotfem.modes(s).rows[0]["frequency"] for s in (scene, scene.replace({"model.effects": effects}))
    )
    return 100 * (without / with_it - 1)


def plot(rows: Mapping[str, Mapping[str, float]], path: Path) -> None:
    """Draw error and time saved, a bar an effect."""
    names = [name for name in rows if name != "nothing"]
    whole = rows["nothing"]["time"]
    labels = [name.replace("_", " ") for name in names]
    figure = Figure(figsize=(9, 3.2), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    left.barh(labels, [rows[name]["error"] for name in names], color="C3")
    left.set(xscale="log", xlim=(1e-6, 2), xlabel="error of the tip's motion without it (–)")
    right.barh(labels, [100 * (1 - rows[name]["time"] / whole) for name in names], color="C0")
    right.set(xlabel=f"CPU time saved without it (% of {whole:.2f} s)")
    left.invert_yaxis()
    for axis in (left, right):
        axis.grid(True, axis="x", lw=0.4, alpha=0.6)
    figure.suptitle("Spin-up: what dropping each effect costs and saves")
    save(figure, path)


if __name__ == "__main__":
    command_line(main)
