"""Equilibria by load steps: buckled columns against elliptic integrals, a limit point against shooting."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

import rotfem

LENGTH, EI, MASS = 10.0, 1.4e4, 1.2


def column(side: float, load: float = -520.0, **tables: Any) -> dict[str, Any]:
    """Return the scene of a column of which stretch and shear change lengths by less than 1e-6, buckling at 345 N."""
    section = {"EA": 2.8e9, "GA": 1.0e9, "EI": EI, "mass_per_length": MASS}
    return {
        "structure": {"type": "planar_beam", "length": LENGTH, "section": section},
        "motion": {"type": "constant", "speed": 0.0},
        "loads": {"tip_force": [load, side]},
        "mesh": {"elements": 12},
        **tables,
    }


def elastica(load: float) -> list[float]:
    """Return (u1, u2) of the tip of a buckled cantilever: with modulus k, K(k)² = P L²/EI, x = 2E/K − 1, y = 2k/K."""
    k = brentq(lambda k: ellipk(k * k) ** 2 - load * LENGTH**2 / EI, 1e-6, 1 - 1e-9)
    K, E = ellipk(k * k), ellipe(k * k)
    return [LENGTH * (2 * E / K - 2), LENGTH * 2 * k / K]


@pytest.mark.parametrize("load", [400.0, 520.0, 900.0])
def test_buckled_column_is_the_elastica(load: float) -> None:
    # The side force of 1e-4 N only says to which side; it moves the tip by less than 1e-5 of its length.
    result = rotfem.run(column(1e-4, -load))
    tip = [float(result.tip[name][-1]) for name in ("u1", "u2")]
    np.testing.assert_allclose(tip, elastica(load), rtol=2e-5)
    assert result.summary["stability"]["stable"]


def test_column_without_a_side_stays_straight_and_is_said_to_be_unstable() -> None:
    summary = rotfem.run(column(0.0)).summary
    assert not summary["stability"]["stable"]
    # The bifurcation is Euler's load, but for shear, P/GA = 3e-7, and the smallest step of the load, 1e-5.
    (line,) = [line for line in summary["warnings"] if "bifurcation" in line]
    assert float(line.split(" at ")[1].split(" of ")[0]) == pytest.approx(np.pi**2 / 4 * EI / LENGTH**2 / 520, rel=3e-5)


def test_loads_beyond_all_numbers() -> None:
    """No equilibrium, in the words of the program and without a warning of numpy."""
    scene = column(0.0, motion={"type": "constant", "speed": -6e60}, loads={})
    scene["structure"]["hub_radius"] = 5e59
    with pytest.raises(rotfem.ComputationError, match="no steady state at -6e\\+60 rad/s"):
        rotfem.run(scene)


def test_newton_does_not_jump_to_another_stable_branch() -> None:
    """One step of the whole load ends at the buckled shape of the other side, stable too: u₂ = −7.55 m.

    Small steps of the load lead to +7.78 m.
    """
    loads = {"tip_force": [-607.9834934025005, 40.88110935649087], "tip_moment": 744.2598935708211}
    loads["distributed"] = [0.0, 0.01781308616664456]
    section = {"EA": 2.8e7, "GA": 1.0e7, "EI": EI, "mass_per_length": MASS, "rotary_inertia": 6e-4}
    scene = column(0.0, loads=loads, mesh={"elements": 6})
    scene["structure"]["section"] = section
    assert rotfem.run(scene).tip["u2"][-1] == pytest.approx(7.78, abs=0.01)


def test_limit_point_stops_a_run() -> None:
    with pytest.raises(rotfem.ComputationError, match=r"at 0\.66\d+ of the load; beyond it the structure snaps"):
        rotfem.run(column(1e-2, model={"theory": "von_karman"}))


HUB, SPEED, SIDE = 12.0, 5.0, 0.5


def inward_blade() -> dict[str, Any]:
    """Return a blade on a ring of radius 12 m that points inwards: its own weight in the spin presses it."""
    section = {"EA": 2.8e7, "GA2": 1e7, "GA3": 1e7, "GJ": 1e5, "EI2": EI, "EI3": 5e4, "mass_per_length": MASS}
    blade = {"hub_offset": [HUB, 0.0, 0.0], "precone": float(np.pi), "section": section}
    return {
        "structure": {"type": "spatial_beam", "length": LENGTH, **blade},
        "motion": {"type": "constant", "speed": SPEED},
        "mesh": {"elements": 8},
        "loads": {"tip_force": [0.0, 0.0, SIDE]},
    }


def test_inward_blade_snaps() -> None:
    """The largest share of the load at which the inextensible blade has an equilibrium, by shooting: 0.8177703.

    Stretch and shear are 3e-5 at most; the smallest step of the load is 1e-5.
    """
    with pytest.raises(rotfem.ComputationError, match="beyond it the structure snaps") as failure:
        rotfem.run(inward_blade())
    share = float(failure.value.what.split("equilibrium was at ")[1].split(" of ")[0])
    assert share == pytest.approx(0.8177703, rel=2e-4)


def test_a_path_past_limit_points_is_refused_in_words() -> None:
    with pytest.raises(rotfem.SceneError, match=r"solver.continuation: unknown key"):
        rotfem.Scene.from_dict(column(0.0, solver={"continuation": "arc_length"}))
