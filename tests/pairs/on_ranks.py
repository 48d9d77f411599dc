"""Answers of rows on several processes: `mpirun -n 2 python -m tests.pairs.on_ranks FOLDER` of FOLDER/rows.json."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI

from tests.pairs.answers import answer, columns_of

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    for i, row in enumerate(json.loads((folder / "rows.json").read_text())):
        try:
            columns = columns_of(answer(row, folder))
        except BaseException as error:
            print(f"{row}: {error}", file=sys.stderr, flush=True)
            MPI.COMM_WORLD.Abort(1)
            raise
        if MPI.COMM_WORLD.rank == 0:
            np.savez(folder / f"{i}.npz", **columns)
