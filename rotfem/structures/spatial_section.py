"""Stiffness and mass of a spatial beam's section as constants or fields of the forms.

Where stiffnesses are given with centres, axial strain and bending are those of the tension centre, shear those of
the shear centre, and rotary inertia that of the mass centre: there both matrices are diagonal. Full 6×6 matrices are
brought as near to that as they allow.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl

from rotfem.mechanics.bodies import Gain, Strain
from rotfem.structures.beam import Beam
from rotfem.structures.section_fields import positive_matrices
from rotfem.structures.structure import Array


def stretch_by_twist(radius_squared: Any, twist: Any, pretwist: Any, warping: Any = 0) -> Gain:
    """Return what twist adds to the mean axial strain of a section (1): the trapeze effect.

    A fiber at (y, z) from the axis of twist becomes a helix under a rate of twist K₁, longer by ½ K₁² (y² + z²) (Wagner
    1929; Biot 1939). Its mean over the section, weighed by E, adds

        ½ r² K₁² + k⁰ (r² − J/A) K₁,        r² = ∫E (y² + z²) dA / ∫E dA,

    to the axial strain, so that an axial force N makes the torsional stiffness GJ + N r². The second part is that of a
    beam with the pretwist k⁰ = dφ/dX, whose fibers are helices at rest, ½ r² [(k⁰ + K₁)² − k⁰²], less what the warping
    of the section takes of them (Krenk, Int. J. Solids Struct. 19 (1983) 67): nothing is left of it in a circle, all of
    it in a thin strip. The axis of twist is that of the shear centers. What twist makes of the strains over the section
    other than their mean, a stiffness of fourth order in the width, is left out.
    """
    first = 0 if isinstance(pretwist, int) else pretwist * (radius_squared - warping) * twist
    return Gain(first, radius_squared * twist**2 / 2)


def radius_of(C: Any) -> Any:
    """Return r² (m²) of a section stiffness (6, 6) about its shear center."""
    EA = C[0][0]
    shares = [0 if isinstance(c, int) else c / EA for c in C[0]]
    bending = C[4][4] / EA - shares[4] ** 2 + C[5][5] / EA - shares[5] ** 2
    y, z = -shares[5], shares[4]
    if not (isinstance(C[1][3], int) and isinstance(C[2][3], int)):  # the shear strains of a twist without shear force
        shear = C[1][1] * C[2][2] - C[1][2] ** 2
        z = z + (C[1][3] * C[2][2] - C[2][3] * C[1][2]) / shear
        y = y - (C[2][3] * C[1][1] - C[1][3] * C[1][2]) / shear
    return bending + y**2 + z**2


#: Strains in the order of the section matrices, and the stiffness of each.
STIFFNESS_OF = {
    "axial": "EA",
    "shear_2": "GA2",
    "shear_3": "GA3",
    "torsion": "GJ",
    "bending_2": "EI2",
    "bending_3": "EI3",
}

#: Part of the largest entry below which an entry of a mass matrix or an inertia tensor counts as zero.
NEGLIGIBLE = 1e-12


def moving_moments(masses: Array) -> tuple[list[tuple[int, int]], bool]:
    """Return (pairs (i, j) of entries of ∫ x xᵀ dm about the mass centre, whether this lies off the section).

    An entry is left out where it vanishes in all mass matrices (n, 6, 6). Those on the diagonal come first.
    """
    m = masses[:, 0, 0]
    c = np.stack([masses[:, 1, 5], masses[:, 2, 3], masses[:, 0, 4]], axis=-1) / np.where(m > 0.0, m, 1.0)[:, None]
    J = masses[:, 3:, 3:] - m[:, None, None] * (
        np.einsum("nk,nk->n", c, c)[:, None, None] * np.eye(3) - np.einsum("ni,nj->nij", c, c)
    )
    E = 0.5 * np.trace(J, axis1=1, axis2=2)[:, None, None] * np.eye(3) - J
    size = np.max(np.abs(masses[:, 3:, 3:]))
    off = [(i, j) for i, j in ((0, 1), (0, 2), (1, 2)) if np.any(np.abs(E[:, i, j]) > NEGLIGIBLE * size)]
    touched = {i for pair in off for i in pair}
    diagonal = [(i, i) for i in range(3) if i in touched or np.any(np.abs(E[:, i, i]) > NEGLIGIBLE * size)]
    return diagonal + off, bool(np.any(np.abs(c[:, 0]) > NEGLIGIBLE * np.max(np.abs(c), initial=0.0)))


def euler_tensor(inertia: npt.ArrayLike) -> list[tuple[float, Array]]:
    """Return pairs (moment, unit axis (3,)) of ∫ x xᵀ dm = ½ tr(J) 1 − J of an inertia tensor J; no zero ones."""
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

    What is a table over the span is a field, one for each table, so that beams whose tables differ share their forms.

    Args:
        beam: the beam; receives the constants.
        section: its section; `central(x)` and `center(name, x)`, or full matrices `at(x)` (see `rotfem.scene`).

    Attributes:
        mass: mass per length (kg/m).
        mass_center: its components along t_i⁰ (m), numbers 0 where it lies on the axis.
        directors: (components along t_i⁰, second moment of mass in kg·m) of each director.
    """

    def __init__(self, beam: Beam, section: Any):
        self._beam, self._data = beam, section
        if section.polar_radius is not None:
            beam.section["polar_radius"] = beam.profile("polar_radius", partial(section.profile, "polar_radius"))
        if section.stiffness is None:
            self._read_central()
            return
        self._stiffness = self._matrix("stiffness")
        self._read_mass()

    def _read_central(self) -> None:
        beam, data = self._beam, self._data
        beam.read_section(data.central)
        self.mass = beam.section["mass_per_length"]
        self.mass_center = (0, *self._center("mass_center"))
        self._turned = None
        if data.principal_angle is not None:
            angle = beam.section["principal_angle"] = beam.profile(
                "principal_angle", partial(data.profile, "principal_angle"), None
            )
            self._turned = ufl.cos(angle), ufl.sin(angle)
        self.directors = [
            ((0, *self._principal(1, 0)), beam.section["rotary_inertia3"]),
            ((0, *self._principal(0, 1)), beam.section["rotary_inertia2"]),
        ]

    def _principal(self, y: Any, z: Any) -> tuple[Any, Any]:
        """Return the components along section axes 2 and 3 of what has these along the principal axes."""
        if self._turned is None:
            return y, z
        c, s = self._turned
        return c * y - s * z, s * y + c * z

    def _center(self, name: str) -> tuple[Any, Any]:
        """Return the components (y, z) of a centre: fields of a table, else constants, or 0 where they vanish."""
        if not self._data.varies(name):
            y, z = self._data.center(name, 0.0)
            return self._point(name, (0.0, float(y), float(z)))[1:]
        if name not in self._beam.section:
            self._beam.section[name] = self._beam.linear_field(name, partial(self._data.center, name), 2)
        f = self._beam.section[name]
        return f[0], f[1]

    def _matrix(self, name: str) -> list[list[Any]]:
        """Return the entries (6, 6) of a matrix: components of one field of a table, else constants and zeros."""
        beam, upper = self._beam, list(zip(*np.triu_indices(6), strict=True))
        entries: dict[tuple[int, int], Any] = {}
        if name in self._data.tapers:
            rows, columns = np.triu_indices(6)
            valid = positive_matrices(definite=name == "stiffness")
            f = beam.linear_field(name, lambda x: self._data.at(x)[name][:, rows, columns], len(upper), valid)
            beam.section[name] = f
            there = self._data.at(self._data.knots)[name]  # where there is no mass, its centre is 0, not 0/0
            kept = [ij for ij in upper if name != "mass" or ij == (0, 0) or np.any(there[:, *ij])]
            entries = {ij: f[upper.index(ij)] for ij in kept}
        else:
            for (i, j), value in zip(upper, np.array(getattr(self._data, name))[np.triu_indices(6)], strict=True):
                if value != 0.0:
                    entries[i, j] = beam.section[f"{name}_{i + 1}{j + 1}"] = beam.constant(value)
        return [[entries.get((min(i, j), max(i, j)), 0) for j in range(6)] for i in range(6)]

    def _read_mass(self) -> None:
        """Take mass matrices, the entries of a table linear between its rows; centres and moments are not.

        ∫ x xᵀ dm = E has the directors t_i with E_ii − Σ_j E_ij and (t_i + t_j)/√2 with 2 E_ij: they do not turn along
        the beam as principal axes do. Those of sections without any thickness along the axis have none in direction 1.
        """
        M = self._matrix("mass")
        self.mass = M[0][0]
        c: list[Any] = [entry if isinstance(entry, int) else entry / self.mass for entry in (M[1][5], M[2][3], M[0][4])]
        size = ufl.dot(ufl.as_vector(c), ufl.as_vector(c))
        J = [[M[3 + i][3 + j] - self.mass * (size * (i == j) - c[i] * c[j]) for j in range(3)] for i in range(3)]
        half = (J[0][0] + J[1][1] + J[2][2]) / 2
        E = [[half * (i == j) - J[i][j] for j in range(3)] for i in range(3)]
        pairs, along = moving_moments(self._data.at(self._data.knots)["mass"])
        self.mass_center = (c[0] if along else 0, c[1], c[2])
        self.directors = []
        for i, j in pairs:
            axis = np.eye(3)[i] if i == j else (np.eye(3)[i] + np.eye(3)[j]) / np.sqrt(2)
            others = [E[i][k] for k in range(3) if k != i and (min(i, k), max(i, k)) in pairs]
            self.directors.append((tuple(axis), E[i][i] - sum(others) if i == j else 2 * E[i][j]))

    def _point(self, name: str, components: tuple[float, ...]) -> tuple[Any, ...]:
        """Return named constants for the components of a point along t_i⁰, the number 0 for those that vanish."""
        pairs = enumerate(components, start=1)
        return tuple(self._beam.scalar(f"{name}_{i}", c) if c != 0.0 else 0 for i, c in pairs)

    def strains(self, Gamma: Any, K: Any, measure: Any, pretwist: Any = 0) -> list[Strain]:
        """Return the strains that make the stored energy ½ ε·C ε of ε = (Γ, K) along t_i⁰, with a pretwist (1/m)."""
        epsilon = [*(Gamma[i] for i in range(3)), *(K[i] for i in range(3))]
        full = self._data.stiffness is not None
        axial, *others = self._full_strains(epsilon, measure) if full else self._central_strains(epsilon, measure)
        return [replace(axial, gains={"trapeze": self._trapeze(K[0], pretwist)}), *others]

    def _trapeze(self, twist: Any, pretwist: Any) -> Gain:
        """Return the stretch of fibers by twist; a full matrix with an entry (1, 4) has that of first order itself."""
        if self._coupled or isinstance(pretwist, int):
            return stretch_by_twist(self._radius_squared, twist, 0)
        return stretch_by_twist(self._radius_squared, twist, pretwist, self._warping)

    @cached_property
    def _coupled(self) -> bool:
        """Whether a full matrix couples twist with stretch anywhere."""
        return self._data.stiffness is not None and bool(np.any(self._data.at(self._data.knots)["stiffness"][:, 0, 3]))

    @cached_property
    def _warping(self) -> Any:
        """J/A = GJ/EA · E/G (m²); the number 0 where E/G is not known."""
        if self._data.nu is None:
            return 0
        ratio = self._beam.profile("modular_ratio", lambda x: 2.0 * (1.0 + self._data.profile("nu", x)))
        return ratio * self._beam.section["GJ"] / self._beam.section["EA"]

    @cached_property
    def _radius_squared(self) -> Any:
        """r² (m²) about the shear center: as given, or of bending about the tension center."""
        section = self._beam.section
        if self._data.polar_radius is not None:
            return section["polar_radius"] ** 2
        if self._data.stiffness is not None:
            return self._full_radius()
        centers = (self._center("tension_center"), self._center("shear_center"))
        apart = sum((t - s) ** 2 for t, s in zip(*centers, strict=True))
        return (section["EI2"] + section["EI3"]) / section["EA"] + apart

    def _full_radius(self) -> Any:
        """Return r² (m²) of a full matrix; of a table of them as a field."""
        if "stiffness" not in self._data.tapers:
            return radius_of(self._stiffness)

        def squared(x: Array) -> Array:
            return np.asarray(radius_of(np.moveaxis(self._data.at(x)["stiffness"], 0, -1)))

        return self._beam.profile("polar_radius_squared", squared)

    def _central_strains(self, epsilon: list[Any], measure: Any) -> list[Strain]:
        """Return the strains at the centers, which share no energy."""
        y, z = self._center("tension_center")
        epsilon[0] += z * epsilon[4] - y * epsilon[5]
        y, z = self._center("shear_center")
        epsilon[1] -= z * epsilon[3]
        epsilon[2] += y * epsilon[3]
        if self._turned is not None:
            c, s = self._turned
            for i in (1, 4):
                epsilon[i : i + 2] = [c * epsilon[i] + s * epsilon[i + 1], c * epsilon[i + 1] - s * epsilon[i]]
        stiffness = (self._beam.section[name] for name in STIFFNESS_OF.values())
        return [Strain(n, e, c, measure) for n, e, c in zip(STIFFNESS_OF, epsilon, stiffness, strict=True)]

    def _full_strains(self, epsilon: list[Any], measure: Any) -> list[Strain]:
        """Return ½ ε·C ε = ½ C_11 (ε_1 + Σ_j C_1j ε_j / C_11)² + ½ Σ_ij (C_ij − C_1i C_1j / C_11) ε_i ε_j, i, j > 1.

        The first strain is the axial one of the section's own tension centre: the axial force is C_11 times it.
        """
        C = self._stiffness
        shares = [c / C[0][0] if c != 0 else 0 for c in C[0]]
        axial = epsilon[0] + sum(shares[j] * epsilon[j] for j in range(1, 6))
        rest = [[C[i][j] - C[0][i] * shares[j] for j in range(1, 6)] for i in range(1, 6)]
        return [
            Strain("axial", axial, C[0][0], measure),
            Strain("section", ufl.as_vector(epsilon[1:]), ufl.as_matrix(rest), measure),
        ]
