"""Rows between steps, against rows that steps end on."""

from __future__ import annotations

import numpy as np

from rotfem import run
from tests.beams import STRUCTURE


def test_what_steps_do_not_resolve_does_not_throw_rows_off() -> None:
    """A beam that is spun at once: its axial vibration is damped in the first step, whose rows stay near the stretch.

    u1 is at most twice ρ Ω² L³/3EA = 3.6e-4 m; an acceleration Ω² L held over the first step would make 4 m of it.
    """
    tables = {
        "structure": STRUCTURE,
        "motion": {"type": "constant", "speed": 5.0},
        "initial": {"state": "undeformed"},
        "mesh": {"elements": 2},
        "model": {"theory": "consistent_linear"},
        "time": {"end": 2.0, "step": 0.2, "scheme": "esdirk4", "output_step": 0.02},
        "output": {"error": False},
    }
    u1 = run(tables).tip["u1"]
    stretch = 1.2 * 25.0 * 1000.0 / (3 * 2.8e7)
    assert np.abs(u1).max() < 2.5 * stretch
    assert np.abs(u1[-10:] - stretch).max() < 0.05 * stretch
