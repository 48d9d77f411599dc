"""Equilibria that are not stable, paths with limit points, and theories out of their range."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

from tests.hard.case import Case

LENGTH, EI, MASS = 10.0, 1.4e4, 1.2
UNIT = EI / LENGTH**2  # N
SECTION = {"EA": 2.8e7, "GA": 1.0e7, "EI": EI, "mass_per_length": MASS, "rotary_inertia": 6e-4}
BLADE = {"EA": 2.8e7, "GA2": 1.0e7, "GA3": 1.0e7, "GJ": 1e4, "EI2": EI, "EI3": 2e4, "mass_per_length": MASS}
UNSTABLE = "unstable equilibrium"


def planar(theory: str = "reissner", motion: dict[str, Any] | None = None, **tables: Any) -> dict[str, Any]:
    """Return the scene of a planar beam, at rest unless a motion is given."""
    return {
        "structure": {"type": "planar_beam", "length": LENGTH, "section": SECTION},
        "motion": {"type": "constant", "speed": 0.0, **(motion or {})},
        "model": {"theory": theory},
        "mesh": {"elements": 12},
        **tables,
    }


def spatial(theory: str, force: list[float], **motion: Any) -> dict[str, Any]:
    """Return the scene of a spatial beam with a force at its tip."""
    return {
        "structure": {"type": "spatial_beam", "length": LENGTH, "section": BLADE},
        "motion": {"type": "constant", "speed": 0.0, **motion},
        "model": {"theory": theory},
        "mesh": {"elements": 8},
        "loads": {"tip_force": force},
    }


def plate(theory: str, **tables: Any) -> dict[str, Any]:
    """Return the scene of a strip of 1 m."""
    strip = {"type": "plate", "length": 1.0, "width": 0.2, "thickness": 0.01, "E": 7e10, "nu": 0.3, "rho": 2700.0}
    base = {"structure": strip, "motion": {"type": "constant", "speed": 0.0}, "mesh": {"elements": [6, 2]}}
    return {**base, "model": {"theory": theory}, **tables}


def tip(result: Any) -> list[float]:
    """Return (u1, u2) of the tip."""
    return [float(result.history[f"tip_{name}"][-1]) for name in ("u1", "u2")]


def elastica(load: float) -> list[float]:
    """Return (u1, u2) of the tip of a cantilever buckled by a force, K(k)² = P L²/EI."""
    k = brentq(lambda k: ellipk(k * k) ** 2 - load * LENGTH**2 / EI, 1e-6, 1 - 1e-9)
    return [LENGTH * (2 * ellipe(k * k) / ellipk(k * k) - 2), LENGTH * 2 * k / ellipk(k * k)]


def said(topic: str, name: str, scene: dict[str, Any], words: str, **more: Any) -> Case:
    """Return a case that is computed, with a warning."""
    return Case(topic, name, scene, expected="warned", words=words, **more)


AFTER_BUCKLING, ABOVE, RANGE = "a column after buckling", "above buckling", "a theory out of its range"
STEADY = {"initial": {"state": "steady"}, "time": {"end": 0.05, "step": 0.01}}
FLUTTER = {"tip_force": {"value": [-23.0 * UNIT, 0.0], "kind": "follower"}}
SHAFT = {"type": "constant", "speed": 5.0, "axis": [1.0, 0.0, 0.0]}

CASES = [
    *(
        Case(
            AFTER_BUCKLING,
            f"{load:g} N of 345 N, {side:g} N to the side",
            planar(loads={"tip_force": [-load, side]}),
            value=tip,
            reference=[elastica(load)[0], np.sign(side) * elastica(load)[1]],
            tolerance=2e-3,
            source="elliptic integrals; stretch, shear and side force change 1e-3 at most",
            nightly=load != 520.0 or side < 0.0,
        )
        for load in (400.0, 520.0, 900.0)
        for side in (0.01, -0.01)
    ),
    *(
        said(
            ABOVE,
            f"planar beam, {theory}, 520 N of 345 N straight on",
            planar(theory, loads={"tip_force": [-520.0, 0.0]}),
            UNSTABLE if theory != "linear" else "out of its range",
            source="Euler",
            nightly=theory in ("von_karman", "von_karman_linear", "second_order"),
        )
        for theory in ("linear", "consistent_linear", "von_karman_linear", "second_order", "von_karman", "reissner")
    ),
    said(
        ABOVE,
        "base accelerated, 12 where 7.84 buckles",
        planar(motion={"base_acceleration": [12.0 * UNIT / (MASS * LENGTH), 0.0, 0.0]}),
        UNSTABLE,
        source="Greenhill 1881",
    ),
    said(
        ABOVE,
        "base accelerated, 12 where 7.84 buckles, consistent_linear",
        planar("consistent_linear", {"base_acceleration": [12.0 * UNIT / (MASS * LENGTH), 0.0, 0.0]}),
        UNSTABLE,
        source="Greenhill 1881",
    ),
    Case(
        ABOVE,
        "a history that starts there",
        planar(loads={"tip_force": [-520.0, 0.0]}, **STEADY),
        expected="warned",
        words="by a factor of",
        source="Euler",
    ),
    said(
        ABOVE,
        "two modes buckle, one is asked for",
        planar(loads={"tip_force": [-4000.0, 0.0]}, modes={"count": 1}),
        r"negative eigenvalues of the stiffness: 2",
        command="modes",
        source="Euler",
    ),
    said(ABOVE, "Beck's column at 23 EI/L²", planar(loads=FLUTTER), "flutter", source="Beck 1952: 20.05 EI/L²"),
    *(
        said(
            ABOVE,
            f"spatial beam, {theory}",
            spatial(theory, [-400.0, 0.0, 0.0]),
            UNSTABLE,
            source="Euler, 345 N about the weaker axis",
            nightly=theory == "reissner",
        )
        for theory in ("consistent_linear", "reissner")
    ),
    said(
        ABOVE,
        "spatial beam buckles sideways under a force across its stiff axis",
        spatial("reissner", [0.0, 400.0, 0.0])
        | {
            "structure": {
                "type": "spatial_beam",
                "length": LENGTH,
                "section": {**BLADE, "EI2": 2e3, "GJ": 1e3, "EI3": 1e6},
            }
        },
        UNSTABLE,
        source="Timoshenko: 4.013 √(EI GJ)/L² = 57 N",
        nightly=True,
    ),
    said(
        ABOVE,
        "shaft above its critical speed, held by gyroscopic forces",
        {**spatial("consistent_linear", [0.0, 0.0, 0.0]), "motion": SHAFT, "loads": {}},
        "gyroscopic forces alone hold it",
        source="√(EI/ρ) (1.8751/L)² = 3.80 rad/s",
    ),
    *(
        said(
            ABOVE,
            f"plate, {theory}, pressed in its plane",
            plate(theory, loads={"tip_force": [-6000.0, 0.0, 0.0]}),
            UNSTABLE,
            source="Euler, π²/4 EI/L² = 2.9 to 3.2 kN",
            nightly=theory == "reissner",
        )
        for theory in ("consistent_linear", "reissner")
    ),
    said(
        ABOVE,
        "plate that spins above its in-plane frequency, which the theory does not stiffen",
        plate("linear", motion={"type": "constant", "speed": 1200.0, "axis": [0.0, 0.0, 1.0]}),
        UNSTABLE,
        source="in-plane frequency 1.03e3 rad/s at rest",
        nightly=True,
    ),
    Case(
        "limit points",
        "von Kármán's column has no equilibrium above its limit load",
        planar("von_karman", loads={"tip_force": [-520.0, 0.01]}),
        expected="failed",
        words=r"at 0\.66\d* of the load; beyond it the structure snaps",
        source="Koiter: below the bifurcation at 345 N of 520 N",
    ),
    *(
        said(
            RANGE,
            f"{theory}, rolled up by 180 degrees",
            planar(theory, loads={"tip_moment": EI * np.pi / LENGTH}),
            "model.theory",
            source="a half circle",
            nightly=theory != "second_order",
        )
        for theory in ("linear", "second_order", "von_karman")
    ),
    *(
        said(
            RANGE,
            f"{theory}, bent by 100 lengths",
            planar(theory, loads={"tip_force": [0.0, 300.0 * UNIT]}),
            "out of its range",
            source="no point of a clamped beam moves by more than two",
        )
        for theory in ("linear", "consistent_linear")
    ),
    said(
        RANGE,
        "linear, modes at 3 rad/s",
        planar("linear", {"speed": 3.0}, modes={"count": 2}),
        'model.theory = "linear" is in error',
        command="modes",
        source="reissner: 4.05 rad/s",
    ),
    said(
        RANGE,
        "linear, flap of a spinning plate",
        plate("linear", motion={"type": "constant", "speed": 300.0, "axis": [0.0, 1.0, 0.0]}, modes={"count": 1}),
        "out of its range",
        command="modes",
        source="Southwell: at least the speed",
        nightly=True,
    ),
]
