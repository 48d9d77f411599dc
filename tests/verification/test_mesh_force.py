"""What the mesh leaves out of the forces on shapes (`rotfem.analysis.mesh_force`)."""

from __future__ import annotations

import numpy as np
import pytest

import rotfem
from rotfem.analysis.mesh_force import MeshForce
from rotfem.analysis.reduced_tangents import Tangents
from rotfem.analysis.refined_mesh import RefinedMesh
from rotfem.analysis.schemes import State
from rotfem.analysis.shape_error import LIKELY, ShapeError

SECTION = {"EA": 2.8e7, "GA": 1.0e7, "EI": 1.4e4, "mass_per_length": 1.2, "rotary_inertia": 6.0e-4}


def beam(elements: int) -> rotfem.Problem:
    """Return a beam at rest on elements of degree 2."""
    return rotfem.Problem(
        structure=rotfem.PlanarBeam(length=10.0, section=SECTION),
        motion=rotfem.Motion.constant_speed(0.0),
        mesh=rotfem.BeamMesh(elements=elements, degree=2),
    )


@pytest.mark.parametrize("elements", [3, 6])
def test_vibration_lacks_twice_the_error_of_its_frequency(elements: int) -> None:
    """Of a shape of amplitude c the force on itself is 2 ε ω² c, ε as told by the shape and by a finer mesh.

    To round-off and the energy of shear (2 %) the one, within a factor of three, as such estimates are, the other.
    """
    system = beam(elements).system()
    shapes = Tangents(system, State.at_rest(system, system.zeros())).shapes()
    shape, c = ShapeError(system), 0.1
    force = np.diag(MeshForce(system, shape)(c * shapes.V.T, shapes))[:2]
    told = force / (2 * c * shapes.squares[:2])
    np.testing.assert_allclose(told, shape.of_modes(shapes)[:2] / LIKELY, rtol=0.02)
    finer = RefinedMesh(system).of_frequencies(shapes)
    assert finer is not None
    assert np.all((told < 3 * finer[:2]) & (told > finer[:2] / 6))


def test_stiffness_of_every_cell_is_that_of_the_section() -> None:
    """A moment at the tip bends each cell by 1/EI, to round-off; within a taper by its mean (2 %)."""
    taper = {**SECTION, "EI": [[0.0, 3.0e4], [10.0, 1.0e4]]}
    for section in (SECTION, taper):
        problem = rotfem.Problem(
            structure=rotfem.PlanarBeam(length=10.0, section=section),
            motion=rotfem.Motion.constant_speed(0.0),
            mesh=rotfem.BeamMesh(elements=4, degree=2),
        )
        system = problem.system()
        middles = 10.0 * (np.arange(4) + 0.5) / 4
        expected = np.interp(middles, [0.0, 10.0], [3.0e4, 1.0e4]) if section is taper else np.full(4, 1.4e4)
        told = MeshForce(system, ShapeError(system)).stiffness[:, 0]
        np.testing.assert_allclose(told, expected, rtol=0.02 if section is taper else 1e-6)
