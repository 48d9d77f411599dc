"""What an accuracy costs and gives: the true error of what it chose, and its time beside other ways to the same answer.

    ./with-fenicsx python benchmarks/accuracy_answers.py [--cache FOLDER] [--grid] [--accuracy E …] [--long] [NAME …]

The scenes are those of accuracy_scenes.py, without the theory that some of them name, or with --long those of
long_scenes.py. Of every scene and accuracy it
prints the true error over the accuracy, and CPU seconds, those of choosing included: of the answer, of the scene's own
setting with its error, and, with --grid, of the cheapest fixed settings that are as good as was asked: of all of a grid
over theory, scheme, step and mesh, and of the exact theory by the scheme of default (where no step of the grid is short
enough of that, what a shorter one is expected to take by its order). Of long scenes the grid has the exact theory by
the scheme of default only. Forms are compiled before.
"""

from __future__ import annotations

import argparse
import itertools
import tempfile
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import numpy.typing as npt
from accuracy_scenes import SCENES, Tables, Truth, finer, tips
from long_scenes import SCENES as LONG_SCENES
from scipy.interpolate import CubicSpline

import rotfem

Array = npt.NDArray[np.float64]

ACCURACIES = (1e-2, 1e-3, 1e-4)

#: Steps, elements along every edge and further degree of the truth, of beams and of plates, and of what says how good
#: that is.
TRUTHS = {False: ((32, 2, 1), (16, 2, 0)), True: ((2, 2, 1), (2, 2, 0))}
LONG_TRUTHS = {False: ((4, 2, 0), (2, 2, 0)), True: ((2, 1, 0), (1, 1, 0))}

#: How many times more steps truths have of scenes whose motion is quicker than their own steps are, or slower;
#: increments of Newton's method in truths, whose errors add up over many steps, and fewest elements of a beam there.
QUICK = dict.fromkeys(("moment pulse", "resonance once a turn", "torque reversed in each step", "spin-down"), 4.0) | {
    "step load, adaptive": 8.0,
    "gusts on a long blade": 0.125,
    "plate of 6125 unknowns, pulse at the tip": 4.0,
    "plate of 6125 unknowns, under pressure": 2.0,
}
INCREMENT, ELEMENTS = 1e-12, 16

#: Steps of the grid, as parts of a scene's own, and its schemes and theories.
STEPS = (4.0, 2.0, 1.0, 0.5, 0.25, 0.125, 1 / 16)
SCHEMES, THEORIES = ("generalised_alpha", "esdirk4"), ("consistent_linear", "reissner")


#: Error beside that of twice the step from which shorter steps of a row are not tried.
STALLED = 0.9

#: Least error that a grid goes down to.
LEAST = 1e-3

#: CPU seconds from which a run of the full model is a long one; its order, and the error from which it shows that.
LONG, ORDER, SHOWN = 2.0, 2, 0.1


@dataclass
class Answer:
    """One run: its true error, CPU seconds, and summary; an infinite error of one that failed."""

    error: float
    seconds: float
    summary: dict[str, Any]


class Judge:
    """Knows the truth of a scene.

    Args:
        tables: the scene, without its theory.
        truth: where truths are kept.
        quick: how many times more steps they take than those of others.
        truths: steps, elements and further degree (see TRUTHS).

    Attributes:
        unsure: how far the truth is off, relative, by another one that is less fine.
    """

    def __init__(self, tables: Tables, truth: Truth, quick: float = 1.0, truths: Any = TRUTHS):
        self.tables = tables
        (steps, *best), (fewer, *other) = truths[tables["structure"]["type"] == "plate"]
        self.t, self.tip = truth(finest(tables, quick * steps, *best))
        self.unsure = self.error(*truth(finest(tables, quick * fewer, *other)))

    def __call__(self, tables: Tables) -> Answer:
        """Return the answer to a scene, computed after its forms are compiled."""
        started = process_time()
        try:
            run = rotfem.run(tables, hint=None)
        except rotfem.ComputationError as failure:
            return Answer(np.inf, process_time() - started, getattr(failure, "result", failure).__dict__)
        return Answer(self.error(*tips(run)), process_time() - started, run.summary)

    def error(self, t: Array, tip: Array) -> float:
        """Return the largest distance from the truth, relative to the largest displacement."""
        exact = CubicSpline(self.t, self.tip)(t) if len(t) > 1 else self.tip
        return float(np.linalg.norm(tip - exact, axis=1).max() / np.linalg.norm(self.tip, axis=1).max())


def finest(tables: Tables, steps: float, mesh: int, further: int) -> Tables:
    """Return a scene with so many steps for each of its own, elements along every edge, and a higher degree."""
    out = finer(tables, mesh=mesh)
    if not isinstance(out["mesh"]["elements"], list):
        out["mesh"]["elements"] = max(ELEMENTS, out["mesh"]["elements"])
    out["mesh"]["degree"] = out["mesh"].get("degree", 2 if out["structure"]["type"] == "plate" else 3) + further
    if "time" in tables:
        out["solver"] = {"increment_tolerance": INCREMENT}
        step = tables["time"].get("step", tables["time"]["end"] / 500)
        out["time"] = {"end": tables["time"]["end"], "step": step / steps, "scheme": "esdirk4"}
    return out


