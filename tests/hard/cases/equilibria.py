"""Steady states far from the undeformed one: slender cantilevers under a dead force, rods stretched by their spin."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipkinc

from tests.hard.case import Case

LENGTH, EI, MASS = 10.0, 1.4e4, 1.2


def structure(kind: str, slenderness: float) -> dict[str, Any]:
    """Return a cantilever of EA L²/EI = slenderness² and EI in the plane (1, 2), of a plate out of its plane."""
    EA = EI * (slenderness / LENGTH) ** 2
    if kind == "plate":  # without Poisson's ratio a strip is a beam: EI = E b h³/12, L/r = √12 L/h
        width, thickness = 1.0, np.sqrt(12.0) * LENGTH / slenderness
        E = 12 * EI / (width * thickness**3)
        rho = MASS / (width * thickness)
        own = {"width": width, "thickness": thickness, "E": E, "nu": 0.0, "rho": rho}
        return {"type": "plate", "length": LENGTH, **own}
    if kind == "planar_beam":
        stiffness: dict[str, float] = {"EA": EA, "GA": EA / 2.5, "EI": EI}
    else:
        stiffness = {"EA": EA, "GA2": EA / 2.5, "GA3": EA / 2.5, "GJ": EI, "EI2": 2 * EI, "EI3": EI}
    return {"type": kind, "length": LENGTH, "section": {**stiffness, "mass_per_length": MASS}}


def mesh(kind: str) -> dict[str, Any]:
    return {"elements": [16, 1]} if kind == "plate" else {"elements": 16, "degree": 3}


@cache
def elastica(load: float) -> tuple[float, float]:
    """Return (1 + u1/L, w/L) of the tip of an inextensible cantilever under a dead transverse force P L²/EI = load.

    Bisshopp & Drucker 1945: with sin² φ₀ = 1/(2p²), √load = K(p) − F(p, φ₀), w/L = 1 − 2 (E(p) − E(p, φ₀))/√load, and
    the tip is at √(2 sin θ / load) along, θ its slope, 1 + sin θ = 2p².
    """
    from scipy.special import ellipeinc

    def left(p: float) -> float:
        phi = np.arcsin(np.sqrt(0.5) / p)
        return float(ellipkinc(np.pi / 2, p * p) - ellipkinc(phi, p * p) - np.sqrt(load))

    p = brentq(left, np.sqrt(0.5) + 1e-12, 1 - 1e-15)
    phi = np.arcsin(np.sqrt(0.5) / p)
    E = float(ellipeinc(np.pi / 2, p * p) - ellipeinc(phi, p * p))
    return float(np.sqrt(2 * (2 * p * p - 1) / load)), float(1 - 2 * E / np.sqrt(load))


def bent(kind: str, slenderness: float, load: float) -> dict[str, Any]:
    """Return the scene of a cantilever under a dead transverse tip force."""
    force = load * EI / LENGTH**2
    return {
        "structure": structure(kind, slenderness),
        "motion": {"type": "constant", "speed": 0.0},
        "loads": {"tip_force": [0.0, 0.0, force] if kind == "plate" else [0.0, force, 0.0]},
        "model": {"theory": "reissner"},
        "mesh": mesh(kind),
    }


def tip(kind: str) -> Any:
    """Return what reads the displacement of the tip along and across, in lengths."""
    across = "tip_u3" if kind == "plate" else "tip_u2"
    return lambda result: [float(result.history[name][-1]) / LENGTH for name in ("tip_u1", across)]


def rod(kind: str, theory: str, share: float) -> dict[str, Any]:
    """Return the scene of a rod whose Ω L √(ρA/EA) is a share of π/2, where the stretch is without bound."""
    EA = EI * (100.0 / LENGTH) ** 2
    return {
        "structure": structure(kind, 100.0),
        "motion": {"type": "constant", "speed": share * np.pi / 2 / LENGTH * np.sqrt(EA / MASS)},
        "model": {"theory": theory},
        "mesh": mesh(kind),
    }


def stretched(share: float) -> float:
    """Return u1/L of the tip of a rod with EA u'' + ρA Ω² (x + u) = 0: tan(kL)/kL − 1."""
    k = share * np.pi / 2
    return float(np.tan(k) / k - 1)


CASES = [
    Case(
        "a dead force at the tip",
        f"{kind}, P L²/EI = {load:g}, L/r = {slenderness:.0e}",
        bent(kind, slenderness, load),
        value=tip(kind),
        reference=[elastica(load)[0] - 1, elastica(load)[1]],
        # The reference has neither shear nor stretch, of the order of load (r/L)² each; a sharp bend asks for mesh.
        tolerance=10 * load / slenderness**2 + (1e-5 if load < 50 else 1e-3),
        source="elastica (Bisshopp & Drucker 1945)",
        nightly=kind != "planar_beam" or (slenderness, load) != (1e5, 10.0),
    )
    for kind in ("planar_beam", "spatial_beam", "plate")
    for slenderness in (1e2, 1e3, 1e5)
    for load in (1.0, 10.0, 100.0)
    if not (kind == "plate" and slenderness > 1e4)
]
CASES += [
    Case(
        "a rod stretched by its spin",
        f"{kind}, {theory}, {share:g} of the speed without bound",
        rod(kind, theory, share),
        value=lambda result: float(result.history["tip_u1"][-1]) / LENGTH,
        reference=stretched(share),
        tolerance=1e-6,
        source="tan(kL)/kL − 1",
        nightly=kind != "planar_beam" or theory not in ("reissner", "consistent_linear"),
    )
    for kind in ("planar_beam", "spatial_beam", "plate")
    for theory in ("reissner", "consistent_linear", "linear")
    for share in (0.1, 0.9)
    if kind != "plate" or theory != "reissner"  # its strain is Green's, another law
]
