"""What is lost when a run is killed: SIGKILL at random moments of the march, resumed, beside a run that was not.

For example `./with-fenicsx python3 benchmarks/kills.py --kills 50`. Runs of a beam and a plate on one and two processes
are killed in turn, each several times over, and resumed until they are done. Printed are the largest difference of the
history from the unbroken run on as many processes, relative to the largest value of the unit, and the time that had to
be computed again.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from rotfem.results.checkpoint_file import read_checkpoint
from rotfem.results.files import read_csv
from rotfem.results.result_set import CHECKPOINT, read_summary
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
end = 40.0
step = 0.01
[output]
error = false
"""
PLATE = f"""\
{PLATE_TABLES}[mesh]
elements = [5, 3]
[time]
end = 1.0
step = 1e-3
[output]
error = false
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


def broken(folder: Path, name: str, ranks: int, kills: int, march: float) -> tuple[int, float]:
    """Kill a run whose march takes so long (s) at random moments of it, and resume it, until it is done.

    Returns:
        Number of kills, and largest time of the motion (s) that was computed again.
    """
    out, lost, done = folder / f"{name}-{ranks}-cut", 0.0, 0
    while True:
        resume = ["--resume"] if (out / CHECKPOINT).exists() else []
        before = (out / "summary.json").stat().st_mtime_ns if out.exists() else 0
        program = start(folder, ranks, name, "-o", str(out), "--checkpoint", "20", *resume)
        while program.poll() is None and not ((out / "summary.json").exists() and _changed(out, before)):
            time.sleep(0.005)
        time.sleep(random.uniform(0.0, 1.5 * march / kills))
        if program.poll() is None and done < kills:
            kill(program)
            done += 1
            assert read_summary(out)["status"] in ("running", "done")
            if (out / CHECKPOINT).exists():
                rows = read_csv(out / "history.csv")["t"]
                lost = max([lost, *(rows[-1:] - read_checkpoint(out / CHECKPOINT)["t"])])
        elif program.wait() == 0:
            return done, lost
        else:
            raise SystemExit(f"{name} on {ranks}: a run that was resumed failed")


def _changed(out: Path, before: int) -> bool:
    return (out / "summary.json").stat().st_mtime_ns != before


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=11)
    arguments = parser.parse_args()
    random.seed(arguments.seed)
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        (folder / "beam.toml").write_text(BEAM)
        (folder / "plate.toml").write_text(PLATE)
        for name, ranks in [(name, ranks) for name in ("beam", "plate") for ranks in (1, 2)]:
            whole = folder / f"{name}-{ranks}"
            for _ in range(2):  # the first one compiles
                assert start(folder, ranks, name, "-o", str(whole)).wait() == 0
            timings = json.loads((whole / "summary.json").read_text())["timings"]
            march = timings["total"] - timings["compile"]
            kills, lost = broken(folder, name, ranks, max(1, arguments.kills // 4), march)
            apart = difference(*(read_csv(folder / f"{whole.name}{x}" / "history.csv") for x in ("-cut", "")))
            print(f"{name} on {ranks}: {kills} kills, difference {apart:.1e}, {lost:.3g} s computed again", flush=True)


if __name__ == "__main__":
    main()
