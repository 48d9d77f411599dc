"""rotfem and other programs on the same cases, in turn, with their errors: a table, peers.csv and peers.png.

    ./with-fenicsx python3 benchmarks/peers/run.py [-o FOLDER] [--repetitions 5] [--case NAME …] [--search]

The other programs are installed from PyPI into an environment of their own, `peers` in the cache folder. Every
repetition of a case runs each program once, in a process of its own, one thread; in it the case runs twice, and the
second time is measured, in CPU time: of histories the time loop, of frequencies all of it. Errors are relative: of a
history the largest distance of the tip at common instants by its largest displacement, of frequencies the largest one
at the first and the last speed. References share no code with any of the programs (`tests/reference`); for the blade it
is pyBModes with 800 elements (`docs/blades.md`), for the rotors ROSS with 48; for the arm and the free hub it is
rotfem's own finest answer. What each program is given (mesh, steps,
tolerance) is in `CASES`: of histories what `--search` finds, the cheapest setting of one grid of elements and steps for
both that meets the error in the case's name; of frequencies a mesh each of about one error.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import platform
import subprocess
import sys
import venv
from dataclasses import dataclass, field
from datetime import date
from functools import cache
from itertools import product
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

HERE = Path(__file__).parent
REFERENCE = HERE.parent.parent / "tests" / "reference"
FOLDER = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "rotfem" / "peers"

#: Programs, and what pip is asked for; None is this one.
PROGRAMS = {"rotfem": None, "exudyn": "exudyn", "pybmodes": "pybmodes", "ross": "ross-rotordynamics==2.3.0 plotly<6"}

#: Programs that are not run, and why.
MISSING = {
    "CalculiX": "Debian 13 has no package of it (calculix-ccx), PyPI neither",
}

SPEEDS = [float(s) for s in np.linspace(0.0, 12.0, 50)]
WHIRL = [float(s) for s in np.linspace(4.0, 400.0, 100)]
#: Bearings, N/m and N·s/m; those of the second couple.
BEARING = {"kxx": 1e6, "kyy": 8e5, "cxx": 200.0, "cyy": 150.0}
COUPLED = {"kxx": 1.2e6, "kxy": 3e5, "kyx": -6e5, "kyy": 2e6, "cxx": 3e3, "cxy": -8e2, "cyx": -7e2, "cyy": 5e3}
RATED = 12.1 * np.pi / 30  # rad/s
UNIT = np.sqrt(70e9 * 0.01**2 / (12 * (1 - 0.3**2) * 2700.0))  # of the plate, rad/s
DECK = "nrel5mw_land/NRELOffshrBsline5MW_Onshore_ElastoDyn.dat"

#: Case ↦ (function of the program's script, what it is called with), by program, or why it has none.
CASES: dict[str, dict[str, tuple[str, dict[str, Any]] | str]] = {
    "spin-up to 1e-3": {
        "rotfem": ("spin_up", {"elements": 1, "steps": 88, "scheme": "esdirk4", "degree": 4}),
        "exudyn": ("spin_up", {"elements": 5, "steps": 2000, "tolerance": 1e-6}),
    },
    "spin-up to 1e-4": {
        "rotfem": ("spin_up", {"elements": 1, "steps": 120, "scheme": "esdirk4", "degree": 4}),
        "exudyn": ("spin_up", {"elements": 10, "steps": 6000, "tolerance": 1e-7}),
    },
    "spin-up to 1e-6": {
        "rotfem": ("spin_up", {"elements": 1, "steps": 400, "scheme": "esdirk4", "degree": 6}),
        "exudyn": "its cubic elements have no shear, which is 4e-5 here; those with shear are linear",
    },
    "spin-up, accuracy = 1e-4": {
        "rotfem": ("accuracy", {"wanted": 1e-4}),
        "exudyn": "it does not choose mesh and steps",
    },
    "arm in space to 1e-3": {
        "rotfem": ("arm", {"elements": 1, "steps": 40, "scheme": "esdirk4", "degree": 4, "tolerance": 1e-7}),
        "exudyn": ("arm", {"elements": 6, "steps": 400, "tolerance": 1e-6}),
    },
    "free hub to 1e-3": {
        "rotfem": ("hub", {"elements": 3, "steps": 60, "scheme": "esdirk4", "degree": 5, "tolerance": 1e-7}),
        "exudyn": ("hub", {"elements": 3, "steps": 400, "tolerance": 1e-6}),
    },
    "lag frequencies, 50 speeds": {
        "rotfem": ("lag", {"elements": 4, "speeds": SPEEDS}),
        "exudyn": ("lag", {"elements": 8, "speeds": SPEEDS}),
    },
    "plate 6×6, 3 speeds × 5 modes": {
        "rotfem": ("plate", {"cells": 6, "speeds": [0.0, 2.0 * UNIT, 10.0 * UNIT]}),
        "exudyn": ("plate", {"cells": 6, "speeds": [0.0, 2.0 * UNIT, 10.0 * UNIT]}),
    },
    "5 MW blade, 50 speeds": {
        "rotfem": ("blade", {"elements": 16, "speeds": [float(s) for s in np.linspace(0.0, RATED, 50)]}),
        "pybmodes": ("blade", {"elements": 100, "speeds": [float(s) for s in np.linspace(0.0, RATED, 50)]}),
    },
    "rotor, whirl at 100 speeds": {
        "rotfem": ("whirl", {"elements": 3, "bearing": BEARING, "speeds": WHIRL}),
        "ross": ("whirl", {"elements": 12, "bearing": BEARING, "speeds": WHIRL}),
    },
    "rotor, coupled bearings, whirl": {
        "rotfem": ("whirl", {"elements": 3, "bearing": COUPLED, "speeds": WHIRL}),
        "ross": ("whirl", {"elements": 12, "bearing": COUPLED, "speeds": WHIRL}),
    },
    "rotor, coupled bearings, unbalance": {
        "rotfem": ("unbalance", {"elements": 3, "bearing": COUPLED, "speeds": WHIRL}),
        "ross": ("unbalance", {"elements": 12, "bearing": COUPLED, "speeds": WHIRL}),
    },
}


#: Histories whose settings are searched ↦ the error wanted; the elements and steps tried, of both programs.
SEARCHED = {"spin-up to 1e-3": 1e-3, "spin-up to 1e-4": 1e-4, "arm in space to 1e-3": 1e-3, "free hub to 1e-3": 1e-3}
ELEMENTS = (1, 2, 3, 4, 5, 6, 8, 10, 12)
STEPS = (40, 60, 80, 100, 120, 160, 240, 400, 600, 1000, 1500, 2000, 3000, 4000, 6000, 8000, 12000)

#: Program ↦ its other settings tried. Increments of Newton's method are solved to 1e-3 of the error wanted.
OTHERS: dict[str, list[dict[str, Any]]] = {
    "rotfem": [{"scheme": "esdirk4", "degree": degree} for degree in (3, 4, 5)],
    "exudyn": [{}],
}


def searched(case: str, program: str) -> tuple[dict[str, Any], float, float] | None:
    """Return the cheapest setting of the grid that meets the error of a case, its CPU time (s) and its error.

    On every mesh steps are refined until the error is met or the cheapest setting so far is exceeded.
    """
    wanted, best = SEARCHED[case], None
    for other, elements in product(OTHERS[program], ELEMENTS):
        given = CASES[case][program]
        function, fixed = given if not isinstance(given, str) else ("", {})
        tolerance = {"tolerance": (1e-3 if program == "exudyn" else 1e-4) * wanted} if "tolerance" in fixed else {}
        for steps in STEPS:
            setting = {"elements": elements, "steps": steps, **other, **tolerance}
            try:
                done = once(program, function, setting)
            except (RuntimeError, subprocess.TimeoutExpired):
                continue  # Newton's method fails in steps that are too long
            if best is not None and done["seconds"] >= best[1]:
                break
            if (reached := error(case, done["values"])) <= wanted:
                best = setting, done["seconds"], reached
                break
    return best


#: Setting of the reference of an arm and of a free hub.
FINEST = {"elements": 6, "degree": 6, "steps": 1600, "scheme": "esdirk4", "tolerance": 1e-11}


@dataclass
class Measured:
    """What one program has done on a case: seconds of every repetition, the error, or why there is none."""

    seconds: list[float] = field(default_factory=list)
    error: float = np.nan
    why: str = ""


def install() -> dict[str, str]:
    """Make the environment of the other programs; return program ↦ why it is not there."""
    python, missing = FOLDER / "bin" / "python", {}
    if not python.exists():
        venv.create(FOLDER, with_pip=True)
    for program, package in PROGRAMS.items():
        if package is None or subprocess.run([python, "-c", f"import {program}"], capture_output=True).returncode == 0:
            continue
        done = subprocess.run([python, "-m", "pip", "install", "-q", *package.split()], capture_output=True, text=True)
        if done.returncode:
            missing[program] = (done.stderr.strip().splitlines() or ["pip failed"])[-1]
    return missing


def once(program: str, function: str, arguments: dict[str, Any]) -> dict[str, Any]:
    """Run one case in a process; return its seconds and values."""
    python = sys.executable if PROGRAMS[program] is None else FOLDER / "bin" / "python"
    if function == "blade":
        [deck] = FOLDER.glob(f"lib/*/site-packages/pybmodes/_examples/reference_decks/{DECK}")
        arguments = arguments | {"main": str(deck)}
    command = [python, "-W", "ignore", HERE / f"{program}_cases.py", function, json.dumps(arguments)]
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ | threads, timeout=600)
    if done.returncode:
        raise RuntimeError((done.stderr.strip().splitlines() or ["no message"])[-1])
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


@cache
def exact(case: str) -> list[list[float]]:
    """Return rows of t and displacements of the tip, or frequencies (rad/s) at the first and the last speed."""
    if case.startswith("spin-up"):
        table = json.loads((REFERENCE / "spin_up.json").read_text())["reissner"]["table t,u1,u2,alpha"]
        return [[row[0], row[2]] for row in table]
    if case.startswith(("arm", "free hub")):
        values: list[list[float]] = once("rotfem", "arm" if case.startswith("arm") else "hub", FINEST)["values"]
        return values
    if case.startswith("5 MW"):
        hertz = [[0.6777, 1.0864, 1.9543, 4.0090, 4.5556], [0.7291, 1.0954, 2.0135, 4.0315, 4.6100]]
        return [[2 * np.pi * f for f in row] for row in hertz]
    if case.startswith("rotor"):  # ROSS with 48 elements
        if case.endswith("unbalance"):
            return [[2.0742344e-08, 1.8069099e-08], [3.3919672e-05, 5.3011529e-05]]
        if "coupled" in case:
            return [[102.38796, 107.64681, 328.07216, 406.16175], [103.2165, 106.62311, 335.13241, 399.0053]]
        return [[91.799102, 96.292472, 274.59038, 296.56103], [91.646083, 96.401605, 268.1667, 302.78786]]
    if case.startswith("plate"):
        return [plate_at(0.0), plate_at(10.0)]
    with (REFERENCE / "euler_bernoulli_rotating.csv").open(encoding="utf-8") as file:
        rows = {row["eta"]: row for row in csv.DictReader(file) if row["delta"] == "0"}
    return [[float(rows[eta][f"lag{i}"]) for i in (1, 2, 3)] for eta in ("0", "12")]


def plate_at(gamma: float) -> list[float]:
    """Return the frequencies of the plate of thickness 0.01 (rad/s) at a speed in its own unit."""
    name = "plate_mindlin_coriolis.csv" if gamma else "plate_mindlin_h0.01.csv"
    with (REFERENCE / name).open(encoding="utf-8") as file:
        key = {"h/a": "0.01", "spin": "e3", "delta": "0", "gamma": f"{gamma:g}"} | ({} if gamma else {"geo": "vk"})
        rows = [row for row in csv.DictReader(file) if key.items() <= row.items()]
    return [float(UNIT) * float(row["extrapolated"] if not gamma else list(row.values())[-1]) for row in rows][:5]


def error(case: str, values: list[list[float]]) -> float:
    """Return the relative error of what a program has computed."""
    reference = np.array(exact(case))
    if not case.startswith(("spin-up", "arm", "free hub")):
        return float(np.max(np.abs(np.array([values[0], values[-1]]) / reference - 1)))
    (t, *u), (at, *wanted) = np.array(values).T, reference.T
    nearest = np.abs(t[None, :] - at[:, None]).argmin(axis=1)
    there = np.abs(t[nearest] - at) < 1e-6
    off = np.linalg.norm(np.array(u)[:, nearest] - np.array(wanted), axis=0)
    return float(np.max(off[there]) / np.max(np.linalg.norm(wanted, axis=0)))


def measure(case: str, repetitions: int, missing: dict[str, str]) -> dict[str, Measured]:
    """Return program ↦ what was measured; programs take turns."""
    found = {program: Measured() for program in PROGRAMS}
    for program, measured in found.items():
        given = CASES[case].get(program, "it does not compute this")
        measured.why = missing.get(program, given if isinstance(given, str) else "")
    for _ in range(repetitions):
        for program, measured in found.items():
            given = CASES[case].get(program)
            if measured.why or given is None or isinstance(given, str):
                continue
            try:
                done = once(program, *given)
            except (RuntimeError, subprocess.TimeoutExpired) as failure:
                measured.why = str(failure)
                continue
            measured.seconds.append(done["seconds"])
            measured.error = error(case, done["values"])
    return found


def draw(results: dict[str, dict[str, Measured]], path: Path) -> None:
    """Draw the least seconds of every program, a group of bars a case."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axis = plt.subplots(figsize=(8.0, 0.6 + 0.6 * len(results)))
    for i, program in enumerate(PROGRAMS):
        bars = [
            (y + (i - 1) * 0.27, min(r[program].seconds), f"{r[program].error:.0e}")
            for y, r in enumerate(results.values())
            if r[program].seconds
        ]
        axis.barh([b[0] for b in bars], [b[1] for b in bars], height=0.25, label=program)
        for y, seconds, label in bars:
            axis.annotate(label, (seconds, y), xytext=(3, 0), textcoords="offset points", va="center", fontsize=7)
    axis.set_yticks(range(len(results)), list(results))
    axis.set(xscale="log", xlabel="least CPU seconds; the number is the error")
    axis.invert_yaxis()
    axis.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=130)


