"""Motions that unstable steps feed, stiff damping, hubs of next to no inertia: balances as references."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.beams import STRUCTURE
from tests.hard.case import Case

SECTION = STRUCTURE["section"]
BEAM = {"type": "planar_beam", "length": 10.0, "section": SECTION}
MESH = {"elements": 3, "degree": 3}


def released(theory: str, u2: float, end: float, step: float, **time: Any) -> dict[str, Any]:
    """Return the scene of a beam that spins at 3 rad/s and is let go from a tip displacement (m)."""
    return {
        "structure": BEAM,
        "motion": {"type": "constant", "speed": 3.0},
        "model": {"theory": theory},
        "mesh": MESH,
        "initial": {"tip_displacement": u2},
        "time": {"end": end, "step": step, **time},
    }


def creeping(u2: float, viscosity: float) -> dict[str, Any]:
    """Return the scene of a beam that creeps back from a tip displacement (m): q + η q̇ = 0 but for its inertia."""
    return {
        "structure": BEAM | {"damping": {"kelvin_voigt": viscosity}},
        "motion": {"type": "constant", "speed": 0.0},
        "mesh": MESH,
        "initial": {"tip_displacement": u2},
        "time": {"end": 2.0, "step": 0.02},
    }


def driven(theory: str, inertia: float, **time: Any) -> dict[str, Any]:
    """Return the scene of a free hub that is given 10 N·m·s in half a second."""
    return {
        "structure": BEAM,
        "motion": {"type": "torque", "hub_inertia": inertia, "pulses": [[0.0, 0.5, 20.0]]},
        "model": {"theory": theory},
        "mesh": MESH,
        "time": {"end": 1.0, "step": 0.01, **time},
    }


def gained(result: Any) -> float:
    """Return by how much the Jacobi integral ends above its start, relative to the largest strain energy."""
    energy = result.history["jacobi"]
    return float(max(energy[-1] - energy[0], 0.0) / np.max(result.history["strain"]))


CASES = [
    Case(
        "energy from nowhere",
        f"{theory}, 3 rad/s, 0.2 L, ρ∞ = {radius:g}, {end:g} s in steps of 0.02 s",
        released(theory, 2.0, end, 0.02, spectral_radius=radius),
        value=gained,
        reference=0.0,
        tolerance=0.1,  # from row to row it fluctuates by some per cent
        source="conserved",
        expected=expected,
        words="Newton"
        if expected == "failed"
        else "",  # nothing damps what the steps feed, until they have no solution
        nightly=(theory, radius) != ("second_order", 1.0),
    )
    for theory in ("reissner", "second_order", "von_karman")
    for radius, end, expected in ((1.0, 11.0, "failed"), (0.9, 200.0, "right"))
]
CASES += [
    Case(
        "stiff damping",
        f"Kelvin–Voigt {viscosity:g} s, u₂ = {u2 / 10:g} L",
        creeping(u2, viscosity),
        value=lambda result: result.history["tip_u2"],
        reference=u2 * np.exp(-np.arange(101) * 0.02 / viscosity),
        tolerance=0.01,  # 2 s of creep change the shape of a large deflection
        source="q + η q̇ = 0",
        nightly=(viscosity, u2) != (10.0, 1.0),
    )
    for viscosity in (10.0, 1000.0)
    for u2 in (0.1, 1.0, 3.0)
]
CASES += [
    Case(
        "hubs of little inertia",
        f"{theory}, {inertia:g} kg·m², {scheme}",
        driven(theory, inertia, scheme=scheme),
        value=lambda result: result.history["angular_momentum"][-1],
        reference=10.0,
        tolerance=0.005,
        source="20 N·m for 0.5 s",
        nightly=(theory, inertia) != ("consistent_linear", 1e-2),
    )
    for theory, inertia, scheme in (
        ("consistent_linear", 1.0, "newmark"),
        ("consistent_linear", 1e-2, "newmark"),
        ("consistent_linear", 1e-6, "newmark"),
        ("reissner", 1.0, "newmark"),
        ("reissner", 1e-6, "generalised_alpha"),
    )
]
