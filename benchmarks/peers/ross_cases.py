"""The cases that ROSS can compute; run by `run.py` in an environment that has it."""

from __future__ import annotations

import json
import sys
from time import process_time
from typing import Any

import numpy as np
import ross

STEEL = ross.Material("Steel", rho=7810, E=211e9, G_s=81.2e9)


def rotor(elements: int, bearing: dict[str, float]) -> Any:
    """Return its example rotor with other bearings, its shaft of so many elements, a multiple of 6."""
    shaft = [ross.ShaftElement(L=1.5 / elements, idl=0.0, odl=0.05, material=STEEL) for _ in range(elements)]
    size = {"material": STEEL, "width": 0.07, "i_d": 0.05, "o_d": 0.28}
    disks = [ross.DiskElement.from_geometry(n=n, **size) for n in (elements // 3, 2 * elements // 3)]
    return ross.Rotor(shaft, disks, [ross.BearingElement(n=n, **bearing) for n in (0, elements)])


def whirl(elements: int, bearing: dict[str, float], speeds: list[float]) -> tuple[float, Any]:
    """Return seconds, and four damped frequencies at each speed (rad/s)."""
    shaft, started = rotor(elements, bearing), process_time()
    found = shaft.run_campbell(np.array(speeds), frequencies=4)
    return process_time() - started, np.sort(found.wd, axis=1).tolist()


def unbalance(elements: int, bearing: dict[str, float], speeds: list[float]) -> tuple[float, Any]:
    """Return seconds, and amplitudes along x and y at the first disk (m) at each speed."""
    shaft, node, started = rotor(elements, bearing), elements // 3, process_time()
    found = shaft.run_unbalance_response(node, 1e-3, 0.5, frequency=np.array(speeds)).forced_resp
    return process_time() - started, np.abs(found[[6 * node, 6 * node + 1]]).T.tolist()


if __name__ == "__main__":
    case, arguments = globals()[sys.argv[1]], json.loads(sys.argv[2])
    case(**arguments)  # the first time is not measured
    seconds, values = case(**arguments)
    print(json.dumps({"seconds": seconds, "values": values}))
