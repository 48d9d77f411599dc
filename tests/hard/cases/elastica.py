"""Slender cantilevers rolled up by a moment at the tip: exact circles, whatever the slenderness."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.hard.case import Case

LENGTH, EI = 10.0, 1.4e4


def planar(slenderness: float, turn: float, **model: Any) -> dict[str, Any]:
    """Return the scene of a beam of EA L²/EI = slenderness², rolled up by an angle (rad) at its tip."""
    EA = EI * (slenderness / LENGTH) ** 2
    return {
        "structure": {
            "type": "planar_beam",
            "length": LENGTH,
            "section": {"EA": EA, "GA": EA / 2.5, "EI": EI, "mass_per_length": 1.2, "rotary_inertia": 1.2 * EI / EA},
        },
        "motion": {"type": "constant", "speed": 0.0},
        "loads": {"tip_moment": EI * turn / LENGTH},
        "model": {"theory": "reissner", **model},
        "mesh": {"elements": 8, "degree": 4},
    }


def tip(result: Any) -> list[float]:
    return [float(result.history[f"tip_{name}"][-1]) for name in ("u1", "u2")]


def circle(turn: float) -> list[float]:
    """Return (u1, u2) of the tip of a cantilever that is an arc of a circle."""
    radius = LENGTH / turn
    return [radius * np.sin(turn) - LENGTH, radius * (1 - np.cos(turn))]


CASES = [
    Case(
        "rolled up to a circle",
        f"planar beam, L/r = {slenderness:.0e}, {turn / np.pi:g} π",
        planar(slenderness, turn),
        value=tip,
        reference=circle(turn),
        tolerance=1e-5,
        source="arc of a circle",
        nightly=slenderness in (1e3, 1e4),
    )
    for slenderness in (1e2, 1e3, 1e4, 1e5)
    for turn in (np.pi, 2 * np.pi)
]
