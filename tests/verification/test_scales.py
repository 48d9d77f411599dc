"""A beam or plate in other units of length, mass and time is the same: its numbers are those units times the old ones.

What may differ is round-off: of a frequency as much as its `error_bound`, which is below 1e-7 for all cases here, of a
displacement of a steady state and of a history, whose forces are in balance to a few units of round-off, 1e-10.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rotfem import campbell, modes, run

#: Units of length, mass and time in m, kg and s.
UNITS = [
    (1e-4, 1.0, 1.0),
    (1e-8, 1e-12, 1e-9),
    (1e-8, 1e3, 1e3),
    (1e4, 1.0, 1e-6),
]

ONE = (1.0, 1.0, 1.0)


def scene(kind: str, theory: str, units: tuple[float, float, float], speed: float = 6.0) -> dict[str, Any]:
    """Return a scene whose dimensionless numbers do not depend on the units."""
    m, kg, s = units
    N, Pa = kg * m / s**2, kg / (m * s**2)
    beam = {"EA": 2.8e7 * N, "mass_per_length": 1.2 * kg / m}
    structure: dict[str, Any] = {
        "planar_beam": {
            "length": 10 * m,
            "hub_radius": 0.5 * m,
            "section": {**beam, "GA": 1e7 * N, "EI": 1.4e4 * N * m**2, "rotary_inertia": 6e-4 * kg * m},
        },
        "spatial_beam": {
            "length": 10 * m,
            "section": {
                **beam,
                **{
                    "GA2": 1e7 * N,
                    "GA3": 1e7 * N,
                    "GJ": 1e4 * N * m**2,
                    "EI2": 1.4e4 * N * m**2,
                    "EI3": 4e4 * N * m**2,
                },
                **{"rotary_inertia2": 6e-4 * kg * m, "rotary_inertia3": 1e-3 * kg * m},
            },
        },
        "plate": {
            **{"length": 1.0 * m, "width": 0.5 * m, "thickness": 0.01 * m},
            **{"E": 7e10 * Pa, "nu": 0.3, "rho": 2700 * kg / m**3},
        },
    }[kind]
    return {
        "structure": {"type": kind, **structure},
        "motion": {"type": "constant", "speed": speed / s},
        "model": {"theory": theory},
        "mesh": {"elements": [4, 4] if kind == "plate" else 4},
        "modes": {"count": 5},
    }


@pytest.mark.parametrize(
    ("kind", "theory"),
    [("planar_beam", "reissner"), ("plate", "consistent_linear"), ("plate", "reissner"), ("spatial_beam", "reissner")],
)
def test_modes(kind: str, theory: str) -> None:
    """Eigenvalues times the unit of time agree to their bounds, shapes to 1e-4, and no instability is reported."""
    expected = modes(scene(kind, theory, ONE))
    for units in UNITS:
        result = modes(scene(kind, theory, units))
        bound = expected.column("error_bound") + result.column("error_bound")
        distance = np.abs(result.eigenvalues * units[2] - expected.eigenvalues) / np.abs(expected.eigenvalues)
        assert np.all(bound < 1e-7)
        assert np.all(distance <= bound), units
        assert result.labels == expected.labels
        assert result.summary["warnings"] == expected.summary["warnings"]
        for shape, other in zip(result.shapes.values(), expected.shapes.values(), strict=True):
            for name in (name for name in shape if name not in ("x", "y")):
                np.testing.assert_allclose(np.abs(shape[name]), np.abs(other[name]), atol=1e-4, err_msg=name)


def test_campbell() -> None:
    """Critical speeds and the onset of the linear theory's instability keep to the unit of time."""
    speeds = np.array([0.0, 2.0, 5.0])
    expected = campbell(scene("planar_beam", "linear", ONE), speeds)
    assert [i.kind for i in expected.instabilities] == ["static instability"]
    for units in UNITS[1:3]:
        result = campbell(scene("planar_beam", "linear", units), speeds / units[2])
        for of in ("critical_speeds", "instabilities"):
            both = [[c.speed for c in getattr(r, of)] for r in (result, expected)]
            np.testing.assert_allclose(np.array(both[0]) * units[2], both[1], rtol=1e-6)


@pytest.mark.parametrize(
    ("kind", "theory"), [("planar_beam", "reissner"), ("planar_beam", "consistent_linear"), ("plate", "von_karman")]
)
def test_steady_state_and_history(kind: str, theory: str) -> None:
    """The stretch of the steady state and the tip's path in a spin-up, over the unit of length."""

    def figures(units: tuple[float, float, float]) -> np.ndarray[Any, Any]:
        m, _, s = units
        still = scene(kind, theory, units)
        turning = {"type": "spin_up", "speed": 6.0 / s, "duration": 1.0 * s}
        moving = {**still, "motion": turning, "time": {"end": 0.1 * s, "step": 0.01 * s}}
        return np.append(run(moving).history["tip_u2"], run(still).history["tip_u1"]) / m

    expected = figures(ONE)
    for units in UNITS[1:3]:
        np.testing.assert_allclose(figures(units), expected, rtol=1e-9, atol=1e-10 * np.max(np.abs(expected)))
