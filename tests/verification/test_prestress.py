"""What a loaded state does in further displacements: geometric stiffness of all stress resultants, or of N⁰ alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.linalg import eigh

from rotfem import Scene, SceneError, run
from rotfem.commands.problem import Problem

Array = npt.NDArray[np.float64]

#: Deep in the plane of its load: what it deflects before it buckles is a ten thousandth, and so is the error of that.
DEEP: dict[str, Any] = {"EA": 1e6, "GA2": 1e6, "GA3": 1e6, "GJ": 0.5, "EI2": 1.0, "EI3": 1e4, "mass_per_length": 1.0}
DEEP |= {"rotary_inertia2": 1e-4, "rotary_inertia3": 1e-4}

#: Critical P L²/(EI₂ GJ)^½ of a force at the tip, and q L³/(EI₂ GJ)^½ of an even one: Timoshenko & Gere 1961, 6.4.
TIP, EVEN = 4.0126, 12.85


def cantilever(theory: str, loads: dict[str, Any], **model: Any) -> Scene:
    return Scene.from_dict(
        {
            "structure": {"type": "spatial_beam", "length": 1.0, "section": DEEP},
            "motion": {"type": "constant", "speed": 0.0},
            "model": {"theory": theory, **model},
            "loads": loads,
            "mesh": {"elements": 8, "degree": 3},
        }
    )


def dense(system: Any, factor: float) -> Array:
    """Return the stiffness at rest under a part of the loads, without clamped rows and columns."""
    system.set_time(0.0, None, factor)
    K = system.mass_damping_stiffness()[2]
    free = np.setdiff1d(np.arange(system.scale.size), system.clamped)
    return np.array(K.convert("dense").getDenseArray())[np.ix_(free, free)]


def critical_factor(s: Scene) -> float:
    """Return the least part of the loads of a linear theory under which its stiffness is singular."""
    system = Problem.of(s).system(moving=False)
    K = dense(system, 0.0)
    change = dense(system, 1.0) - K
    assert np.max(np.abs(change - change.T)) <= 1e-12 * np.max(np.abs(K))
    ratios = eigh(change, K, eigvals_only=True)
    return float(-1 / min(ratios.min(), -1e-300))


@pytest.mark.parametrize(("load", "number"), [("tip_force", TIP), ("distributed", EVEN)])
def test_lateral_buckling(load: str, number: float) -> None:
    """The moments before buckling are those of the load; the numbers of the book have their digits rounded."""
    found = critical_factor(cantilever("consistent_linear", {load: [0.0, 1.0, 0.0]}))
    assert found == pytest.approx(number * np.sqrt(0.5), rel=1e-3 if load == "distributed" else 1e-4)


def test_axial_forces_alone_do_not_see_it() -> None:
    """N⁰ is zero under a force across the beam; a push is Euler's either way, π²/4 EI₂/L²."""
    across, along = {"tip_force": [0.0, 1.0, 0.0]}, {"tip_force": [-1.0, 0.0, 0.0]}
    assert critical_factor(cantilever("consistent_linear", across, prestress="axial")) > 1e6
    for prestress in ("axial", "all"):
        found = critical_factor(cantilever("consistent_linear", along, prestress=prestress))
        assert found == pytest.approx(np.pi**2 / 4, rel=1e-4)


def test_stability_is_told() -> None:
    """2.8373 is between."""
    for force, stable in ((2.83, True), (2.845, False)):
        s = cantilever("consistent_linear", {"tip_force": [0.0, force, 0.0]})
        assert run(s).summary["stability"]["stable"] is stable


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"model.theory": "reissner"}, "model.prestress.*consistent_linear"),
        ({"model.prestress": "none"}, "model.prestress.*axial"),
    ],
)
def test_where_there_is_no_choice(changes: dict[str, str], words: str) -> None:
    s = cantilever("consistent_linear", {}, prestress="axial")
    with pytest.raises(SceneError, match=words):
        s.replace(changes)


def test_plates_have_membrane_forces() -> None:
    plate = {"type": "plate", "length": 1.0, "width": 0.5, "thickness": 0.01, "E": 1e9, "nu": 0.3, "rho": 1e3}
    tables = {"structure": plate, "motion": {"type": "constant", "speed": 1.0}}
    with pytest.raises(SceneError, match=r"model\.prestress.*needs a beam"):
        Scene.from_dict(tables | {"model": {"theory": "consistent_linear", "prestress": "all"}})
