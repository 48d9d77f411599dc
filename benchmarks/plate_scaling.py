"""Time and memory of the modes of a spinning square plate against its size, and how they grow.

    ./with-fenicsx python3 benchmarks/plate_scaling.py [--cells 22 70 223] [--ranks 1 2]

Every size runs in a process of its own. Columns: seconds in assembly (with the solution for the prestress),
factorisation, eigensolver and all, and the largest memory of a process (GB). The exponent is that of the last two
sizes.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import subprocess
import sys
from typing import Any

COLUMNS = ("assemble", "factor", "eigen", "total", "memory")


def scene(cells: int) -> dict[str, Any]:
    """Return the square cantilever of t/a = 0.01, γ = 5, five modes, with cells × cells quadrilaterals."""
    structure = {"length": 1.0, "width": 1.0, "thickness": 0.01, "hub_radius": 1.0, "E": 70e9, "nu": 0.3, "rho": 2700.0}
    return {
        "structure": {"type": "plate", **structure},
        "motion": {"type": "constant", "speed": 77.0, "axis": [0, 0, 1]},
        "model": {"theory": "consistent_linear"},
        "mesh": {"elements": [cells, cells]},
        "modes": {"count": 5},
    }


def one(cells: int) -> None:
    """Compute one size and print its row as JSON from the first rank."""
    from mpi4py import MPI

    import rotfem

    rotfem.modes(scene(2))  # compiles the forms
    summary = rotfem.modes(scene(cells)).summary
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    memory = MPI.COMM_WORLD.allreduce(memory, op=MPI.MAX)
    if MPI.COMM_WORLD.rank == 0:
        row = {**summary["timings"], "memory": memory, "dofs": summary["dofs"]}
        print(json.dumps(row | {"first": summary["modes"][0]["frequency"]}))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, nargs="+", default=[22, 70])
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        one(arguments.one)
        return
    print(f"{'ranks':>5} {'dofs':>9} " + " ".join(f"{name:>9}" for name in COLUMNS) + f" {'mode 1':>12}")
    for ranks in arguments.ranks:
        rows = []
        for cells in arguments.cells:
            start = ["mpirun", "-n", str(ranks), "--oversubscribe"] if ranks > 1 else []
            command = [*start, sys.executable, os.path.abspath(__file__), "--one", str(cells)]
            done = subprocess.run(command, capture_output=True, text=True, check=True)
            rows.append(json.loads(done.stdout.splitlines()[-1]))
            row = rows[-1]
            print(
                f"{ranks:>5} {row['dofs']:>9} "
                + " ".join(f"{row[name]:>9.2f}" for name in COLUMNS)
                + f" {row['first']:>12.7f}",
                flush=True,
            )
        if len(rows) > 1:
            a, b = rows[-2:]
            grown = math.log(b["dofs"] / a["dofs"])
            print(f"{'exponent':>15} " + " ".join(f"{math.log(b[n] / a[n]) / grown:>9.2f}" for n in COLUMNS))


if __name__ == "__main__":
    main()
