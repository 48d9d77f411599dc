"""What is left out leaves nothing: unknowns, integrals, set-up and time a step with it and without, in one run.

    python3 benchmarks/left_out.py [CASE …]

Each case is computed as it is, without unknowns that nothing moves, and with model.all_unknowns = true, turn by turn in
one process; the least of several CPU times counts. A step is the difference of a long and a short history, so it has
all that happens in a step in it; "rows" is what a row of the history costs, with its energies. Matrix and factor are
those of one step at the end, and of the linear plate, which keeps its factor, of one factorisation and one solution.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np

from rotfem import Scene, run
from rotfem.commands.problem import Problem
from rotfem.equations.compiled import compile_system
from rotfem.numerics.linear import DirectSolver
from rotfem.structures.symmetry import inactive_unknowns

BEAM: dict[str, Any] = {
    "type": "spatial_beam",
    "length": 10.0,
    "section": {
        **{"EA": 2.8e7, "GA2": 1.0e7, "GA3": 1.0e7, "GJ": 1.0e4, "EI2": 1.4e4, "EI3": 1.4e4},
        **{"mass_per_length": 1.2, "rotary_inertia2": 6.0e-4, "rotary_inertia3": 6.0e-4},
    },
}
PLATE = {"type": "plate", "length": 2.0, "width": 1.0, "thickness": 0.01, "E": 7e10, "nu": 0.3, "rho": 2700.0}
FLAT = {"type": "planar_beam", "length": 10.0, "section": {"EA": 2.8e7, "GA": 1e7, "EI": 1.4e4, "mass_per_length": 1.2}}
FLAT["section"]["rotary_inertia"] = 6.0e-4  # type: ignore[index]
SPIN_UP = {"type": "spin_up", "speed": 6.0, "duration": 15.0}
GUST = {"distributed": {"over_time": [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 20.0], [2.0, 0.0, 0.0, 0.0]]}}
STILL = {"type": "constant", "speed": 0.0}

#: How often each history is run, and steps between rows where these are not to count.
TURNS, SELDOM = 5, 10**9


@dataclass(frozen=True)
class Case:
    """A scene with the numbers of steps of its short and its long history."""

    structure: dict[str, Any]
    motion: dict[str, Any]
    theory: str
    elements: Any
    steps: tuple[int, int]
    loads: dict[str, Any]

    def scene(self, steps: int, every: int, **model: Any) -> Scene:
        """Return the scene of so many steps of 0.01 s, with a row after every so many."""
        time = {"end": 0.01 * steps, "step": 0.01, "output_every": every}
        data = {"structure": self.structure, "motion": self.motion, "mesh": {"elements": self.elements}}
        data |= {"loads": self.loads, "time": time, "output": {"error": False}}
        return Scene.from_dict(data | {"model": {"theory": self.theory, **model}})


CASES = {
    "spatial beam in a plane, reissner": Case(BEAM, SPIN_UP, "reissner", 4, (700, 2100), {}),
    "spatial beam in a plane, consistent_linear": Case(BEAM, SPIN_UP, "consistent_linear", 4, (700, 2100), {}),
    "plate that bends, linear": Case(PLATE, STILL, "linear", [24, 16], (20, 220), GUST),
    "plate in its plane, reissner": Case(PLATE, SPIN_UP, "reissner", [12, 6], (40, 80), {}),
    "planar beam, reissner": Case(FLAT, SPIN_UP, "reissner", 4, (700, 2100), {}),
}


def seconds(scenes: dict[Any, Scene]) -> dict[Any, tuple[float, dict[str, Any]]]:
    """Return the least CPU time (s) of the run of each scene, and its summary."""
    best: dict[Any, tuple[float, dict[str, Any]]] = {}
    for _ in range(TURNS):
        for key, scene in scenes.items():
            started = process_time()
            summary = run(scene).summary
            spent = process_time() - started
            if key not in best or spent < best[key][0]:
                best[key] = spent, summary
    return best


def factor_and_solve(scene: Scene, leaves: bool) -> tuple[float, float]:
    """Return CPU time (ms) of a factorisation of a step's matrix, and of a solution."""
    problem = Problem.of(scene)
    system = compile_system(problem.replace(inactive=inactive_unknowns(problem)) if leaves else problem)
    system.set_time(0.5)
    system.set_state(system.zeros(), system.zeros(), system.zeros())
    A, b = system.matrix(1.0, 1e2, 1e5, 1.0), system.residual().copy()
    best = [np.inf, np.inf]
    for _ in range(5):
        started, solver = process_time(), DirectSolver(A)
        solver.solve(b)
        both = process_time() - started
        solver.solve(b)
        solved = process_time() - started - both
        best = [min(best[0], both - solved), min(best[1], solved)]
    return 1e3 * best[0], 1e3 * best[1]


def rows(name: str, case: Case) -> list[str]:
    """Return the lines of the table of a case: with all unknowns, and without those that nothing moves."""
    few, many = case.steps
    scenes = {
        (everything, which): case.scene(steps, every, all_unknowns=everything)
        for which, steps, every in (("short", few, SELDOM), ("long", many, SELDOM), ("rows", many, 1))
        for everything in (True, False)
    }
    found, lines = seconds(scenes), []
    for everything in (True, False):
        short, long, often = (found[everything, which][0] for which in ("short", "long", "rows"))
        summary, step = found[everything, "long"][1], (long - short) / (many - few)
        factor, solve = factor_and_solve(case.scene(many, 1), not everything)
        out = "none" if everything else ", ".join(summary.get("left_out", {}).get("unknowns", ["none"]))
        counts = f"{summary['dofs']:6} {summary['integrals']['F']:3} {summary['integrals']['J']:3}"
        times = f"{1e3 * (short - few * step):7.0f} {1e3 * step:8.4f} {1e3 * (often - long) / many:8.4f}"
        lines.append(f"{name:44} {out:24} {counts} {times} {factor:8.3f} {solve:8.3f}")
    return lines


def main() -> None:
    """Print the table."""
    print(f"{'case':44} {'left out':24}   dofs   F   J  set-up     step      row   factor    solve  (ms)")
    for name in sys.argv[1:] or CASES:
        for line in rows(name, CASES[name]):
            print(line, flush=True)


if __name__ == "__main__":
    main()
