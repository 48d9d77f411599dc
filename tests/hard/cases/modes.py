"""Modes where digits, units, damping or cells are hard: slender beams, other units, overdamped modes, long strips."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.hard.case import Case
from tests.launch import ROOT

_TABLE = np.loadtxt(ROOT / "tests/reference/timoshenko_elements.csv", delimiter=",", skiprows=1)
#: (elements, r/L) ↦ the first three frequencies of `beam`.
ELEMENTS = {(int(row[0]), float(row[1])): row[2:] for row in _TABLE}
DECIMALS = "the same elements in 50 decimal digits (tests/reference)"
SLENDER, UNITS, DAMPED, CELLS = "modes: slender", "modes: units", "modes: damping", "modes: cells"


def beam(slenderness: float, elements: int, units: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> dict[str, Any]:
    """Return the scene of a cantilever at rest, EI = L = m = 1 in the units of length, mass and time."""
    m, kg, s = units
    N, r = kg * m / s**2, slenderness
    stiffness = {"EA": N / r**2, "GA": 0.4 * N / r**2, "EI": N * m**2}
    section = {**stiffness, "mass_per_length": kg / m, "rotary_inertia": r**2 * kg * m}
    return {
        "structure": {"type": "planar_beam", "length": m, "section": section},
        "motion": {"type": "constant", "speed": 0.0},
        "model": {"theory": "linear"},
        "mesh": {"elements": elements, "degree": 3},
        "modes": {"count": 4},
    }


def first(result: Any, count: int = 3) -> Any:
    """Return the first frequencies, rad/s."""
    return result.frequencies[:count]


def slender() -> list[Case]:
    """Return beams whose axial and shear stiffness outweighs the bending stiffness by 1e8 to 1e14."""
    out = []
    for elements, slenderness in ((16, 1e-4), (16, 1e-6), (64, 1e-5), (64, 1e-6), (64, 1e-7)):
        truth = ELEMENTS[elements, slenderness]
        name = f"r/L {slenderness:g}, {elements} elements"
        out.append(Case(SLENDER, name, beam(slenderness, elements), first, truth, 1e-9, DECIMALS, "modes"))
    for theory in ("linear", "reissner"):
        scene = beam(1e-7, 64) | {"model": {"theory": theory}}
        growth = Case(
            SLENDER,
            f"{theory}: nothing grows at rest",
            scene,
            lambda r: float(np.max(r.growth) > 3.5e-6),
            0.0,
            0.5,
            "a beam at rest",
            "modes",
        )
        out.append(growth)
    return out


def units() -> list[Case]:
    """Return one beam from 10 nm to 10 km."""
    truth, out = ELEMENTS[8, 1e-2], []
    for m, kg, s in ((1e-8, 1e-12, 1e-9), (1e-8, 1e3, 1e3), (1e-7, 1.0, 1.0), (1e-5, 1e-9, 1e-6), (1e4, 1.0, 1e-6)):
        name = f"length {m:g} m, mass {kg:g} kg, time {s:g} s"
        out.append(Case(UNITS, name, beam(1e-2, 8, (m, kg, s)), first, truth / s, 1e-9, DECIMALS, "modes"))
    return out


def damped() -> list[Case]:
    """Return Kelvin–Voigt beams: each ω has the roots of λ² + (η ω² + a₀) λ + ω² = 0."""
    omega, out = ELEMENTS[8, 1e-3], []
    for viscosity in (1e-3, 0.01, 0.1, 1.0):
        roots = [np.roots([1.0, viscosity * w**2 + 1.0, w**2]) for w in omega]
        truth = np.concatenate([r[r.imag >= 0.0] for r in roots])
        scene = beam(1e-3, 8)
        scene["structure"]["damping"] = {"kelvin_voigt": viscosity, "rayleigh": [1.0, 0.0]}
        scene["modes"] = {"count": len(truth)}

        def distance(result: Any, truth: Any = truth) -> float:
            found = result.eigenvalues
            return float(max(np.min(np.abs(found - lam)) / abs(lam) for lam in truth))

        name = f"viscosity {viscosity:g} s: eigenvalues of three modes that are missed"
        out.append(Case(DAMPED, name, scene, distance, 0.0, 1e-6, "roots of the damped oscillators", "modes"))
    return out


def strip(length: float, cells: tuple[int, int]) -> dict[str, Any]:
    """Return the scene of a strip of width 1 m and thickness 0.1 m without Poisson's ratio, EI = mass = 1."""
    plate = {"length": length, "width": 1.0, "thickness": 0.1, "nu": 0.0, "E": 12e3, "rho": 10.0}
    return {
        "structure": {"type": "plate", **plate},
        "motion": {"type": "constant", "speed": 0.0},
        "model": {"theory": "consistent_linear"},
        "mesh": {"elements": list(cells)},
        "modes": {"count": 3},
    }


def cells() -> list[Case]:
    """Return long strips, and meshes that are too coarse for the modes wanted."""
    beta = np.array([1.8751040687119612, 4.694091132974174])
    out = []
    for length, along in ((30.0, 16), (100.0, 16), (300.0, 16)):
        source = "a strip without Poisson's ratio is a beam"
        truth = (beta / length) ** 2
        scene = strip(length, (along, 2))
        out.append(Case(CELLS, f"strip {length:g}:1", scene, lambda r: first(r, 2), truth, 2e-3, source, "modes"))
    bare = {key: value for key, value in strip(1000.0, (8, 8)).items() if key != "mesh"}
    truth = (beta / 1000.0) ** 2
    name, source = "strip 1000:1 without a word on cells", "a strip without Poisson's ratio is a beam"
    out.append(Case(CELLS, name, bare, lambda r: first(r, 2), truth, 2e-3, source, "modes"))
    few = beam(1e-2, 2) | {"modes": {"count": 5}}
    out.append(Case(CELLS, "five modes on two elements", few, command="modes", expected="warned", words="coarse|mesh"))
    wide = strip(1.0, (2, 40)) | {"modes": {"count": 6}}
    out.append(Case(CELLS, "two cells along a square", wide, command="modes", expected="warned", words="coarse|mesh"))
    return out


CASES = [*slender(), *units(), *damped(), *cells()]
