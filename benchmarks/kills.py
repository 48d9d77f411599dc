"""What is lost when a run is killed: SIGKILL at random moments, resumed, beside a run that was not.

For example `./with-fenicsx python3 benchmarks/kills.py --kills 50`. Runs of a beam and a plate on one and two processes
are killed in turn, each several times over, and resumed until they are done. Printed are the largest difference of any
column of the history from the unbroken run on as many processes, relative to the largest value of the column, the time
that had to be computed again, and what the folders held after the kills.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

from rotfem.results.checkpoint_file import read_checkpoint
from rotfem.results.files import read_csv
from tests.beams import BEAM_TABLE, PLATE_TABLES
from tests.histories import difference

BEAM = f"""\
{BEAM_TABLE}[motion]
type = "spin_up"
speed = 6.0
duration = 15.0
[mesh]
elements = 4
[time]
end = 12.0
step = 0.01
"""
PLATE = f"""\
{PLATE_TABLES}[mesh]
elements = [5, 3]
[time]
end = 0.3
step = 1e-3
"""


def start(folder: Path, ranks: int, name: str, *options: str) -> subprocess.Popen[bytes]:
    """Start a run in a session of its own, so that all of it can be killed."""
    ahead = ["mpirun", "-n", str(ranks), "--oversubscribe"] if ranks > 1 else []
    command = [*ahead, sys.executable, "-m", "rotfem", "run", f"{name}.toml", "--no-plots", "-q", *options]
    return subprocess.Popen(command, cwd=folder, start_new_session=True, stderr=subprocess.DEVNULL)


def kill(program: subprocess.Popen[bytes]) -> None:
    """Kill a program and the processes that it has started, at once."""
    listed = subprocess.run(["ps", "-o", "pid=", "--ppid", str(program.pid)], capture_output=True, text=True).stdout
    for pid in [*map(int, listed.split()), program.pid]:
        try:
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            continue
    program.wait()


def reached(out: Path) -> tuple[str, float, float]:
    """Return status, and time (s) that the history and the checkpoint of a folder have got to."""
    status = json.loads((out / "summary.json").read_text())["status"] if (out / "summary.json").exists() else "nothing"
    rows = read_csv(out / "history.csv")["t"] if (out / "history.csv").exists() else np.zeros(0)
    saved = 0.0
    if (out / "checkpoint.npz").exists():
        saved = float(read_checkpoint(out / "checkpoint.npz")["t"])
    return status, float(rows[-1]) if len(rows) else 0.0, saved


def broken(folder: Path, name: str, ranks: int, kills: int, whole: float) -> tuple[Counter[str], list[float]]:
    """Kill a run that takes `whole` seconds so many times and resume it; return what was found, and times lost (s)."""
    out, seen, lost, done = folder / f"{name}-{ranks}-cut", Counter[str](), [], 0
    while True:
        resume = ["--resume"] if (out / "checkpoint.npz").exists() else []
        program = start(folder, ranks, name, "-o", str(out), "--checkpoint", "20", *resume)
        if done == kills:
            assert program.wait() == 0
            return seen, lost
        try:
            program.wait(timeout=random.uniform(0.05, 0.9) * whole)
            assert program.returncode == 0, "a run that was resumed failed"
            shutil.rmtree(out)  # done before it was killed: afresh
        except subprocess.TimeoutExpired:
            kill(program)
            done += 1
            status, rows, saved = reached(out) if out.is_dir() else ("nothing", 0.0, 0.0)
            seen[status] += 1
            lost.append(max(rows - saved, 0.0))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=11)
    arguments = parser.parse_args()
    random.seed(arguments.seed)
    kinds = [(name, ranks) for name in ("beam", "plate") for ranks in (1, 2)]
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        (folder / "beam.toml").write_text(BEAM)
        (folder / "plate.toml").write_text(PLATE)
        for i, (name, ranks) in enumerate(kinds):
            kills = arguments.kills // 4 + int(i < arguments.kills % 4)
            out = folder / f"{name}-{ranks}"
            start(folder, ranks, name, "-o", str(out)).wait()  # compiles
            begun = time.monotonic()
            assert start(folder, ranks, name, "-o", str(out)).wait() == 0
            seen, lost = broken(folder, name, ranks, kills, time.monotonic() - begun)
            apart = difference(*(read_csv(folder / f"{name}-{ranks}{x}" / "history.csv") for x in ("-cut", "")))
            print(
                f"{name} on {ranks}: {kills} kills, folders then {dict(seen)}; "
                f"largest difference {apart:.1e}, "
                f"computed again at most {max(lost, default=0.0):.3g} s of motion",
                flush=True,
            )


if __name__ == "__main__":
    main()
