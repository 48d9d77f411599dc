"""The case that pyBModes can compute; run by `run.py` in an environment that has it."""

from __future__ import annotations

import json
import sys
from time import process_time
from typing import Any

import numpy as np
from pybmodes.campbell import campbell_sweep
from pybmodes.models import RotatingBlade


def blade(main: str, elements: int, speeds: list[float]) -> tuple[float, Any]:
    """Return seconds, and five frequencies at each speed (rad/s) of the blade of an ElastoDyn main file."""
    model = RotatingBlade.from_elastodyn(main, elastodyn_compatible=False, n_nodes=elements + 1)
    started = process_time()
    found = campbell_sweep(model, np.asarray(speeds) * 60 / (2 * np.pi), n_blade_modes=5)
    return process_time() - started, (2 * np.pi * np.sort(found.frequencies[:, :5], axis=1)).tolist()


if __name__ == "__main__":
    case, arguments = globals()[sys.argv[1]], json.loads(sys.argv[2])
    case(**arguments)  # the first time is not measured
    seconds, values = case(**arguments)
    print(json.dumps({"seconds": seconds, "values": values}))
