#!/usr/bin/env bash
# Modes and motion of a plate on one and on several processes: are they the same?
#
#   demos/plate_mpi.sh [PROCESSES] [NX NY] [END]
#
# computes demos/rotating_plate.toml with NX × NY elements [32 4] up to the time END [1 s], on one and on PROCESSES [2]
# processes, and prints the times and the largest relative difference of the frequencies, and of the tip's deflection.
# The status is 1 if one of them is above 1e-8.
set -euo pipefail

here=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")" && pwd)
processes=${1:-2} nx=${2:-32} ny=${3:-4} end=${4:-1.0}
out=$(mktemp -d)
trap 'rm -rf -- "$out"' EXIT

export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 # the processes share the cores
export OMPI_MCA_mpi_yield_when_idle=1           # should there be fewer cores than processes
((EUID != 0)) || export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1

for n in 1 "$processes"; do
    for command in modes run; do
        "$here/../with-fenicsx" mpirun -n "$n" --oversubscribe rotfem "$command" "$here/rotating_plate.toml" \
            --set "mesh.elements=[$nx, $ny]" --set "time.end=$end" --set solver.increment_tolerance=1e-12 \
            --no-plots --no-advice -q -o "$out/$command$n"
    done
done

"$here/../with-fenicsx" python3 - "$out" "$processes" <<'END'
import csv
import json
import sys
from pathlib import Path

out, ranks = Path(sys.argv[1]), ("1", sys.argv[2])
summaries = [{c: json.loads((out / f"{c}{n}" / "summary.json").read_text()) for c in ("modes", "run")} for n in ranks]
for n, s in zip(ranks, summaries):
    seconds = ", ".join(f"{c} {s[c]['timings']['total']:.2f} s" for c in s)
    print(f"{s['modes']['ranks']} process(es), {s['modes']['dofs']} dofs: {seconds}")
f, g = ([row["frequency"] for row in s["modes"]["modes"]] for s in summaries)
frequencies = max(abs(b / a - 1) for a, b in zip(f, g, strict=True))
u, v = ([float(row["tip_u3"]) for row in csv.DictReader(open(out / f"run{n}" / "history.csv"))] for n in ranks)
deflection = max(abs(b - a) for a, b in zip(u, v, strict=True)) / max(map(abs, u))
print(f"largest relative difference of {len(f)} frequencies: {frequencies:.1e}")
print(f"largest difference of the tip's deflection, relative to {max(map(abs, u)):.4g} m: {deflection:.1e}")
sys.exit(0 if max(frequencies, deflection) <= 1e-8 else 1)
END
