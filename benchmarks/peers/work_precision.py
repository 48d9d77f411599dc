"""What an error costs in time, for a beam in space: rotfem and Exudyn; a table, work_precision.csv and a figure.

    ./with-fenicsx python3 benchmarks/peers/work_precision.py [-o FOLDER] [--repetitions 3]

A beam of 10 m that its weight bends by 1 m spins up to 6 rad/s about a vertical axis (`spatial` in the programs'
scripts). Its section is the same in all directions, so that it does not twist: Exudyn's cubic cable elements suffice.
Errors are the largest distance of the tip from the reference at every half second, by the largest displacement. The
reference is rotfem's finest answer; the least error of Exudyn's curve says how far they agree. Times are CPU times.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path
from typing import Any

import numpy as np
from run import install, once

END = 20.0
REFERENCE = {"elements": 4, "degree": 6, "steps": 3200, "scheme": "esdirk4"}

#: Program ↦ what is computed: curves from coarse to fine, mesh and steps refined together.
SETTINGS: dict[str, list[dict[str, Any]]] = {
    "rotfem": [
        {"elements": elements, "degree": degree, "steps": steps, "scheme": scheme}
        for elements, degree, steps, scheme in (
            (2, 4, 100, "esdirk4"),
            (2, 4, 200, "esdirk4"),
            (2, 5, 400, "esdirk4"),
            (3, 5, 800, "esdirk4"),
            (3, 5, 1600, "esdirk4"),
        )
    ],
    "exudyn": [
        {"elements": elements, "steps": steps, "tolerance": tolerance}
        for elements, steps, tolerance in (
            (5, 2000, 1e-6),
            (6, 2000, 1e-6),
            (8, 4000, 1e-7),
            (12, 8000, 1e-8),
            (16, 16000, 1e-8),
            (24, 32000, 1e-8),
        )
    ],
}


def tip(program: str, setting: dict[str, Any]) -> tuple[float, Any]:
    """Return seconds, and the displacement at every half second, (instants, 3)."""
    done = once(program, "spatial", setting)
    rows = np.array(done["values"])
    return done["seconds"], np.column_stack(
        [np.interp(np.arange(0.5, END + 0.1, 0.5), rows[:, 0], u) for u in rows.T[1:]]
    )


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Draw both curves."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axis = plt.subplots(figsize=(6.0, 4.0))
    for name in dict.fromkeys(row["curve"] for row in rows):
        points = sorted((row["seconds"], row["error"]) for row in rows if row["curve"] == name)
        axis.loglog(*zip(*points, strict=True), "o-", label=name)
    axis.set(xlabel="time of the loop (s)", ylabel="error of the tip / largest displacement (–)")
    axis.grid(which="both", alpha=0.3)
    axis.legend()
    figure.tight_layout()
    figure.savefig(path, dpi=130)


def main() -> None:
    """Print the table, and write work_precision.csv and work_precision.png."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--folder", type=Path, default=Path("results/peers"))
    parser.add_argument("--repetitions", type=int, default=3)
    given = parser.parse_args()
    if why := install().get("exudyn"):
        raise SystemExit(f"Exudyn is not there: {why}")
    _, reference = tip("rotfem", REFERENCE)
    size = np.linalg.norm(reference, axis=1).max()
    rows: list[dict[str, Any]] = []
    print("| program | setting | least s | error |\n|---|---|---|---|")
    for program, settings in SETTINGS.items():
        for setting in settings:
            found = [tip(program, setting) for _ in range(given.repetitions)]
            error = np.linalg.norm(found[0][1] - reference, axis=1).max() / size
            text = ", ".join(f"{key} {value}" for key, value in setting.items())
            name = " ".join([program, *([setting["scheme"]] if "scheme" in setting else [])])
            rows.append({"curve": name, "setting": text, "seconds": min(s for s, _ in found), "error": float(error)})
            print(f"| {name} | {text} | {rows[-1]['seconds']:.3g} | {error:.1e} |", flush=True)
    given.folder.mkdir(parents=True, exist_ok=True)
    with (given.folder / "work_precision.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    draw(rows, given.folder / "work_precision.png")


if __name__ == "__main__":
    main()
