"""Reduced linear models under a pitch over time: the full march's history, and limits of pitches that are simple."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rotfem

pytestmark = pytest.mark.usefixtures("unestimated")

L = 2.0
SECTION = {
    **{"EA": 1e7, "GA2": 1e6, "GA3": 1e6, "GJ": 2e3, "EI2": 5e2, "EI3": 4e3},
    **{"mass_per_length": 3.0, "rotary_inertia2": 0.002, "rotary_inertia3": 0.03, "mass_center": [0.05, -0.02]},
}
ROOT_FORCE, ROOT_MOMENT = ("root_f1", "root_f2", "root_f3"), ("root_m1", "root_m2", "root_m3")
TIPS = ("tip_u1", "tip_u2", "tip_u3")


def history(pitch: Any, reduced: float | None = 1e-5, precone: float = 0.0, **tables: Any) -> Any:
    """Return the result of a damped blade under gravity and a load, by a linear theory."""
    scene = {
        "structure": {
            **{"type": "spatial_beam", "length": L, "hub_radius": 0.5, "precone": precone, "section": SECTION},
            **{"root": {"pitch": pitch}, "damping": {"kelvin_voigt": 1e-3}},
        },
        "model": {"theory": "consistent_linear", **({} if reduced is None else {"reduced": reduced})},
        "motion": {"type": "constant", "speed": 5.0},
        "loads": {"gravity": [1.0, 2.0, -9.81], "distributed": {"value": [1.0, 2.0, 30.0]}},
        "mesh": {"elements": 3},
        "time": {"end": 0.6, "step": 0.015},
    }
    return rotfem.run({**scene, **tables})


def off(one: Any, other: Any, names: Any, since: int = 0) -> float:
    """Return the largest difference of vectors from some row on, relative to the largest of the other one."""
    x, y = (np.stack([result.history[name] for name in names], axis=1)[since:] for result in (one, other))
    return float(np.linalg.norm(x - y, axis=1).max() / np.linalg.norm(y, axis=1).max())


@pytest.mark.parametrize("precone", [0.0, pytest.param(0.15, marks=pytest.mark.nightly)])
def test_history_under_a_pitch_is_that_of_the_full_march(precone: float) -> None:
    """Cyclic pitch and a ramp at a speed that rises: operators and loads that turn, with a precone a moving origin.

    The reduced model is asked for 1e-5; the march leaves 2e-6 with these steps. What rings along the blade at first,
    which the root feels, is damped within 0.15 s.
    """
    pitch = {"table": [[0, 0.1], [0.45, 0.6]], "harmonic": {"amplitude": 0.1, "per_rev": 2.0, "phase": 0.3}}
    motion = {"type": "table", "table": [[0, 5.0], [0.6, 8.0]]}
    steps = {"end": 0.6, "step": 0.0015, "scheme": "esdirk4", "output_every": 10}
    full = history(pitch, None, precone, motion=motion, time=steps)
    found = history(pitch, precone=precone, motion=motion)
    assert off(found, full, TIPS) < 2e-5
    for names in (ROOT_FORCE, ROOT_MOMENT, ("kinetic",), ("strain",), ("jacobi",)):
        assert off(found, full, names, since=10) < 1e-3
    assert off(found, full, ("pitch",)) < 1e-14


def test_a_pitch_that_stays_is_the_constant_one() -> None:
    """Its matrices do not change, so that the solution is by exact exponentials both times, but the axes are others."""
    stays = {"table": [[0, 0.3], [0.6, 0.3]], "harmonic": {"amplitude": 1e-90, "per_rev": 1.0}}
    constant, found = history(0.3), history(stays)
    assert off(found, constant, (*TIPS, "kinetic", "strain")) < 1e-5
    assert off(found, constant, ROOT_MOMENT, since=10) < 1e-3