def main() -> None:
    """Print the table, and write peers.csv and peers.png."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--folder", type=Path, default=Path("results/peers"))
    parser.add_argument("--repetitions", type=int, default=5)
    parser.add_argument("--case", nargs="+", default=list(CASES), choices=list(CASES), metavar="NAME")
    parser.add_argument("--search", action="store_true", help="find the settings of the histories, and do no more")
    given = parser.parse_args()
    missing, results = install(), {}
    if given.search:
        for case, program in product(filter(SEARCHED.__contains__, given.case), OTHERS):
            print(case, program, missing.get(program) or searched(case, program), flush=True)
        return
    print(f"{date.today()}, {platform.processor() or platform.machine()}, {os.cpu_count()} cores, one thread\n")
    print("| case | program | least CPU s | median CPU s | error | rotfem / it |\n|---|---|---|---|---|---|")
    rows: list[dict[str, Any]] = []
    for case in given.case:
        results[case] = measure(case, given.repetitions, missing)
        own = min(results[case]["rotfem"].seconds, default=np.nan)
        for program, m in results[case].items():
            if not m.seconds:
                print(f"| {case} | {program} | – | – | – | {m.why} |", flush=True)
                continue
            row = {"case": case, "program": program, "least": min(m.seconds), "median": median(m.seconds)}
            rows.append(row | {"error": m.error, "ratio": own / min(m.seconds), "repetitions": len(m.seconds)})
            print(
                f"| {case} | {program} | {row['least']:.3g} | {row['median']:.3g} | {m.error:.1e} | "
                f"{rows[-1]['ratio']:.2f} |",
                flush=True,
            )
    print("\n" + "\n".join(f"{program} is not run: {why}." for program, why in (MISSING | missing).items()))
    given.folder.mkdir(parents=True, exist_ok=True)
    with (given.folder / "peers.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]) if rows else ["case"])
        writer.writeheader()
        writer.writerows(rows)
    draw(results, given.folder / "peers.png")


if __name__ == "__main__":
    main()
