"""Planar beams let go from the static shape of a tip displacement, and spun up while soft, held to a chain of links."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.hard.case import Case

LENGTH, EI = 10.0, 1.4e4

#: Times (s), and u2 of the tip (m) by its displacement at the start: 16 and 32 rigid links with springs,
#: inextensible and unshearable, by DOP853 to 1e-8, extrapolated in the number of links.
TIMES = (0.5, 1.0, 1.5, 2.0)
RELEASED = {
    0.1: (-0.02951746, -0.07656813, 0.08019088, 0.02258742),
    1.0: (-0.2962834, -0.7671621, 0.80293626, 0.22593014),
    3.0: (-0.9173527, -2.33313354, 2.43192097, 0.67369211),
    5.0: (-1.64454436, -3.95321666, 4.16786488, 1.03336414),
    8.0: (-3.51059272, -6.61968709, 7.38312297, 1.15251379),
}

#: The same of beams with EI / 1 and EI / 10 that are spun up to 6 rad/s in 15 s.
SPUN = (5.0, 7.5, 10.0, 15.0)
SPUN_UP = {
    1.0: (-0.4684359, -0.55898387, -0.3626737, 0.00127278),
    0.1: (-4.64553157, -2.61821586, -1.80130891, -0.33177985),
}


def beam(slenderness: float, EI: float = EI) -> dict[str, Any]:
    """Return a planar beam of EA L²/EI = slenderness²."""
    EA = EI * (slenderness / LENGTH) ** 2
    section = {"EA": EA, "GA": EA / 2.5, "EI": EI, "mass_per_length": 1.2, "rotary_inertia": 1.2 * EI / EA}
    return {"type": "planar_beam", "length": LENGTH, "section": section}


def released(u2: float, slenderness: float, step: float, **model: Any) -> dict[str, Any]:
    """Return the scene of a release; what is left out takes its default."""
    return {
        "structure": beam(slenderness),
        "motion": {"type": "constant", "speed": 0.0},
        "initial": {"tip_displacement": u2},
        "model": model,
        "time": {"end": TIMES[-1], "step": step},
    }


def spun_up(share: float, slenderness: float, **model: Any) -> dict[str, Any]:
    """Return the scene of a spin-up with a part of the stiffness."""
    return {
        "structure": beam(slenderness, share * EI),
        "motion": {"type": "spin_up", "speed": 6.0, "duration": 15.0},
        "model": model,
        "time": {"end": SPUN[-1], "step": 0.01},
    }


def tip_at(times: tuple[float, ...]) -> Any:
    """Return what reads u2 of the tip at some times."""
    return lambda result: np.interp(times, result.history["t"], result.history["tip_u2"])


CASES = [
    Case(
        "released from a tip displacement",
        f"u₂ = {u2 / LENGTH:g} L, L/r = {slenderness:.0e}",
        released(u2, slenderness, 0.005),
        value=tip_at(TIMES),
        reference=RELEASED[u2],
        tolerance=0.02,  # of the time step about 1 %, of the chain and of the second and third mode the rest
        source="chain of rigid links",
        nightly=(u2, slenderness) not in ((1.0, 1e4), (5.0, 1e5), (8.0, 1e3)),
    )
    for u2 in RELEASED
    for slenderness in (1e3, 1e4, 1e5)
]
CASES += [
    Case(
        "released from a tip displacement",
        f"u₂ = 0.01 L, L/r = 1e+04, {theory}, {scheme}",
        {**released(0.1, 1e4, 0.005, theory=theory), "time": {"end": TIMES[-1], "step": 0.005, "scheme": scheme}},
        value=tip_at(TIMES),
        reference=RELEASED[0.1],
        tolerance=0.02,
        source="chain of rigid links",
        nightly=True,
    )
    for theory in ("reissner", "von_karman", "second_order")
    for scheme in ("generalised_alpha", "newmark")
]
CASES += [
    Case(
        "soft beams spun up",
        f"EI × {share:g}, L/r = {slenderness:.0e}",
        spun_up(share, slenderness),
        value=tip_at(SPUN),
        reference=SPUN_UP[share],
        tolerance=0.02,  # of the chain
        source="chain of rigid links",
        nightly=(share, slenderness) != (0.1, 1e4),
    )
    for share in SPUN_UP
    for slenderness in (1e3, 1e4, 1e5)
]
