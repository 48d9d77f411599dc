"""Newton's method in time steps, and in the shapes a history starts from: slender structures, large and stiff motions.

A slender beam's axial stiffness makes its solution simple (the axis keeps its length) and Newton's way to it hard. So
what is held here are limits in which the answer is known: the elastica, the slenderness that no longer matters, the
creep of a beam that is all viscosity.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rotfem import ComputationError, run
from rotfem.analysis.equilibrium import static_tip_shape
from rotfem.commands.problem import Problem
from rotfem.equations.compiled import compile_system
from rotfem.numerics.newton import Newton
from rotfem.scene import Scene

LENGTH, EI, MASS = 10.0, 1.4e4, 1.2


def beam(slenderness: float, displacement: float, **changes: Any) -> Scene:
    """Return the release of a beam with L/r = slenderness from a tip displacement (in L), step 0.02 s."""
    squared = (LENGTH / slenderness) ** 2
    section = {"EA": EI / squared, "GA": EI / squared / 2.8, "EI": EI, "mass_per_length": MASS}
    structure = {"type": "planar_beam", "length": LENGTH, "section": section | {"rotary_inertia": MASS * squared}}
    tables: dict[str, Any] = {
        "structure": structure,
        "motion": {"type": "constant", "speed": 0.0},
        "mesh": {"elements": 6, "degree": 3},
        "initial": {"tip_displacement": displacement * LENGTH},
        "time": {"end": 1.0, "step": 0.02},
    }
    return Scene.from_dict(tables).replace(changes)


@pytest.mark.parametrize(("deflection", "elastica"), [(0.5, (0.16540984, 0.79339193)), (0.8, (0.53368073, 1.40752105))])
def test_static_shape_is_the_elastica(deflection: float, elastica: tuple[float, float]) -> None:
    """Shortening and angle of the tip (quadrature) to the stretch that is left, r²/L², and 6 cubic elements' error."""
    problem = Problem.of(beam(1e5, deflection))
    q = static_tip_shape(problem, deflection * LENGTH, Newton())
    u1, u2, alpha = compile_system(problem).structure.tip_values(q)
    assert u2 == pytest.approx(deflection * LENGTH, rel=1e-9)
    assert (-u1 / LENGTH, alpha) == pytest.approx(elastica, rel=6e-5)


def test_a_shape_that_is_not_found_says_how_far_the_tip_came() -> None:
    """One iteration is never enough: it leaves nothing to judge the increment by."""
    with pytest.raises(
        ComputationError, match=r"no static shape with a tip displacement of 5 m: the tip was led to 0 m"
    ):
        static_tip_shape(Problem.of(beam(1e3, 0.5)), 5.0, Newton(max_iterations=1))


@pytest.mark.parametrize(("theory", "displacement"), [("reissner", 0.3), ("second_order", 0.05), ("von_karman", 0.05)])
def test_slenderness_is_no_matter(theory: str, displacement: float) -> None:
    """Releases in whole steps at any slenderness; the tip follows the same path once the axis cannot stretch.

    A release excites modes that steps of 0.02 s do not resolve; what they do depends on the iteration's last digits, so
    paths agree to the part they have in the motion, a few per mille, and more where it is large.
    """
    paths = []
    for slenderness in (1e3, 1e4, 1e5):
        result = run(beam(slenderness, displacement, **{"model.theory": theory}))
        assert result.summary["newton_iterations"] < 12 * 50
        energy = result.history["jacobi"]
        assert -0.01 < energy[-1] / energy[0] - 1 < 0.0  # what the scheme damps
        paths.append(result.history["tip_u2"] / (displacement * LENGTH))
    apart = [float(np.max(np.abs(path - paths[-1]))) for path in paths[:-1]]
    assert max(apart) < (0.01 if displacement < 0.1 else 0.06)


def test_iterations_do_not_grow_with_slenderness() -> None:
    """With the stress of the state in the tangent they do: 4.5, 11 and more than 40 a step on these beams."""
    counts = [run(beam(s, 0.1)).summary["newton_iterations"] / 50 for s in (1e2, 1e3, 1e4, 1e5)]
    assert max(counts) < 8


@pytest.mark.parametrize("viscosity", [1e-2, 1.0])
def test_iterations_do_not_grow_with_viscosity(viscosity: float) -> None:
    """Viscous stresses are those of the last correction too: with those of the state they were 27 and 36 a step."""
    damped = {"structure.damping.kelvin_voigt": viscosity, "time.end": 0.6}
    assert run(beam(1e4, 0.3, **damped)).summary["newton_iterations"] / 30 < 18


def test_small_release_finds_no_other_root() -> None:
    """A prediction 3 rad off led to a state of 10⁴ times the energy, by increments that shrank all the way."""
    soft = {"structure.section.EI": 2.8e5, "structure.section.EA": 2.8e7, "structure.section.GA": 1e7}
    result = run(beam(1e2, 0.01, **soft, **{"model.theory": "von_karman"}))
    assert np.max(np.abs(result.history["tip_u2"])) < 0.011 * LENGTH
    assert -0.02 < result.history["jacobi"][-1] / result.history["jacobi"][0] - 1 < 0.0


@pytest.mark.parametrize("displacement", [0.05, 0.3])
def test_creep_of_a_beam_that_is_all_viscosity(displacement: float) -> None:
    """With η = 10 s q + η q̇ = 0 but for the inertia, 1/(η ω)² < 1e-3, and the first steps: u₂ ~ e^(−t/η)."""
    result = run(beam(450.0, displacement, **{"structure.damping.kelvin_voigt": 10.0}))
    path = result.history["tip_u2"] / (displacement * LENGTH)
    assert path == pytest.approx(np.exp(-result.history["t"] / 10.0), abs=4e-3 if displacement < 0.1 else 8e-3)
