"""Stability of equilibria: buckling, flutter, growth rates and gyroscopic stabilisation against closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rotfem

LENGTH, EI, MASS = 10.0, 1.4e4, 1.2
UNIT = EI / LENGTH**2  # of forces, N
RATE = np.sqrt(EI / MASS) / LENGTH**2  # 1/s


def beam(load: tuple[float, float] | None = None, **tables: Any) -> dict[str, Any]:
    """Return a scene of a planar beam so slender and so stiff in shear that it is Euler's column to 1e-4."""
    section = {"EA": 2.8e7, "GA": 1.0e7, "EI": EI, "mass_per_length": MASS}
    scene: dict[str, Any] = {
        "structure": {"type": "planar_beam", "length": LENGTH, "section": section},
        "motion": {"type": "constant", "speed": 0.0},
        "mesh": {"elements": 8},
    }
    return {**scene, **({"loads": {"tip_force": list(load)}} if load else {}), **tables}


@pytest.mark.parametrize("theory", ["reissner", "consistent_linear"])
def test_column_buckles_at_eulers_load(theory: str) -> None:
    # Shear and stretch change Euler's load by 345/1e7 and the like; 1e-3 is far above that.
    euler = np.pi**2 / 4 * UNIT
    for share, stable in ((0.999, True), (1.001, False)):
        summary = rotfem.run(beam((-share * euler, 0.0), model={"theory": theory})).summary
        assert summary["stability"]["stable"] is stable
        assert any("unstable equilibrium" in line for line in summary["warnings"]) is not stable


def test_growth_rate_of_a_buckling_column() -> None:
    # w'''' + p w'' + s² w = 0, the zero of its determinant. 3.7 EI/L² is 520 N, half as much again as Euler's. The
    # lateral force moves the beam by 1e-4 of its length only.
    summary = rotfem.run(beam((-3.7 * UNIT, 0.0))).summary
    assert summary["stability"]["negative_eigenvalues"] == 1
    assert summary["stability"]["growth_rate"] == pytest.approx(2.8682059, rel=1e-3)
    assert summary["stability"]["frequency"] == 0.0


def test_column_under_its_own_weight() -> None:
    # Greenhill 1881: rho a L³/EI = 7.8373, from the zero of a Bessel function; here the base is accelerated.
    for share, stable in ((7.83, True), (7.85, False)):
        motion = {"type": "constant", "speed": 0.0, "base_acceleration": [share * UNIT / (MASS * LENGTH), 0.0, 0.0]}
        assert rotfem.run(beam(motion=motion)).summary["stability"]["stable"] is stable


def test_becks_column_flutters() -> None:
    # Beck 1952: 20.05 EI/L². No static instability ever.
    for p, stable in ((19.9, True), (20.2, False)):
        loads = {"tip_force": {"value": [-p * UNIT, 0.0], "kind": "follower"}}
        assert rotfem.run(beam(loads=loads)).summary["stability"]["stable"] is stable
    loads = {"tip_force": {"value": [-23.0 * UNIT, 0.0], "kind": "follower"}}
    found = rotfem.run(beam(loads=loads)).summary
    # The zero of the determinant of Euler's column; shear and stretch change it by some 1e-4.
    wanted = 4.0721033 + 11.6387968j
    assert found["stability"]["growth_rate"] == pytest.approx(wanted.real, rel=3e-3)
    assert found["stability"]["frequency"] == pytest.approx(wanted.imag, rel=3e-3)
    assert any("flutter" in line for line in found["warnings"])


SHAFT = {
    "type": "spatial_beam",
    "length": 1.0,
    "section": {"EA": 1e6, "GA2": 4e5, "GA3": 4e5, "GJ": 1.0, "EI2": 1.0, "EI3": 1.0, "mass_per_length": 1.0},
}


def shaft(damping: float, frame: str = "rotating") -> dict[str, Any]:
    """Return a cantilever shaft that spins about its own axis above its critical speed 3.516."""
    motion = {"type": "constant", "speed": 5.0, "axis": [1.0, 0.0, 0.0]}
    structure = {**SHAFT, "damping": {"rayleigh": [damping, 0.0]}}
    return {
        "structure": structure,
        "motion": motion,
        "model": {"theory": "consistent_linear", "frame": frame},
        "mesh": {"elements": 6},
    }


