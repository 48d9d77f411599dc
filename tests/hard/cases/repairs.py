"""Cases that led to a repair: errors that grow with the time, strong damping, equilibria that there are none of."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from tests.hard.case import Case

LENGTH, EI, MASS = 10.0, 1.4e4, 1.2
SECTION = {"EA": 2.8e7, "GA": 1.0e7, "EI": EI, "mass_per_length": MASS}
FIRST = 3.516015 * np.sqrt(EI / MASS) / LENGTH**2  # rad/s, of the clamped-free beam


def beam(speed: float = 0.0, **tables: Any) -> dict[str, Any]:
    """Return the scene of a beam at a constant speed (rad/s); `section`, `damping` and `root` are of the structure."""
    own = {name: tables.pop(name) for name in ("damping", "root") if name in tables}
    section = SECTION | tables.pop("section", {})
    structure = {"type": "planar_beam", "length": LENGTH, "section": section, **own}
    return {"structure": structure, "motion": {"type": "constant", "speed": float(speed)}, **tables}


def creeping(relaxation: float, end: float) -> dict[str, Any]:
    """Return the scene of a beam of Kelvin–Voigt material (relaxation time, s) under 5 N from t = 0 on."""
    return beam(
        damping={"kelvin_voigt": relaxation},
        loads={"tip_force": [0.0, 5.0]},
        initial={"state": "undeformed"},
        time={"end": end, "tolerance": 1e-4},
    )


def crept(relaxation: float) -> Any:
    """Return what reads u₂ over F L³/3EI (1 − exp(−t/η)), at the last row."""

    def value(result: Any) -> float:
        t = float(result.history["t"][-1])
        return float(result.history["tip_u2"][-1] / (5.0 * LENGTH**3 / (3 * EI) * (1 - np.exp(-t / relaxation))))

    return value


def released(theory: str, displacement: float, end: float) -> dict[str, Any]:
    """Return the scene of a beam at a third of its first frequency, let go from a tip displacement (m)."""
    return beam(
        FIRST / 3,
        model={"theory": theory},
        initial={"tip_displacement": displacement},
        mesh={"elements": 4},
        time={"end": end, "step": 0.01},
    )


def tether(speed: float, force: float) -> dict[str, Any]:
    """Return the scene of 100 km of line with 500 kg at its end, which a force (N) pushes out of the plane."""
    section = dict.fromkeys(("EA", "GA2", "GA3"), 1e6) | dict.fromkeys(("GJ", "EI2", "EI3"), 1e-3)
    section |= {"mass_per_length": 0.01, "rotary_inertia2": 1e-11, "rotary_inertia3": 1e-11}
    structure = {"type": "spatial_beam", "length": 1e5, "tip_mass": 500.0, "section": section}
    loads = {"tip_force": [0.0, 0.0, force]}
    return {"structure": structure, "motion": {"type": "constant", "speed": speed}, "loads": loads}


def string_tip(speed: float, force: float) -> list[float]:
    """Return (u₁, u₃) of the tip (m) of the `tether` as a string: H' = −ρΩ² r₁, V = F, r' = (1/T + 1/EA)(H, V)."""

    def shape(H: float) -> Any:
        def rate(x: float, y: Any) -> list[float]:
            stretch = 1 / np.hypot(y[2], force) + 1e-6
            return [stretch * y[2], stretch * force, -0.01 * speed**2 * y[0]]

        return solve_ivp(rate, (0.0, 1e5), [0.0, 0.0, H], rtol=1e-9, atol=1e-9).y[:, -1]

    def gap(H: float) -> float:
        end = shape(H)
        return float(end[2] - 500.0 * speed**2 * end[0])

    x, z, _ = shape(brentq(gap, 0.5e8 * speed**2, 2e8 * speed**2, rtol=1e-12))
    return [float(x - 1e5), float(z)]


CASES = [
    Case(
        "errors that grow as a phase",
        f"{theory}, {displacement:g} m for {end:g} s at ω₁/3",
        released(theory, displacement, end),
        value=lambda result: result.summary.get("error", {}).get("model", 0.0),
        reference=reference,
        tolerance=tolerance,
        source=source,
        expected="warned",
        words=f'model.theory = "{theory}" is ',
    )
    for theory, displacement, end, reference, tolerance, source in (
        ("linear", 0.05, 10.0, 1.888, 0.1, "reissner in the same steps"),
        ("second_order", 0.5, 30.0, 0.1775, 0.2, "reissner in the same steps"),
    )
]
CASES += [
    Case(
        "stiff damping",
        f"Kelvin–Voigt {relaxation:g} s, adaptive steps for {end:g} s",
        creeping(relaxation, end),
        value=crept(relaxation),
        reference=1.0,
        tolerance=1e-3,  # shear is 4e-4, the deflection 1 % of the length
        source="q + η q̇ = F/k",
        nightly=relaxation == 10.0,
    )
    for relaxation, end in ((10.0, 100.0), (1e4, 10.0), (1e4, 1e5))
]
CASES += [
    Case(
        "no equilibrium",
        "EI 1e6 : 1e-6 along the span",
        beam(section={"EI": [[0, 1e6], [5, 1e6], [5.0001, 1e-6], [10, 1e-6]]}, loads={"tip_force": [0.0, 1e-9]}),
        expected="failed",
        words="round-off decides",
        source="EA/EI h⁻² is beyond 16 digits",
    ),
    Case(
        "no equilibrium",
        "a lag hinge at the axis under a force across, consistent_linear",
        beam(
            3.0,
            root={"lag_stiffness": 0.0},
            loads={"tip_force": [0.0, 5.0]},
            model={"theory": "consistent_linear"},
        ),
        expected="failed",
        words="nothing holds the root's hinge",
        source="no moment about the axis",
    ),
]
CASES += [
    Case(
        "damping by mode",
        "a blade on a flap spring, 2 elements",
        {
            "structure": {
                "type": "spatial_beam",
                "length": 2.0,
                "hub_radius": 0.2,
                "tip_mass": 0.3,
                "pretwist": [[0, 0.3], [2, -0.1]],
                "section": {
                    "EA": 1e8,
                    "GA2": 1e8,
                    "GA3": 1e8,
                    "GJ": 1e3,
                    "EI2": 1e3,
                    "EI3": 1e3,
                    "mass_per_length": 1.0,
                },
                "root": {"flap_stiffness": 5.0},
                "damping": {"modal": 0.01},
            },
            "motion": {"type": "constant", "speed": 0.0},
            "mesh": {"elements": 2},
            "modes": {"count": 4},
        },
        command="modes",
        value=lambda result: [row["damping"] for row in result.rows],
        reference=[0.01] * 4,
        tolerance=1e-5,
        source="the ratio that is given",
    )
]
CASES += [
    Case(
        "tension alone",
        f"100 km at {speed:g} rad/s, {force:g} N across",
        tether(speed, force),
        value=lambda result: [result.summary["figures"][f"tip_u{i}_final"] for i in (1, 3)],
        reference=string_tip(speed, force),
        tolerance=1e-5,
        source="string equations by shooting",
    )
    for speed, force in ((0.01, 1.0), (0.001, 1.0), (0.01, 1000.0))
]
CASES += [
    Case(
        "strong damping",
        "rayleigh = [1e6, 0]",
        beam(damping={"rayleigh": [1e6, 0.0]}, modes={"count": 6}),
        value=lambda result: np.sort(-result.growth[:5][result.growth[:5] > -1.0])[:3] * 1e6 / FIRST**2,
        reference=[1.0, (22.0345 / 3.516015) ** 2, (61.6972 / 3.516015) ** 2],
        tolerance=3e-3,
        source="λ = −ω²/1e6 of slow modes; Blevins 1979, table 8-1",
        command="modes",
    ),
    Case(
        "no mass",
        "static tip force",
        beam(section={"mass_per_length": 0.0}, loads={"tip_force": [0.0, 0.5]}),
        value=lambda result: result.summary["figures"]["tip_u2_final"],
        reference=0.5 * LENGTH**3 / (3 * EI),
        tolerance=1e-3,
        source="F L³/3EI",
    ),
    Case(
        "no mass",
        "modes",
        beam(section={"mass_per_length": 0.0}),
        command="modes",
        expected="failed",
        words="the structure has no mass, and so no modes",
    ),
]

ARM = {"EA": 1e6, "GA": 1e7, "EI": 100.0, "mass_per_length": 0.0}
OWN = np.sqrt(1.0 / (2.0 * (1.0 / 300.0 + 1e-7)))  # rad/s, 2 kg at the end of 1 m
CASES += [
    Case(
        "input finer than the step",
        f"an arm stops at once, table by {kind}, {steps}",
        {
            "structure": {"type": "planar_beam", "length": 1.0, "tip_mass": 2.0, "section": ARM},
            "motion": {"type": "table", "table": [[0, 0.01], [0.501, 0.01], [0.501, 0], [2, 0]], "interpolation": kind},
            "model": {"theory": "consistent_linear"},
            "time": {"end": 1.0, **steps},
            "output": {"error": False},
        },
        value=lambda result: np.max(np.abs(result.history["tip_u2"])),
        reference=0.01 / OWN,
        tolerance=1e-3,
        source="ΔΩ L/ω of a mass on a spring",
    )
    for kind in ("pchip", "cubic")
    for steps in ({"step": 0.002}, {"tolerance": 1e-5})
]