def grid(tables: Tables) -> list[list[Tables]]:
    """Return fixed settings of a scene, in rows whose steps become shorter."""
    out = []
    for theory, factor in itertools.product(THEORIES, (0.5, 1)):
        coarse = finer(tables, theory=theory)
        number = tables["mesh"]["elements"]
        part = [max(1, int(n * factor)) for n in number] if isinstance(number, list) else max(1, int(number * factor))
        coarse["mesh"] = {**tables["mesh"], "elements": part}
        if "time" not in tables:
            out.append([coarse])
            continue
        end = tables["time"]["end"]
        step = tables["time"].get("step", end / 500)
        for scheme in SCHEMES:
            times = (
                {"end": end, "step": min(step * s, end / 10), "scheme": scheme, "output_step": step} for s in STEPS
            )
            out.append([{**coarse, "time": time, "output": {"error": False}} for time in times])
    return out


def tried_out(judge: Judge, tables: Tables, least: float, full: bool = False) -> list[tuple[Tables, Answer]]:
    """Return the settings of a grid that were tried, with their answers.

    A row ends where it is good enough for the least accuracy, or where half the step has not made it better.

    Args:
        judge: of the scene.
        tables: the scene.
        least: accuracy.
        full: whether those of the full model only are tried.
    """
    out = []
    for row in grid(tables):
        if full and not is_full(row[0]):
            continue
        before = np.inf
        for setting in row:
            answer = judge(setting)
            out.append((setting, answer))
            if answer.error <= least or STALLED * before < answer.error < 1.0:
                break
            before = answer.error
    return out


def is_full(setting: Tables) -> bool:
    """Return whether a setting is the exact theory by the scheme of default."""
    scheme = setting.get("time", {}).get("scheme", "generalised_alpha")
    return bool(setting["model"]["theory"] == "reissner" and scheme == "generalised_alpha")


def of_full_model(tried: list[tuple[Tables, Answer]], accuracy: float) -> float | None:
    """Return CPU seconds that the full model takes for an accuracy; None where the grid does not tell."""
    answers = [each for setting, each in tried if is_full(setting)]
    known = [each.seconds for each in answers if each.error <= accuracy]
    known = known or [s.seconds * (s.error / accuracy) ** (1 / ORDER) for s in answers if s.error <= SHOWN]
    return min(known, default=None)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cache", type=Path, default=Path(tempfile.gettempdir()) / "rotfem-accuracy")
    parser.add_argument("--accuracy", type=float, nargs="*", default=list(ACCURACIES))
    parser.add_argument("--grid", action="store_true")
    parser.add_argument("--long", action="store_true")
    parser.add_argument("names", nargs="*", metavar="NAME")
    arguments = parser.parse_args()
    truth, ratios, own, best, faster = Truth(arguments.cache), [], [], [], []
    scenes, truths = (LONG_SCENES, LONG_TRUTHS) if arguments.long else (SCENES, TRUTHS)
    for name in arguments.names or scenes:
        tables = {key: value for key, value in scenes[name].items() if key != "model"}
        judge = Judge(tables, truth, QUICK.get(name, 1.0), truths)
        for compiled in (tables, {**tables, "accuracy": max(arguments.accuracy)}):
            judge(compiled)
        default = judge(tables)
        print(f"{name}: its own setting {default.error:.1e} in {default.seconds:.2f} s", end="")
        print(f" (truth known to {judge.unsure:.0e})", flush=True)
        least = max(LEAST, min(arguments.accuracy))
        tried = tried_out(judge, tables, least, arguments.long) if arguments.grid else []
        for accuracy in arguments.accuracy:
            answer = judge({**tables, "accuracy": accuracy})
            line = f"    {accuracy:.0e}: true/asked {answer.error / accuracy:8.2e} in {answer.seconds:6.2f} s"
            if np.isfinite(answer.error):
                ratios.append(answer.error / accuracy)
                told = answer.summary["accuracy"]
                chosen = told["chosen"]
                line += f" ({len(told['attempts'])} tried: {chosen['theory']}"
                line += f", {chosen.get('scheme', '')} {chosen.get('step', chosen.get('tolerance', 0)):.2g}"
                line += f", {chosen.get('elements')} P{chosen['degree']})"
            else:
                line += " (not met)"
            own.append(default.seconds / answer.seconds)
            good = [(each.seconds, setting) for setting, each in tried if each.error <= accuracy]
            full = of_full_model(tried, accuracy)
            if good:
                cheapest = min(seconds for seconds, _ in good)
                best.append(answer.seconds / cheapest)
                line += f"; cheapest of the grid {cheapest:.2f} s"
            if full is not None and np.isfinite(answer.error):
                faster.append((full, answer.seconds))
                line += f"; full model {full:.2f} s"
            print(line, flush=True)
    if ratios:
        print(f"true/asked: median {np.median(ratios):.2f}, largest {max(ratios):.2f} of {len(ratios)} that met it")
    print(f"time of the scenes' own settings / time: median {np.median(own):.2f}")
    if faster:
        gains = np.array([full / seconds for full, seconds in faster])
        long = np.array([full > LONG for full, _ in faster])
        print(f"time of the full model at that error / time: median {np.median(gains):.2f}", end="")
        print(
            f", above 1 in {np.mean(gains[long] > 1):.0%} of {long.sum()} longer than {LONG:g} s" if long.any() else ""
        )
    if best:
        print(f"time / time of the cheapest of the grid: median {np.median(best):.2f}, largest {max(best):.2f}")


if __name__ == "__main__":
    main()
