"""Cross-section of a spatial beam: full 6×6 stiffness and mass matrices along the axis.

Section axes: 1 along the beam, 2 and 3 across it. Strains are ordered (Γ₁, Γ₂, Γ₃, K₁, K₂, K₃), conjugate to the
axial force, the shear forces V₂, V₃, the torque and the moments M₂, M₃. A point (y, z) of the section has the
axial strain Γ₁ + z K₂ − y K₃; bending about axis 2 is therefore flap in direction 3.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, TypeAlias

import numpy as np
import numpy.typing as npt
from pydantic import PlainValidator

from rotfem.scene.alternatives import Way
from rotfem.scene.section import DEFAULT_SHEAR_CORRECTION, Section
from rotfem.scene.span_tables import (
    MatrixTable,
    Point,
    PointTable,
    as_matrix_or_table,
    as_point_or_table,
    evaluate_table,
    is_table,
)
from rotfem.scene.values import AnyProfile, Array, Matrix, NonNegativeProfile, PositiveProfile, problem

#: Part of the largest entry of a mass matrix by which it may differ from one that rigid mass has.
MASS_SLACK = 1e-9


def _as_stiffness(value: Any) -> Matrix | MatrixTable:
    return as_matrix_or_table(value, definite=True)


def _as_mass(value: Any) -> Matrix | MatrixTable:
    """Return a mass matrix or a table of them; raise on any that no rigid mass has."""
    read = as_matrix_or_table(value, definite=False)
    for x, M in [(row[0], row[1]) for row in read] if is_table(read) else [(None, read)]:
        rows = np.array(M)
        m, coupling, size = rows[0, 0], rows[:3, 3:], MASS_SLACK * np.max(np.abs(rows))
        rigid = np.allclose(rows[:3, :3], m * np.eye(3), rtol=0, atol=MASS_SLACK * abs(m))
        if m <= 0.0 or not rigid or not np.allclose(coupling, -coupling.T, rtol=0, atol=size):
            where = "" if x is None else f"at x = {x:g} it "
            reason = (
                f"{where}must be that of rigid mass: m 1 with m > 0 for velocities, m times a skew matrix beside it"
            )
            raise problem("", rows.tolist(), reason)
    return read


Center: TypeAlias = Annotated[Point | PointTable, PlainValidator(as_point_or_table)]

#: What says where in a section its properties belong to.
_CENTERS = ("mass_center", "shear_center", "tension_center", "principal_angle")
_STIFFNESSES = ("EA", "GA2", "GA3", "GJ", "EI2", "EI3")
_FIBERS = ("polar_radius",)
_INERTIAS = ("mass_per_length", "rotary_inertia2", "rotary_inertia3")


class SpatialSection(Section):
    """Cross-section of a spatial beam.

    For a rectangle the width is along axis 2 and the height along axis 3.

    Attributes:
        EA: axial stiffness (N).
        GA2: effective shear stiffness in direction 2 (N).
        GA3: effective shear stiffness in direction 3 (N).
        GJ: torsional stiffness (N·m²), about the shear center.
        EI2: bending stiffness about axis 2 through the tension center (N·m²).
        EI3: bending stiffness about axis 3 through the tension center (N·m²).
        mass_per_length: mass per length (kg/m).
        rotary_inertia2: ∫ρz² dA about axis 2 through the mass center (kg·m).
        rotary_inertia3: ∫ρy² dA about axis 3 through the mass center (kg·m). The polar one is the sum.
        second_moment2: ∫z² dA (m⁴).
        second_moment3: ∫y² dA (m⁴).
        torsion_constant: Saint-Venant's J (m⁴).
        mass_center: position (y, z) in the section (m), or a table of them.
        shear_center: position (y, z) in the section (m), or a table of them.
        tension_center: position (y, z) in the section (m), or a table of them.
        polar_radius: radius of gyration of the axial stiffness about the shear center, (∫Er² dA/∫E dA)^½ (m); if not
            given, that of EA, EI2, EI3 and the centers. Only the effect `trapeze` has to do with it.
        principal_angle: angle (rad) about axis 1 from the section axes to those that GA2, GA3, EI2, EI3 and the rotary
            inertias belong to; the centers do not turn with it.
        stiffness: full 6×6 stiffness matrix, or a table of them.
        mass: full 6×6 mass matrix of (velocity, angular velocity) in section axes, or a table of them.
    """

    WAYS: ClassVar[tuple[Way, ...]] = (
        Way("stiffness", (*_STIFFNESSES, "mass_per_length"), (*_INERTIAS[1:], *_CENTERS, *_FIBERS)),
        Way("matrix", ("stiffness", "mass"), _FIBERS),
        Way(
            "material",
            ("E", "nu", "rho", "area", "second_moment2", "second_moment3", "torsion_constant"),
            ("shear_correction", *_CENTERS, *_FIBERS),
        ),
    )
    WITH_SHAPE: ClassVar[tuple[str, ...]] = ("shear_correction", *_CENTERS, *_FIBERS)

    EA: PositiveProfile | None = None
    GA2: PositiveProfile | None = None
    GA3: PositiveProfile | None = None
    GJ: PositiveProfile | None = None
    EI2: PositiveProfile | None = None
    EI3: PositiveProfile | None = None
    mass_per_length: PositiveProfile | None = None
    rotary_inertia2: NonNegativeProfile | None = None
    rotary_inertia3: NonNegativeProfile | None = None
    second_moment2: PositiveProfile | None = None
    second_moment3: PositiveProfile | None = None
    torsion_constant: PositiveProfile | None = None
    mass_center: Center | None = None
    shear_center: Center | None = None
    tension_center: Center | None = None
    polar_radius: NonNegativeProfile | None = None
    principal_angle: AnyProfile | None = None
    stiffness: Annotated[Matrix | MatrixTable, PlainValidator(_as_stiffness)] | None = None
    mass: Annotated[Matrix | MatrixTable, PlainValidator(_as_mass)] | None = None

    @property
    def has_rotary_inertia(self) -> bool:
        """Whether the mass matrix has any rotary part."""
        knots = [0.0] + [x for taper in self.tapers.values() for x, _ in taper]
        return bool(np.any(self.at(knots)["mass"][..., 3:, 3:] != 0.0))

    def at(self, x: npt.ArrayLike) -> dict[str, Array]:
        """Return the section matrices `stiffness` and `mass` at positions along the beam, each of shape (…, 6, 6).

        They are in SI units and section axes.

        Args:
            x: positions from the clamp (m), any shape (…).
        """
        x = np.asarray(x, dtype=np.float64)
        if self.stiffness is not None and self.mass is not None:
            return {"stiffness": evaluate_table(self.stiffness, x), "mass": evaluate_table(self.mass, x)}
        central = self.central(x)
        stiffnesses = np.stack([central[key] for key in _STIFFNESSES], axis=-1)
        m, J2, J3 = (central[key] for key in _INERTIAS)
        mass_center = self.center("mass_center", x)
        turned = np.swapaxes(_turn(self.angle_at(x)), -1, -2)
        B = turned @ _offset(axial=self.center("tension_center", x), transverse=self.center("shear_center", x))
        B_mass = turned @ _offset(axial=mass_center, transverse=mass_center)
        masses = np.stack([m, m, m, J2 + J3, J2, J3], axis=-1)
        return {
            "stiffness": np.swapaxes(B, -1, -2) @ (stiffnesses[..., None] * B),
            "mass": np.swapaxes(B_mass, -1, -2) @ (masses[..., None] * B_mass),
        }

    def center(self, name: str, x: npt.ArrayLike) -> Array:
        """Return a centre, `mass_center`, `shear_center` or `tension_center`, at positions x (m): (…, 2) in m."""
        of_shape = self._of_shape(name, np.asarray(x, dtype=np.float64))
        return evaluate_table(getattr(self, name) or (0.0, 0.0), x) if of_shape is None else of_shape

    def varies(self, name: str) -> bool:
        """Return whether a centre changes along the beam: it is a table, or that of a shape that tapers."""
        return name in self.tapers or (not self.uniform and self._of_shape(name, np.zeros(1)) is not None)

    def _of_shape(self, name: str, x: Array) -> Array | None:
        """Return the centre (…, 2) that the shape has; None where the section has another, or the shape has none."""
        if getattr(self, name) is not None or self.shape is None:
            return None
        geometry = self._geometry(x)
        found = geometry.shear_center if name == "shear_center" else geometry.centroid
        return None if found is None else np.stack([np.broadcast_to(c, x.shape) for c in found], axis=-1)

    def angle_at(self, x: npt.ArrayLike) -> Array:
        """Return the principal angle (rad) at positions along the beam (m)."""
        places = np.asarray(x, dtype=np.float64)
        return np.zeros(places.shape) if self.principal_angle is None else self._at("principal_angle", places)

    def central(self, x: npt.ArrayLike) -> dict[str, Array]:
        """Return the section properties about their own centers, each of the shape of x; not for full matrices.

        Both matrices are diagonal there: EA, GA2, GA3 (N), GJ, EI2, EI3 (N·m²), mass_per_length (kg/m),
        rotary_inertia2 and rotary_inertia3 (kg·m).

        Args:
            x: positions from the clamp (m), any shape.
        """
        x = np.asarray(x, dtype=np.float64)
        return dict(zip((*_STIFFNESSES, *_INERTIAS), self._stiffnesses_and_inertias(x), strict=True))

    def polar_radius_at(self, x: npt.ArrayLike) -> Array:
        """Return the polar radius (m) at positions along the beam (m); only where it is given."""
        return self._at("polar_radius", np.asarray(x, dtype=np.float64))

    @property
    def has_material(self) -> bool:
        """Whether it is given by a material, of which E/G is known."""
        return "nu" in self.given

    def modular_ratio(self, x: npt.ArrayLike) -> Array:
        """Return E/G of the material at positions along the beam (m); only where it is given."""
        return 2.0 * (1.0 + self._at("nu", np.asarray(x, dtype=np.float64)))

    def _stiffnesses_and_inertias(self, x: Array) -> tuple[Array, ...]:
        if self.way.name == "stiffness":
            zero = np.zeros(x.shape)
            J2 = zero if self.rotary_inertia2 is None else self._at("rotary_inertia2", x)
            J3 = zero if self.rotary_inertia3 is None else self._at("rotary_inertia3", x)
            return *(self._at(key, x) for key in _STIFFNESSES), self._at("mass_per_length", x), J2, J3
        if self.way.name == "shape":
            geometry = self._geometry(x)
            area, k = geometry.area, geometry.shear_correction
            I2, I3, J = geometry.second_moment2, geometry.second_moment3, geometry.torsion_constant
        else:
            area, k = self._at("area", x), np.full(x.shape, DEFAULT_SHEAR_CORRECTION)
            I2, I3, J = (self._at(key, x) for key in ("second_moment2", "second_moment3", "torsion_constant"))
        if self.shear_correction is not None:
            k = self._at("shear_correction", x)
        E, rho = self._at("E", x), self._at("rho", x)
        G = E / (2.0 * (1.0 + self._at("nu", x)))
        return E * area, k * G * area, k * G * area, G * J, E * I2, E * I3, rho * area, rho * I2, rho * I3


def _turn(angle: Array) -> Array:
    """Return R (…, 6, 6): components along the section axes from those along axes turned by an angle (rad) about 1."""
    c, s = np.cos(angle), np.sin(angle)
    R = np.broadcast_to(np.eye(6), (*angle.shape, 6, 6)).copy()
    for i in (1, 4):
        R[..., i, i], R[..., i, i + 1], R[..., i + 1, i], R[..., i + 1, i + 1] = c, -s, s, c
    return R


def _offset(axial: Array, transverse: Array) -> Array:
    """Return B (…, 6, 6): motion (v, ω) of the reference axis ↦ axial motion at one centre, transverse at another.

    It is v + ω×(0, y, z) row by row; the same map holds for strains, with (Γ, K) for (v, ω).

    Args:
        axial: (y, z) of the one, (…, 2) in m.
        transverse: (y, z) of the other.
    """
    B = np.broadcast_to(np.eye(6), (*axial.shape[:-1], 6, 6)).copy()
    B[..., 0, 4], B[..., 0, 5] = axial[..., 1], -axial[..., 0]
    B[..., 1, 3], B[..., 2, 3] = -transverse[..., 1], transverse[..., 0]
    return B
