"""The scheme of fourth order: its order on a free hub and over bends, and what is stiff."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from rotfem import run
from tests.beams import STRUCTURE

Array = npt.NDArray[np.float64]

#: A short spin-up of the unit beam, whose first frequency is 3.5 rad/s, and a hub that is turned forth and back.
SPIN_UP = {"motion": {"type": "spin_up", "speed": 1.0, "duration": 2.0}}
HUB = {"motion": {"type": "torque", "hub_inertia": 1.0, "table": [[0.0, 0.0], [1.0, 0.5], [2.0, -0.5]]}}
BEAM = {"mesh": {"elements": 1, "degree": 2}, "solver": {"increment_tolerance": 1e-11}}
#: A section so soft in every way that these steps resolve all motions: a method has its order then.
SOFT = {f"structure.section.{k}": v for k, v in (("EA", 20.0), ("GA", 20.0), ("rotary_inertia", 0.5))}

STILL = {"type": "constant", "speed": 0.0}


def orders(make: Any, tables: dict[str, Any], scheme: str, number: int, names: tuple[str, ...]) -> Array:
    """Return the last observed order of columns, of histories in number, 2 number … 8 number steps of 2 s."""
    histories = []
    for k in range(4):
        time = {"end": 2.0, "step": 2.0 / number / 2**k, "output_every": 2**k, "scheme": scheme}
        history = run(make(SOFT, **BEAM, **tables, time=time)).history
        histories.append(np.array([history[name] for name in names]))
    change = np.array([np.abs(b - a).max(axis=1) for a, b in pairwise(histories)])
    return np.asarray(np.log2(change[-2] / change[-1]))


@pytest.mark.parametrize("theory", ["reissner", "consistent_linear"])
def test_order_on_a_free_hub(unit_beam: Any, theory: str) -> None:
    """The knot of the torque is met, so its kink costs nothing."""
    assert orders(unit_beam, HUB | {"model": {"theory": theory}}, "esdirk4", 20, ("tip_u2",)) > 3.6


def test_a_bend_of_the_rate_costs_nothing_anywhere_in_a_step() -> None:
    """Rates of tabulated speeds have bends; steps over one would be off a hundred times more.

    By steps that end on the bend at 2 s, and such that have it in their first or last tenth.
    """
    motion = {"type": "table", "table": [[0.0, 2.0], [2.0, 2.0], [2.8, 0.0], [3.0, 0.0]]}
    tables = {"structure": STRUCTURE, "motion": motion, "mesh": {"elements": 2}, "output": {"error": False}}

    def last(step: float) -> float:
        time = {"end": 2.4, "step": step, "scheme": "esdirk4"}
        return float(run({**tables, "model": {"theory": "consistent_linear"}, "time": time}).tip["u2"][-1])

    exact = last(2.0 / 320)
    errors = [abs(last(2.0 / (40 + share)) - exact) for share in (0.0, 0.06, 0.9)]
    assert max(errors) < 3 * errors[0]


def test_a_stiff_vibration_is_damped() -> None:
    """An axial force at once, in steps of 120 axial periods: of the vibration it starts |R(iωh)|⁴ is left.

    With ωh = 759 it is (9.3/ωh)⁴. Generalised-α keeps 0.9⁴.
    """
    tables = {"structure": STRUCTURE, "motion": STILL, "loads": {"tip_force": [1000.0, 0.0]}, "mesh": {"elements": 2}}
    tables["initial"] = {"state": "undeformed"}
    static = 1000.0 * 10.0 / 2.8e7

    def off(name: str) -> float:
        return abs(
            run({**tables, "time": {"end": 4.0, "step": 1.0, "scheme": name}}).history["tip_u1"][-1] / static - 1
        )

    assert off("esdirk4") < 1e-2
    assert off("generalised_alpha") > 0.1