def test_supercritical_shaft_is_held_by_gyroscopic_forces() -> None:
    # In the fixed frame it vibrates at ±3.516, in the turning one at 5 ± 3.516: stable, there no minimum of energy.
    assert rotfem.run(shaft(0.0, "fixed")).summary["stability"] == {
        "stable": True,
        "growth_rate": 0.0,
        "negative_eigenvalues": 0,
    }
    result = rotfem.modes({**shaft(0.0), "modes": {"count": 2}})
    assert result.summary["stability"] == {
        "stable": True,
        "growth_rate": 0.0,
        "negative_eigenvalues": 2,
        "held_by_gyroscopic_forces": True,
    }
    assert any("gyroscopic forces alone hold it" in line for line in result.summary["warnings"])
    assert rotfem.run(shaft(0.0)).summary["stability"]["stable"]


def test_damping_that_turns_with_a_supercritical_shaft_makes_it_unstable() -> None:
    # z'' + (2 i Ω + a0) z' + (ω² − Ω²) z = 0 with z = u2 + i u3.
    a0, speed, omega = 0.1, 5.0, 1.8751040687**2
    wanted = max(np.roots([1, 2j * speed + a0, omega**2 - speed**2]), key=lambda x: x.real)
    for frame, turned in (("rotating", 0.0), ("fixed", speed)):
        found = rotfem.run(shaft(a0, frame)).summary["stability"]
        assert not found["stable"]
        assert found["growth_rate"] == pytest.approx(wanted.real, rel=1e-3)
        assert found["frequency"] == pytest.approx(abs(wanted.imag + turned), rel=1e-3)


def test_history_from_an_unstable_equilibrium() -> None:
    time = {"time": {"end": 0.02, "step": 0.01}}
    assert rotfem.run(beam((-300.0, 0.0), **time)).summary["stability"]["stable"] is True
    warnings = rotfem.run(beam((-500.0, 0.0), **time)).summary["warnings"]
    assert any("unstable equilibrium" in line and "by a factor of" in line for line in warnings)
    with pytest.raises(rotfem.ComputationError, match=r"unstable equilibrium.*initial.state = \"undeformed\""):
        rotfem.run(beam((-500.0, 0.0), time={"end": 20.0, "step": 0.01}))


@pytest.mark.parametrize("theory", ["reissner", "consistent_linear"])
def test_history_that_never_leaves_an_unstable_equilibrium(theory: str) -> None:
    # A straight column under an axial load only shortens, above Euler's load as below.
    tables = {"model": {"theory": theory}, "time": {"end": 0.05, "step": 0.01}, "initial": {"state": "undeformed"}}
    for load, stable in ((-500.0, False), (-300.0, True)):
        result = rotfem.run(beam((load, 0.0), **tables))
        assert np.all(np.abs(result.tip["u2"]) < 1e-9)
        assert result.summary["stability"]["stable"] is stable
        assert any("unstable equilibrium" in line for line in result.summary["warnings"]) is not stable


@pytest.mark.parametrize("force", [5.0, -1.0])
def test_round_off_of_a_slender_beam_is_no_bifurcation(force: float) -> None:
    """r/L = 3e-7 on 256 elements, pulled, and pressed by 0.4 of Euler's load: pivots change their signs at random."""
    section = {"EA": 1e13, "GA": 3e12, "EI": 1.0, "mass_per_length": 1.0, "rotary_inertia": 1e-13}
    scene = {
        "structure": {"type": "planar_beam", "length": 1.0, "section": section},
        "motion": {"type": "constant", "speed": 0.0},
        "loads": {"tip_force": [force, 0.0]},
        "mesh": {"elements": 256},
        "output": {"error": False},
    }
    result = rotfem.run(scene)
    assert not any("bifurcation" in text or "unstable" in text for text in result.summary["warnings"])
    assert result.summary["stability"]["stable"] is not False
