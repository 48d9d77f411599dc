"""The path of equilibria: buckled columns against elliptic integrals, snapping against shooting, Koiter's power law."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar, root
from scipy.special import ellipe, ellipk

import rotfem
from rotfem.analysis.equilibrium import LoadPath, Tracer
from rotfem.analysis.load_steps import LoadFactors
from rotfem.numerics.newton import Newton

pytestmark = pytest.mark.usefixtures("unestimated")

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


@pytest.mark.parametrize("continuation", ["load", "arc_length"])
@pytest.mark.parametrize("load", [400.0, 520.0, 900.0])
def test_buckled_column_is_the_elastica(continuation: str, load: float) -> None:
    # The side force of 1e-4 N only says to which side; it moves the tip by less than 1e-5 of its length.
    result = rotfem.run(column(1e-4, -load, solver={"continuation": continuation}))
    tip = [float(result.tip[name][-1]) for name in ("u1", "u2")]
    np.testing.assert_allclose(tip, elastica(load), rtol=2e-5)
    assert result.summary["stability"]["stable"]


def test_column_without_a_side_stays_straight_and_is_said_to_be_unstable() -> None:
    summary = rotfem.run(column(0.0)).summary
    assert not summary["stability"]["stable"]
    # The bifurcation is Euler's load, but for shear, P/GA = 3e-7, and the step at which it is bracketed, 1e-6.
    (line,) = [line for line in summary["warnings"] if "bifurcation" in line]
    assert float(line.split(" at ")[1].split(" of ")[0]) == pytest.approx(np.pi**2 / 4 * EI / LENGTH**2 / 520, rel=1e-5)


def test_loads_beyond_all_numbers() -> None:
    """The slope of the path overflows: no equilibrium, in the words of the program and without a warning of numpy."""
    scene = column(0.0, motion={"type": "constant", "speed": -6e60}, loads={})
    scene["structure"]["hub_radius"] = 5e59
    with pytest.raises(rotfem.ComputationError, match="no steady state at -6e\\+60 rad/s"):
        rotfem.run(scene)


def test_newton_does_not_jump_to_another_stable_branch() -> None:
    """One step of the whole load ends at the buckled shape of the other side, stable too: u₂ = −7.55 m.

    The path of equilibria ends at +7.78 m. Both ways solve the same equations to 1e-9; 1e-6 leaves them the condition
    of a shape near buckling.
    """
    loads = {"tip_force": [-607.9834934025005, 40.88110935649087], "tip_moment": 744.2598935708211}
    loads["distributed"] = [0.0, 0.01781308616664456]
    section = {"EA": 2.8e7, "GA": 1.0e7, "EI": EI, "mass_per_length": MASS, "rotary_inertia": 6e-4}
    scene = column(0.0, loads=loads, mesh={"elements": 6})
    scene["structure"]["section"] = section
    tips = [rotfem.run(scene | {"solver": {"continuation": way}}).tip["u2"][-1] for way in ("load", "arc_length")]
    assert tips[0] > 7.0
    assert tips[0] == pytest.approx(tips[1], rel=1e-6)


def traced(scene: dict[str, Any], past_limits: bool = False) -> LoadPath:
    problem = rotfem.Problem.of(scene)
    system = problem.system(moving=False).held
    return Tracer(system, LoadFactors(problem.motion.speed(0.0)), Newton()).follow(past_limits)


def test_imperfections_lower_the_limit_load_by_koiters_power_law() -> None:
    # Von Kármán's column buckles into less load: its limit load falls with the 2/3 power of the imperfection.
    bare = column(0.0, model={"theory": "von_karman"})
    (perfect,) = traced(bare).branches
    lost = []
    for side in (1e-3, 1e-2):
        path = traced(column(side, model={"theory": "von_karman"}))
        assert path.share < 1.0
        lost.append(perfect - path.limits[0])
    # The next term is of relative size imperfection^(2/3) = 1e-3; the branch point is known to 1e-6 of 1e-4.
    assert np.log10(lost[1] / lost[0]) == pytest.approx(2 / 3, rel=0.02)


def test_limit_point_stops_a_run() -> None:
    with pytest.raises(rotfem.ComputationError, match=r"limit point, at 0\.66\d+ of the load"):
        rotfem.run(column(1e-2, model={"theory": "von_karman"}))


HUB, SPEED, SIDE = 12.0, 5.0, 0.5


def inward_blade(continuation: str) -> dict[str, Any]:
    """Return a blade on a ring of radius 12 m that points inwards: its own weight in the spin presses it."""
    section = {"EA": 2.8e7, "GA2": 1e7, "GA3": 1e7, "GJ": 1e5, "EI2": EI, "EI3": 5e4, "mass_per_length": MASS}
    blade = {"hub_offset": [HUB, 0.0, 0.0], "precone": float(np.pi), "section": section}
    return {
        "structure": {"type": "spatial_beam", "length": LENGTH, **blade},
        "motion": {"type": "constant", "speed": SPEED},
        "mesh": {"elements": 8},
        "loads": {"tip_force": [0.0, 0.0, SIDE]},
        "solver": {"continuation": continuation},
    }


def blade_by_shooting(turn: float, guess: tuple[float, float]) -> tuple[float, float, float]:
    """Return (share of the load, x, z) of the tip of the inextensible blade whose tip has turned by an angle.

    x' = cos φ, z' = sin φ, EI φ' = m, m' = n_x sin φ − n_z cos φ, n_x' = −s ρ Ω² x from the tip (x, z, π − turn) with
    m = n_x = 0 and n_z = s F to the root, where φ = π and x = R.
    """

    def rates(s: float, _: float, y: Any) -> list[float]:
        _x, _z, phi, m, n_x = y
        moment = n_x * np.sin(phi) - s * SIDE * np.cos(phi)
        return [np.cos(phi), np.sin(phi), m / EI, moment, -s * MASS * SPEED**2 * y[0]]

    def root_of(unknown: Any) -> Any:
        s, x = unknown
        start = [x, 0.0, np.pi - turn, 0.0, 0.0]
        return solve_ivp(partial(rates, s), (LENGTH, 0.0), start, rtol=1e-10, atol=1e-10).y[:, -1]

    found = root(lambda u: [(r := root_of(u))[2] - np.pi, r[0] - HUB], guess, tol=1e-10)
    assert found.success
    return float(found.x[0]), float(found.x[1]), float(-root_of(found.x)[1])


def test_inward_blade_snaps_outwards() -> None:
    # Stretch and shear are 3e-5 at most.
    most = minimize_scalar(
        lambda turn: -blade_by_shooting(turn, (0.8, HUB - LENGTH))[0], bounds=(0.05, 0.4), options={"xatol": 1e-5}
    )
    with pytest.raises(rotfem.ComputationError, match="limit point") as failure:
        rotfem.run(inward_blade("load"))
    share = float(failure.value.what.split("limit point, at ")[1].split(" of ")[0])
    assert share == pytest.approx(-most.fun, rel=1e-4)
    result = rotfem.run(inward_blade("arc_length"))
    tip = {name: float(values[-1]) for name, values in result.tip.items()}
    s, x, z = blade_by_shooting(tip["theta2"], (1.0, HUB - LENGTH + tip["u1"]))
    # The last angle fixes the load to 1e-3 only, as it hardly changes with it.
    assert s == pytest.approx(1.0, rel=3e-3)
    assert [HUB - LENGTH + tip["u1"], tip["u3"]] == pytest.approx([x, z], rel=1e-4)
    assert result.summary["stability"]["stable"]
    assert any("limit points at 0.81" in line for line in result.summary["warnings"])
