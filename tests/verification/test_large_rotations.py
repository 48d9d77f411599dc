"""Rotations of any size: beams and plates rolled up by turns, motions beyond a turn, what a new reference leaves."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial.transform import Rotation

import rotfem
from rotfem import Scene
from rotfem.analysis.equilibrium import recounted
from rotfem.analysis.march import keep_rotations_small
from rotfem.analysis.schemes import State
from rotfem.commands.problem import Problem
from tests.plate_mesh_files import write_msh

Array = npt.NDArray[np.float64]

U, THETA = ("tip_u1", "tip_u2", "tip_u3"), ("tip_theta1", "tip_theta2", "tip_theta3")
AT_REST = {"type": "constant", "speed": 0.0}

#: A beam that bends and twists alike, so that a moment m at its tip makes a helix or a circle of it, exactly.
BEAM: dict[str, Any] = {
    "structure": {
        "type": "spatial_beam",
        "length": 1.0,
        "section": {"EA": 1e4, "GA2": 4e3, "GA3": 4e3, "GJ": 1.0, "EI2": 1.0, "EI3": 1.0, "mass_per_length": 1.0},
    },
    "motion": AT_REST,
    "mesh": {"elements": 10, "degree": 3},
}


# --- rolled up ------------------------------------------------------------------------------------------------------


def test_plate_rolled_up(tmp_path: Path) -> None:
    """A strip 10 × 1 along direction 2, ν = 0, rolled up by a turn about 1, where the director's angles have a pole.

    To the circle of Green's strains, N = 0 and M = EI λ² κ with the stretch λ² = 1 − h² κ²/6 of the mid-surface.
    """
    n, h = 16, 0.01
    along, across = np.meshgrid(np.linspace(0, 10, n + 1), [0.0, 1.0], indexing="ij")
    cells = [[2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1] for i in range(n)]
    groups = {"clamped": [[0, 1]], "tip": [[2 * n, 2 * n + 1]], "plate": cells}
    mesh = str(write_msh(tmp_path / "strip.msh", np.column_stack([across.ravel(), along.ravel()]), groups))
    result = rotfem.run(
        {
            "structure": {"type": "plate", "mesh": mesh, "thickness": h, "E": 1e7, "nu": 0.0, "rho": 1.0},
            "motion": AT_REST,
            "loads": {"tip_moment": [2 * np.pi / 10 * 1e7 * h**3 / 12, 0.0, 0.0]},
        }
    )
    kappa = 2 * np.pi / 10
    for _ in range(50):
        kappa = 2 * np.pi / 10 / (1 - h**2 * kappa**2 / 6)
    stretch = np.sqrt(1 - h**2 * kappa**2 / 6)
    expected = [stretch * np.sin(10 * kappa) / kappa - 10, stretch * (1 - np.cos(10 * kappa)) / kappa]
    tip = {name: values[-1] for name, values in result.tip.items()}
    np.testing.assert_allclose([tip["u2"], tip["u3"]], expected, rtol=0, atol=1e-5)
    assert tip["alpha2"] == pytest.approx(10 * kappa, rel=1e-6)
    assert abs(tip["alpha1"]) < 1e-6


# --- in motion ------------------------------------------------------------------------------------------------------


def wound(kind: str) -> dict[str, Any]:
    """Return a soft beam on a spinning hub that a moment winds up by two turns within a second."""
    section: dict[str, Any] = {"EA": 1e4, "mass_per_length": 1.0}
    if kind == "planar_beam":
        section |= {"GA": 3e3, "EI": 1.0, "rotary_inertia": 1e-3}
    else:
        section |= {"GA2": 3e3, "GA3": 3e3, "GJ": 1.0, "EI2": 1.3, "EI3": 1.0}
        section |= {"rotary_inertia2": 1e-3, "rotary_inertia3": 1e-3}
    rows = [[0.0, 0.0], [1.0, 12.0]]
    table = rows if kind == "planar_beam" else [[t, 0.0, 0.0, M] for t, M in rows]
    return {
        "structure": {"type": kind, "length": 1.0, "hub_radius": 0.1, "section": section},
        "motion": {"type": "constant", "speed": 1.0},
        "mesh": {"elements": 8},
        "loads": {"tip_moment": {"over_time": table}},
        "time": {"end": 1.0, "step": 4e-3},
        "solver": {"increment_tolerance": 1e-12},
    }


@pytest.mark.slow
def test_history_beyond_a_turn_is_the_planar_beams() -> None:
    """The tip turns by 1.5 turns; the planar beam has no limit. What is left is round-off that the motion amplifies."""
    planar, spatial = (rotfem.run(wound(kind)).history for kind in ("planar_beam", "spatial_beam"))
    assert np.max(planar["tip_alpha"]) > 9.0
    for one, other in {"tip_alpha": "tip_theta3", "tip_u1": "tip_u1", "tip_u2": "tip_u2", "jacobi": "jacobi"}.items():
        np.testing.assert_allclose(spatial[other], planar[one], rtol=0, atol=1e-8 * np.max(np.abs(planar[one])))


# --- what a change of the reference leaves as it is -----------------------------------------------------------------


def bent(kind: str, elements: int) -> tuple[Any, State]:
    """Return a system and a smooth motion of it, in which rotations are due to be counted afresh."""
    if kind == "plate":
        plate = {"type": "plate", "length": 1.0, "width": 0.3, "thickness": 0.01, "E": 1e7, "nu": 0.3, "rho": 1e3}
        tables: dict[str, Any] = {"structure": plate, "mesh": {"elements": [elements, 2]}}
    else:
        tables = copy.deepcopy(BEAM) | {"mesh": {"elements": elements}}
    system = Problem.of(Scene.from_dict(tables | {"motion": AT_REST})).system()
    x = system.V.tabulate_dof_coordinates()
    size, rng = system.structure.size, np.random.default_rng(3)

    def field(scale: float) -> Array:
        parts = rng.standard_normal((3, size)) * np.where(np.arange(size) < 3, 0.1, scale)
        return np.sum([x[:, :1] ** (k + 1) * (1 + 0.3 * x[:, 1:2]) * parts[k] for k in range(3)], axis=0).ravel()

    q, v, a = field(1.0), field(1.0), field(1.0)
    turns = system.structure.turns
    q.reshape(-1, size)[:, turns.components] *= 0.95 / turns.reached(q)
    return system, State(0.0, q, v, a, memory=a.copy())


@pytest.mark.parametrize("kind", ["spatial_beam", "plate"])
def test_energy_and_orientation_do_not_feel_a_new_datum(kind: str) -> None:
    """To round-off: strains are kept at the points of integration, orientations and their rates at the nodes."""
    system, state = bent(kind, 8)
    scheme = rotfem.GeneralisedAlpha()

    def read() -> tuple[float, Array]:
        system.set_time(0.0)
        system.set_state(state.q, state.v, state.a)
        return system.energies()["strain"], system.tip(state.q, 0.0)

    strain, tip = read()
    assert keep_rotations_small(system, scheme, state, 0.0)
    assert system.structure.turns.reached(state.q) == 0.0
    changed, same = read()
    assert changed == pytest.approx(strain, rel=1e-10)
    np.testing.assert_allclose(same, tip, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(state.memory, state.a)


def test_rates_go_over_to_a_new_datum() -> None:
    """Rates and second rates from the reference are those of the same motion, by differences: Λ(t) R⁻¹ = exp(θ(t))."""
    system, state = bent("spatial_beam", 2)
    theta, v, a = (x.reshape(-1, 6)[:, 3:].copy() for x in (state.q, state.v, state.a))
    keep_rotations_small(system, rotfem.GeneralisedAlpha(), state, 0.0)
    h = 1e-3
    R = Rotation.from_rotvec(theta)
    before, after = ((Rotation.from_rotvec(theta + t * v + t * t / 2 * a) * R.inv()).as_rotvec() for t in (-h, h))
    np.testing.assert_allclose(state.v.reshape(-1, 6)[:, 3:], (after - before) / (2 * h), rtol=0, atol=1e-5)
    np.testing.assert_allclose(state.a.reshape(-1, 6)[:, 3:], (after + before) / h**2, rtol=0, atol=1e-4)


def test_a_rigid_turn_strains_nothing() -> None:
    """Counted from a shape that was turned rigidly, by any number of turns, the beam is free of strain to round-off."""
    system, _ = bent("spatial_beam", 4)
    x, turn = system.V.tabulate_dof_coordinates()[:, 0], np.array([1.3, -0.7, 1.9])
    for count in range(1, 4):
        total = Rotation.from_rotvec(count * turn)
        q = np.zeros((len(x), 6))
        q[:, :3] = np.outer(x, total.apply([1.0, 0.0, 0.0]) - [1.0, 0.0, 0.0])
        q[:, 3:] = turn
        q = q.ravel()
        q = recounted(system, q)
        system.set_time(0.0)
        system.set_state(q)
        assert system.energies()["strain"] < 1e-20
        tip = Rotation.from_rotvec(system.tip(q, 0.0)[3:])
        np.testing.assert_allclose((tip * total.inv()).as_rotvec(), 0.0, rtol=0, atol=1e-13)


@pytest.mark.slow
def test_a_motion_starts_where_another_system_is() -> None:
    """An equilibrium beyond a turn is one for a motion too, whose rotations are counted from the same shape.

    The tolerance is that of the equilibrium, 1e-9 of the length, and the vibration that what it leaves sets off.
    """
    section = {"EA": 2.8e5, "GA2": 1e5, "GA3": 1e5, "GJ": 1e4, "EI2": 1.4e4, "EI3": 1.4e4, "mass_per_length": 1.2}
    scene = {
        "structure": {"type": "spatial_beam", "length": 10.0, "section": section},
        "motion": {"type": "constant", "speed": 0.0},
        "loads": {"tip_moment": {"value": [0.0, 0.0, 2.2 * np.pi * 1.4e3], "kind": "follower"}},
        "mesh": {"elements": 8},
    }
    problem = rotfem.Problem.of(scene)
    steady = problem.steady()
    assert steady.state.reference is not None
    *_, last = problem.march(end=0.01, step=0.005, start=steady)
    np.testing.assert_allclose(list(last.tip.values()), list(steady.tip.values()), rtol=0, atol=1e-7)
    assert last.tip["theta3"] == pytest.approx(2.2 * np.pi, abs=1e-9)
    coarse = problem.replace(mesh=rotfem.BeamMesh(elements=3))
    with pytest.raises(rotfem.InputError, match="unknowns of this structure and mesh"):
        next(coarse.march(end=0.01, step=0.005, start=steady))
