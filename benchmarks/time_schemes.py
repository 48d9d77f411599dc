"""Work and precision of the time schemes, with the orders observed, on ten scenes; a table and a figure.

    python3 benchmarks/time_schemes.py [-s SCENE …] [-o FIGURE] [--seconds MOST] [--truth SECONDS]

Every scheme steps every scene in 20, 40, 80 … fixed steps, until its error is below 1e-8 or a march takes more than
MOST CPU seconds. All marches of a scene are on one compiled system, and schemes take turns, so that what else the
machine does hits all of them. CPU time is that of the march alone. The error is the largest distance of the tip's
displacement, as a vector, over 20 instants, relative to its largest; the reference is the finest march of `esdirk4`,
whose steps are halved on until it is known to 1e-6 or a march takes more than SECONDS: after kinks and blows it has to
resolve the vibrations along the axis that they excite. What is below its own error, by the march before, is left out.
CPU times at an error are interpolated between marches; "–" was not reached.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from rotfem import ComputationError
from rotfem.analysis.equilibrium import static_tip_shape
from rotfem.analysis.march import March, Steps
from rotfem.commands.problem import Problem
from rotfem.numerics.newton import Newton
from rotfem.registry import schemes

KANE: dict[str, Any] = {
    "type": "planar_beam",
    "length": 10.0,
    "section": {"EA": 2.8e7, "GA": 1.0e7, "EI": 1.4e4, "mass_per_length": 1.2, "rotary_inertia": 6.0e-4},
}
PLATE: dict[str, Any] = {
    "type": "plate",
    "length": 1.0,
    "width": 0.5,
    "thickness": 0.01,
    "E": 7.0e10,
    "nu": 0.3,
    "rho": 2700.0,
}
PLATE_MESH = {"elements": [4, 2]}
PULSE = [[0.0, 0.0], [0.4, 0.0], [0.5, 200.0], [0.7, 200.0], [0.8, 0.0]]
KINKS = [[0.0, 0.0], [1.0, 2.0], [2.0, 1.0], [3.0, 4.0], [5.0, 4.0]]
GUST = [[0.5 * i, 0.0, 0.3 * np.sin(1.7 * i * i)] for i in range(9)]
STILL = {"type": "constant", "speed": 0.0}
SPIN_UP = {"type": "spin_up", "speed": 6.0, "duration": 15.0}
SWUNG = {"type": "spin_up", "speed": 20.0, "duration": 0.5, "axis": [0, 1, 0]}
HUB = {"type": "torque", "hub_inertia": 100.0, "table": [[0.0, 0.0], [1.0, 80.0], [2.0, -80.0], [3.0, 0.0], [4.0, 0.0]]}

#: Scene ↦ (tables, end in s).
SCENES: dict[str, tuple[dict[str, Any], float]] = {
    "spin-up": ({"structure": KANE, "motion": SPIN_UP}, 20.0),
    "spin-up, linear": ({"structure": KANE, "motion": SPIN_UP, "model": {"theory": "consistent_linear"}}, 20.0),
    "1/rev resonance": (
        {"structure": KANE, "motion": {"type": "constant", "speed": 4.0}, "loads": {"gravity": [0.0, -0.3]}},
        8.0,
    ),
    "moment pulse": ({"structure": KANE, "motion": STILL, "loads": {"tip_moment": {"table": PULSE}}}, 4.0),
    "speed with kinks": (
        {"structure": KANE, "motion": {"type": "table", "table": KINKS, "interpolation": "linear"}},
        5.0,
    ),
    "free hub": ({"structure": KANE, "motion": HUB}, 4.0),
    "gust": (
        {"structure": KANE, "motion": {"type": "constant", "speed": 3.0}, "loads": {"distributed": {"table": GUST}}},
        4.0,
    ),
    "tip release": ({"structure": KANE, "motion": STILL, "initial": {"tip_displacement": 1.0}}, 2.0),
    "plate": (
        {"structure": PLATE, "mesh": PLATE_MESH, "motion": SWUNG},
        0.6,
    ),
    "plate, linear": (
        {"structure": PLATE, "mesh": PLATE_MESH, "motion": SWUNG} | {"model": {"theory": "consistent_linear"}},
        0.6,
    ),
}
ROWS, FINEST, KNOWN, LEVELS = 20, 1e-8, 1e-6, (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)


class Bench:
    """One scene, compiled once.

    Args:
        name: of the scene.
    """

    def __init__(self, name: str):
        tables, self.end = SCENES[name]
        initial = tables.get("initial", {})
        tables = {"mesh": {"elements": 4}} | {k: v for k, v in tables.items() if k != "initial"}
        self.problem = Problem.of(tables | {"time": {"end": self.end, "step": self.end / ROWS}})
        self.system = self.problem.system()
        self.start = None
        if "tip_displacement" in initial:
            self.start = static_tip_shape(self.problem, initial["tip_displacement"], Newton(), self.system.comm)
        names = self.system.structure.components
        self._displacements = [i for i, component in enumerate(names) if component.startswith("u")]

    def march(self, scheme: str, number: int) -> tuple[np.ndarray, float]:
        """Return the tip's displacement at the rows, shape (rows, components), and CPU time (s), of so many steps."""
        started, rows = process_time(), []
        steps = Steps(self.end, self.end / number)
        for i, state in enumerate(March(self.system, schemes[scheme](), steps, Newton(), self.start)):
            if i % (number // ROWS) == 0:
                rows.append(self.system.tip(state.q, state.t)[self._displacements])
        return np.array(rows), process_time() - started


def sweep(bench: Bench, names: list[str], most: float) -> dict[str, list[tuple[int, np.ndarray, float]]]:
    """Return scheme ↦ (steps, tip, CPU s) of all marches, those of all schemes in turn."""
    out: dict[str, list[tuple[int, np.ndarray, float]]] = {name: [] for name in names}
    number, going = ROWS, set(names)
    while going:
        for name in [n for n in names if n in going]:
            try:
                tip, seconds = bench.march(name, number)
            except ComputationError as error:
                print(f"{name} in {number} steps: {error}", file=sys.stderr)
                going -= {name} if number > 100 * ROWS else set()
                continue
            out[name].append((number, tip, seconds))
            settled = len(out[name]) > 1 and distance(tip, out[name][-2][1]) < 0.3 * FINEST
            if settled or (seconds > most / 2 and number > 10 * ROWS):
                going.remove(name)
        number *= 2
    return out


def refine(bench: Bench, marches: list[tuple[int, np.ndarray, float]], seconds: float) -> list[np.ndarray]:
    """Return the two finest motions of the tip by `esdirk4`, of which the last is the reference.

    Args:
        bench: of the scene.
        marches: those that the method has made.
        seconds: CPU time that a march may take.
    """
    (number, *_), tips, spent = marches[-1], [tip for _, tip, _ in marches[-2:]], marches[-1][2]
    while 2 * spent < seconds and (len(tips) < 2 or distance(tips[-2], tips[-1]) > KNOWN):
        number *= 2
        tip, spent = bench.march("esdirk4", number)
        tips = [tips[-1], tip]
    return tips


def distance(tip: np.ndarray, exact: np.ndarray) -> float:
    """Return the largest distance of two motions of the tip, relative to the largest displacement of the second."""
    return float(np.linalg.norm(tip - exact, axis=1).max() / np.linalg.norm(exact, axis=1).max())


def judged(
    marches: Mapping[str, list[tuple[int, np.ndarray, float]]], finest: list[np.ndarray]
) -> tuple[dict[str, np.ndarray], float]:
    """Return scheme ↦ rows (steps, error, CPU s), and the error of the reference, the last of the finest motions."""
    exact, others = finest[-1], finest[:-1]
    own = min((distance(tip, exact) for tip in others), default=1.0)
    return {
        name: np.array([(n, distance(tip, exact), s) for n, tip, s in found if distance(tip, exact) > own])
        for name, found in marches.items()
    }, own


def at_level(rows: np.ndarray, level: float) -> str:
    """Return the CPU time (s) at an error, of the march that is first good enough and the one before it."""
    good = np.flatnonzero(rows[:, 1] <= level) if len(rows) else []
    if not len(good):
        return "–"
    i = int(good[0])
    if i == 0:
        return f"≤ {rows[0, 2]:.3f}"
    (_, e0, s0), (_, e1, s1) = rows[i - 1 : i + 1]
    share = np.log(e0 / level) / np.log(e0 / e1)
    return f"{np.exp(np.log(s0) + share * np.log(s1 / s0)):.3f}"


def order(rows: np.ndarray) -> str:
    """Return the order observed over the last two halvings."""
    if len(rows) < 3:
        return "–"
    return f"{np.log2(rows[-3, 1] / rows[-1, 1]) / 2:.1f}"


def draw(results: dict[str, dict[str, np.ndarray]], path: Path) -> None:
    """Draw CPU time over error, one panel a scene."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    columns = min(len(results), 5)
    lines = -(-len(results) // columns)
    figure, axes = plt.subplots(lines, columns, figsize=(3.2 * columns, 3.0 * lines), squeeze=False, sharex=True)
    for axis in axes.ravel()[len(results) :]:
        axis.set_visible(False)
    for axis, (scene, found) in zip(axes.ravel(), results.items(), strict=False):
        for marker, (name, rows) in zip("os^vd", found.items(), strict=False):
            if len(rows):
                axis.loglog(rows[:, 1], rows[:, 2], marker + "-", ms=3, lw=1, label=name)
        axis.set_title(scene, fontsize=9)
        axis.set_xlim(0.3, 1e-9)
        axis.grid(alpha=0.3)
    for axis in axes[-1]:
        axis.set_xlabel("largest error of the tip, relative")
    for axis in axes[:, 0]:
        axis.set_ylabel("CPU time of the march (s)")
    axes[0, 0].legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main() -> None:
    """Print the table, and draw the figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-s", "--scenes", nargs="+", default=list(SCENES))
    parser.add_argument("-o", "--figure", type=Path)
    parser.add_argument("--seconds", type=float, default=2.0)
    parser.add_argument("--truth", type=float, default=0.0)
    given = parser.parse_args()
    names, results = list(schemes.names), {}
    print("| scene | scheme | order |" + "".join(f" {level:.0e} |" for level in LEVELS))
    print("|---|---|---|" + "---|" * len(LEVELS))
    for scene in given.scenes:
        bench = Bench(scene)
        marches = sweep(bench, names, given.seconds)
        results[scene], own = judged(marches, refine(bench, marches["esdirk4"], given.truth))
        for name, rows in results[scene].items():
            cells = [at_level(rows, level) if level > own else "?" for level in LEVELS]
            print(f"| {scene} | `{name}` | {order(rows)} | {' | '.join(cells)} |", flush=True)
    if given.figure is not None:
        draw(results, given.figure)


if __name__ == "__main__":
    main()
