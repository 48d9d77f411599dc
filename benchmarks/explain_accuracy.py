"""How good the estimates of `rotfem explain` and the choices of `model.tolerance` are, on scenes of all kinds.

    python3 benchmarks/explain_accuracy.py estimates [SCENE …]     estimate against truth, every effect and theory
    python3 benchmarks/explain_accuracy.py tolerance [SCENE …]     true error and time of the model that was chosen
    python3 benchmarks/explain_accuracy.py effects [SCENE …]       integrals, compile and step time without an effect
    python3 benchmarks/explain_accuracy.py exceeded                runs that leave the range of their model

The truth is the difference of two full runs, each on the scene's own mesh with its own steps. Times are medians of
five runs with compiled forms, in turn, and of three compilations.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np
from explain_scenes import SCENES, scene

import rotfem
import rotfem.selection.coarse_model
from rotfem.scene import Scene
from rotfem.selection.distance import tip_change
from rotfem.selection.estimate import NOTICEABLE

#: Below it a change is not compared: round-off of two Newton solutions.
SMALLEST = 1e-8

#: Compilations from nothing whose median is taken.
COMPILATIONS = 3

TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5)


def ratios(rows: list[dict[str, Any]]) -> list[tuple[float, str]]:
    """Return (estimate/truth, what) of every output above SMALLEST; 1 where both models fail alike."""
    out = []
    for row in rows:
        for name, truth in row["truth"].items():
            guess = row["estimate"][name]
            if max(guess, truth) < SMALLEST:
                continue
            alike = not np.isfinite(guess) and not np.isfinite(truth)
            ratio = 1.0 if alike else guess / truth if truth > 0.0 else np.inf
            out.append((ratio, f"{row['name']}, {name}: {guess:.1e} for {truth:.1e}"))
    return out


def estimates(names: list[str]) -> None:
    """Print estimate against truth, and over all scenes the share of rows within a factor."""
    everything: list[float] = []
    missed = []
    print(f"{'scene':<20}{'rows':>5}{'median':>8}{'low':>8}{'high':>8}{'estimate s':>12}{'check s':>9}  worst")
    for name in names:
        result = rotfem.explain(scene(name), check=True)
        found = ratios(result.rows)
        values = [ratio for ratio, _ in found]
        everything += values
        worst = max(found, key=lambda pair: abs(np.log(max(pair[0], 1e-300))))
        missed += [
            f"{name}: {row['name']}"
            for row in result.rows
            if row["verdict"] == "negligible" and max(row["truth"].values()) > NOTICEABLE
        ]
        times = result.summary["timings"]
        spread = f"{median(values):>8.3f}{min(values):>8.3f}{max(values):>8.3f}"
        print(
            f"{name:<20}{len(values):>5}{spread}{times['estimate']:>12.2f}{times['check']:>9.2f}  {worst[1]}",
            flush=True,
        )
    r = np.array(everything)
    inside = np.abs(np.log(np.maximum(r, 1e-300))) <= np.log(3)
    print(f"{len(r)} rows, median {np.median(r):.3f}, worst {r.min():.3f} and {r.max():.3f}")
    print(f"within a factor 3: {100 * inside.mean():.1f} %; above 1 % but called negligible: {missed or 'none'}")


def alternated(variants: list[Callable[[], Any]], times: int = 5) -> tuple[list[Any], list[float]]:
    """Return the results, and the median times of calls in turn, so that all meet the same state of the machine."""
    results = [compute() for compute in variants]  # compiles
    spans: list[list[float]] = [[] for _ in variants]
    for _ in range(times):
        for compute, mine in zip(variants, spans, strict=True):
            started = perf_counter()
            compute()
            mine.append(perf_counter() - started)
    return results, [median(mine) for mine in spans]


def tip(result: Any) -> Any:
    """Return the displacement of the tip, (times, components)."""
    return np.stack([v for k, v in result.history.items() if k.startswith("tip_u")], axis=1)


def tolerance(names: list[str]) -> None:
    """Print true error and time against the full model for every tolerance."""
    met, total, saving = 0, 0, []
    print(f"{'scene':<20}{'tolerance':>10}{'error/tol':>10}{'choose s':>9}{'run s':>8}{'full s':>8}{'saved':>7}  model")
    for name in names:
        for allowed in TOLERANCES:
            asked = scene(name).replace({"model.tolerance": allowed})
            rotfem.run(asked)  # compiles
            result = rotfem.run(asked)
            choice = result.summary["choice"]
            model = {"model.theory": choice["theory"], "model.effects": choice["effects"]}
            runs = [partial(rotfem.run, scene(name)), partial(rotfem.run, scene(name).replace(model))]
            (full, _), (full_time, own) = alternated(runs)
            error = tip_change(tip(full), tip(result)) / allowed
            met, total = met + (error <= 1.0), total + 1
            saving.append(1 - own / full_time)
            row = (
                f"{allowed:>10.0e}{error:>10.1e}{choice['seconds']:>9.2f}{own:>8.2f}{full_time:>8.2f}{saving[-1]:>7.0%}"
            )
            upgrades = f", {len(choice['upgrades'])} upgrades" if "upgrades" in choice else ""
            print(f"{name:<20}{row}  {choice['theory']}, {' '.join(choice['effects'])}{upgrades}", flush=True)
    print(f"within the tolerance: {met} of {total}; saved, without choosing: median {median(saving):.0%}", end=", ")
    print(f"{min(saving):.0%} … {max(saving):.0%}")


COLD = """
import sys, rotfem
from time import perf_counter
sys.path.insert(0, sys.argv[1])
from explain_scenes import scene
problem = rotfem.Problem.of(scene(sys.argv[2]))
effects = problem.effective_effects()
problem.replace(effects=()).system()  # what all of them share: libraries, elements
started = perf_counter()
system = problem.replace(effects=tuple(e for e in effects if e != sys.argv[3])).system()
print(perf_counter() - started, system.integrals["F"], system.integrals["J"])
"""


def effects(names: list[str]) -> None:
    """Print integrals, compile time with an empty cache and time a step with all effects and without each."""
    print(f"{'scene':<20}{'without':<16}{'F':>4}{'J':>4}{'compile s':>11}{'ms a step':>11}")
    for name in names:
        present = rotfem.Problem.of(scene(name)).effective_effects()
        variants = {left_out: [e for e in present if e != left_out] for left_out in ("nothing", *present)}
        steps: dict[str, list[float]] = {left_out: [] for left_out in variants}
        for i in range(6):
            for left_out, kept in variants.items():
                seconds = step_time(run_with(scene(name), kept).summary)
                steps[left_out] += [seconds] if i > 0 else []  # the first one compiles
        for left_out in variants:
            built = [cold(name, left_out) for _ in range(COMPILATIONS)]
            seconds, in_f, in_j = median(float(words[0]) for words in built), *built[0][1:]
            numbers = f"{in_f:>4}{in_j:>4}{seconds:>11.2f}{1e3 * median(steps[left_out]):>11.4f}"
            print(f"{name:<20}{left_out:<16}{numbers}", flush=True)


def cold(name: str, left_out: str) -> list[str]:
    """Return seconds of compilation with an empty cache, in a new process, and the integrals of F and J."""
    with tempfile.TemporaryDirectory() as cache:
        command = [sys.executable, "-c", COLD, str(Path(__file__).parent), name, left_out]
        environment = os.environ | {"XDG_CACHE_HOME": cache}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return done.stdout.split()


def run_with(of: Scene, kept: list[str]) -> Any:
    """Run a scene with some effects."""
    return rotfem.run(of.replace({"model.effects": kept}))


def step_time(summary: dict[str, Any]) -> float:
    """Return the time of assembly and solution a step, s."""
    return (summary["timings"]["assemble"] + summary["timings"]["solve"]) / summary["steps"]


def exceeded(_: list[str]) -> None:
    """Print what is made of a blow of 4 ms, and what is said where the estimates are made to step over it."""
    struck = scene("slow").replace(
        {
            "loads": {"tip_force": [[0, 0, 0], [11.0, 0, 0], [11.002, 0, 4000.0], [11.004, 0, 0], [30.0, 0, 0]]},
            "time": {"end": 25.0, "step": 0.001, "output_every": 10},
        }
    )
    result = rotfem.run(struck.replace({"model.tolerance": 1e-2}))
    choice = result.summary["choice"]
    print(f"seen: {choice['theory']}, {' '.join(choice['effects'])}; {choice.get('remark', '')}", flush=True)
    rotfem.selection.coarse_model.given = lambda *_: []
    for reaction in ("upgrade", "stop", "warn"):
        asked = struck.replace({"model.tolerance": 1e-2, "model.on_exceed": reaction})
        try:
            result = rotfem.run(asked)
        except rotfem.ComputationError as error:
            print(f"{reaction}: {error}")
            continue
        print(f"{reaction}: {result.summary['choice']['theory']}; {'; '.join(result.summary['warnings'])}")


def main() -> None:
    """Do what the command line says."""
    what = {f.__name__: f for f in (estimates, tolerance, effects, exceeded)}
    if len(sys.argv) < 2 or sys.argv[1] not in what:
        sys.exit(__doc__)
    what[sys.argv[1]](sys.argv[2:] or list(SCENES))


if __name__ == "__main__":
    main()
