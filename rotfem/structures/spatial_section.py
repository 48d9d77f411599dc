"""Stiffness and mass of a spatial beam's section as constants or fields of the forms.

Where stiffnesses are given with centres, axial strain and bending are those of the tension centre, shear those of
the shear centre, and rotary inertia that of the mass centre: there both matrices are diagonal. Full 6×6 matrices are
brought as near to that as they allow.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl

from rotfem.errors import InputError
from rotfem.mechanics.bodies import Strain
from rotfem.structures.beam import Beam
from rotfem.structures.structure import Array

#: Strains in the order of the section matrices, and the stiffness of each.
STRAINS = {
    "axial": "EA",
    "shear_2": "GA2",
    "shear_3": "GA3",
    "torsion": "GJ",
    "bending_2": "EI2",
    "bending_3": "EI3",
}

#: Part of the largest entry below which an entry of a mass matrix or an inertia tensor counts as zero.
NEGLIGIBLE = 1e-12


def euler_tensor(inertia: npt.ArrayLike) -> list[tuple[float, Array]]:
    """Return pairs (moment, unit axis (3,)) of ∫ x xᵀ dm = ½ tr(J) 1 − J for an inertia tensor J (3, 3).

    A rigid body has the rotary inertia of directors along these axes with these moments; zero ones are left out.
    """
    J = np.asarray(inertia, dtype=float)
    E = 0.5 * np.trace(J) * np.eye(3) - J
    size = np.max(np.abs(J))
    if np.all(np.abs(E - np.diag(np.diag(E))) <= NEGLIGIBLE * size):
        moments, axes = np.diag(E), np.eye(3)
    else:
        moments, axes = np.linalg.eigh(E)
    return [(float(m), a) for m, a in zip(moments, axes.T, strict=True) if abs(m) > NEGLIGIBLE * size]


class SectionForms:
    """Section properties in the forms of a beam, by name in `beam.section` and `beam.scalars`.

    Args:
        beam: the beam; receives the constants.
        section: its section; `central(x)` or full matrices `stiffness` and `mass` (see `rotfem.scene`).

    Attributes:
        mass: mass per length (kg/m).
        mass_center: its components along t_i⁰ (m), numbers 0 where it lies on the axis.
        directors: (components along t_i⁰, second moment of mass in kg·m) of each director.

    Raises:
        InputError: a mass matrix that no section has.
    """

    def __init__(self, beam: Beam, section: Any):
        self._beam, self._data = beam, section
        matrix = section.stiffness is not None
        self._read_full() if matrix else self._read_central()

    def _read_central(self) -> None:
        beam, data = self._beam, self._data
        for name in data.central(np.zeros(1)):
            beam.section[name] = beam.profile(name, partial(self._central, name))
        self.mass = beam.section["mass_per_length"]
        self.mass_center = self._point("mass_center", (0.0, *(data.mass_center or (0.0, 0.0))))
        self.directors = [
            ((0, 1, 0), beam.section["rotary_inertia3"]),
            ((0, 0, 1), beam.section["rotary_inertia2"]),
        ]

    def _central(self, name: str, x: Array) -> Array:
        central: dict[str, Array] = self._data.central(x)
        return central[name]

    def _read_full(self) -> None:
        beam, data = self._beam, self._data
        for i, j in zip(*np.triu_indices(6), strict=True):
            if (value := np.array(data.stiffness)[i, j]) != 0.0:
                beam.section[f"stiffness_{i + 1}{j + 1}"] = beam.constant(value)
        M = np.array(data.mass)
        m, coupling = M[0, 0], M[:3, 3:]
        rigid = np.allclose(M[:3, :3], m * np.eye(3), rtol=0, atol=NEGLIGIBLE * m)
        if m <= 0.0 or not rigid or not np.allclose(coupling, -coupling.T, rtol=0, atol=1e-9 * np.max(np.abs(M))):
            reason = "must be that of rigid mass: m 1 with m > 0 for velocities, m times a skew matrix beside it"
            raise InputError("structure.section.mass", [list(row) for row in M], reason)
        y, z = coupling[2, 0] / m, coupling[0, 1] / m
        c = np.array([coupling[1, 2] / m, y, z])
        self.mass = beam.section["mass_per_length"] = beam.constant(m)
        self.mass_center = self._point("mass_center", tuple(c))
        central = M[3:, 3:] - m * (c @ c * np.eye(3) - np.outer(c, c))
        self.directors = []
        for n, (moment, axis) in enumerate(euler_tensor(central), start=1):
            density = beam.section[f"director_inertia_{n}"] = beam.constant(moment)
            self.directors.append((tuple(axis), density))

    def _point(self, name: str, components: tuple[float, ...]) -> tuple[Any, ...]:
        """Return named constants for the components of a point along t_i⁰, the number 0 for those that vanish."""
        pairs = enumerate(components, start=1)
        return tuple(self._beam.scalar(f"{name}_{i}", c) if c != 0.0 else 0 for i, c in pairs)

    def strains(self, Gamma: Any, K: Any, measure: Any) -> list[Strain]:
        """Return the strains that make the stored energy ½ ε·C ε of ε = (Γ, K)."""
        epsilon = [*(Gamma[i] for i in range(3)), *(K[i] for i in range(3))]
        if self._data.stiffness is not None:
            return self._full_strains(epsilon, measure)
        data = self._data
        _, y, z = self._point("tension_center", (0.0, *(data.tension_center or (0.0, 0.0))))
        epsilon[0] += z * epsilon[4] - y * epsilon[5]
        _, y, z = self._point("shear_center", (0.0, *(data.shear_center or (0.0, 0.0))))
        epsilon[1] -= z * epsilon[3]
        epsilon[2] += y * epsilon[3]
        stiffness = (self._beam.section[name] for name in STRAINS.values())
        return [Strain(n, e, c, measure) for n, e, c in zip(STRAINS, epsilon, stiffness, strict=True)]

    def _full_strains(self, epsilon: list[Any], measure: Any) -> list[Strain]:
        """Return ½ ε·C ε = ½ C_11 (ε_1 + Σ_j C_1j ε_j / C_11)² + ½ Σ_ij (C_ij − C_1i C_1j / C_11) ε_i ε_j, i, j > 1.

        The first strain is the axial one of the section's own tension centre: the axial force is C_11 times it.
        """
        C = [[self._beam.section.get(f"stiffness_{min(i, j)}{max(i, j)}", 0) for j in range(1, 7)] for i in range(1, 7)]
        shares = [c / C[0][0] if c != 0 else 0 for c in C[0]]
        axial = epsilon[0] + sum(shares[j] * epsilon[j] for j in range(1, 6))
        rest = [[C[i][j] - C[0][i] * shares[j] for j in range(1, 6)] for i in range(1, 6)]
        return [
            Strain("axial", axial, C[0][0], measure),
            Strain("section", ufl.as_vector(epsilon[1:]), ufl.as_matrix(rest), measure),
        ]
