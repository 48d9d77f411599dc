"""Answers of rows on several processes: `mpirun -n 2 python -m tests.pairs.on_ranks ROWS.json FOLDER`.

The columns of row i are in FOLDER/i.npz, or why there are none in FOLDER/i.txt, which is written when it is begun. What
is there is not done again, so that a row in which processes are lost costs no other.
"""

from __future__ import annotations

import json
import sys
import traceback
from pathlib import Path

import numpy as np
from mpi4py import MPI

from tests.pairs.answers import answer, columns_of
from tests.pairs.scenes import mesh_file


def main(rows: Path, folder: Path) -> None:
    comm = MPI.COMM_WORLD
    if comm.rank == 0:
        mesh_file(folder)
    for i, row in enumerate(json.loads(rows.read_text())):
        said, done = folder / f"{i}.txt", folder / f"{i}.npz"
        if comm.bcast(said.exists() or done.exists()):
            continue
        if comm.rank == 0:
            said.write_text("processes were lost, or waited for each other")
        try:
            columns, why = columns_of(answer(row, folder)), ""
        except Exception as error:
            columns, why = {}, "".join(traceback.format_exception_only(error))
            why += "".join(traceback.format_tb(error.__traceback__)[-2:])
        failed = [f"process {rank}: {text}" for rank, text in enumerate(comm.allgather(why)) if text]
        if comm.rank == 0:
            if failed:
                said.write_text("\n".join(failed))
            else:
                np.savez(done, **columns)
                said.unlink()


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
