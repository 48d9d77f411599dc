"""Cross-sections of beams, given in exactly one of several ways: stiffnesses, matrices, or a material with geometry.

Every property may be a number or a taper. Dimensions are interpolated first and properties computed from them, so a
wedge has the cubic EI of a wedge.

Axes of a section: 1 along the beam, 2 and 3 across it. Strains are ordered (Γ₁, Γ₂, Γ₃, K₁, K₂, K₃), conjugate to the
axial force, the shear forces V₂, V₃, the torque and the moments M₂, M₃. A point (y, z) of the section has the
axial strain Γ₁ + z K₂ − y K₃; bending about axis 2 is therefore flap in direction 3.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar

import numpy as np
import numpy.typing as npt
from pydantic import AfterValidator, BeforeValidator, ConfigDict, Discriminator, Field, Tag, ValidationInfo

from rotfem import registry
from rotfem.scene.files import FROM_FILE, existing_file, read_table
from rotfem.scene.section_shapes import MATERIAL_AND_SHAPE, Geometry, Shape
from rotfem.scene.table import (
    SceneModel,
    Way,
    along,
    as_name,
    choose_way,
    problem,
    problems_at,
    unit,
)
from rotfem.scene.values import (
    ROUND_OFF,
    UPPER,
    Array,
    NonNegative,
    Number,
    Positive,
    Profile,
    Rows,
    ShearCorrection,
    T,
    check_span,
    check_start,
    evaluate,
    is_table,
    symmetric,
    symmetric_matrices,
)

PoissonProfile = Profile[Annotated[float, Field(strict=True, gt=-1, le=0.5)]]

# --- points and matrices over the span --------------------------------------------------------------------------------

#: Keys of a section that hold matrices, and points.
MATRICES, POINTS = ("stiffness", "mass"), ("mass_center", "shear_center", "tension_center")

Point = tuple[Number, Number]
#: A point (y, z) or a matrix for the whole span, or rows (x, point or matrix).
OverSpan = Annotated[
    Annotated[T, Tag("<one>")] | Annotated[tuple[tuple[Number, T], ...], Tag("<rows>")],
    Discriminator(lambda value: "<rows>" if is_table(value) else "<one>"),
    AfterValidator(lambda value: check_start(check_span(value)) if is_table(value) else value),
]


def _nested(value: Any) -> Any:
    """Return rows of x and the entries of a point, or of a matrix (36, or 21 of its upper triangle), as [x, it]."""
    if not isinstance(value, list | tuple):
        return value
    return [_row(row) if isinstance(row, list | tuple) and len(row) in (3, 22, 37) else row for row in value]


def _row(row: Sequence[Any]) -> list[Any]:
    x, *entries = row
    if len(entries) == 2:
        return [x, entries]
    at = np.arange(36).reshape(6, 6) if len(entries) == 36 else symmetric_matrices(np.arange(21)).astype(int)
    return [x, [[entries[i] for i in places] for places in at]]


Center = Annotated[OverSpan[Point], unit("m"), BeforeValidator(_nested), FROM_FILE]
Matrices = Annotated[OverSpan[Rows], BeforeValidator(_nested), FROM_FILE]


# --- what planar and spatial beams share ------------------------------------------------------------------------------


class Section(SceneModel):
    """What planar and spatial beam sections share: material, shape, tapers. Dimensions of the shape are keys as well.

    Attributes:
        E: Young's modulus (Pa).
        nu: Poisson's ratio.
        rho: density (kg/m³).
        area: cross-section area (m²).
        shape: name of a registered shape.
        shear_correction: shear correction factor; Cowper's for a shape, else 5/6.
    """

    WAYS: ClassVar[tuple[Way, ...]] = ()
    WITH_SHAPE: ClassVar[tuple[str, ...]] = ()

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Annotated[Profile[NonNegative], along("m")] | None]

    E: Annotated[Profile[Positive], along("Pa")] | None = None
    nu: PoissonProfile | None = None
    rho: Annotated[Profile[NonNegative], along("kg/m**3")] | None = None
    area: Annotated[Profile[Positive], along("m**2")] | None = None
    shape: str | None = None
    shear_correction: Profile[ShearCorrection] | None = None

    @classmethod
    def keys(cls) -> list[str]:
        """Return the keys of the table and the dimensions of all shapes."""
        dimensions = (key for shape in registry.shapes for keys in shape.choices for key in keys)
        return list(dict.fromkeys([*super().keys(), *dimensions]))

    @property
    def given(self) -> dict[str, object]:
        """The keys that are set, with their values."""
        names = (*type(self).model_fields, *self.__pydantic_extra__)
        return {name: value for name in names if (value := getattr(self, name)) is not None}

    @property
    def way(self) -> Way:
        """The set of keys by which the section is given: one of its own, or a material and a registered shape."""
        shapes = (
            Way("shape", (*MATERIAL_AND_SHAPE, *dimensions), self.WITH_SHAPE, shape.name)
            for shape in registry.shapes
            for dimensions in shape.choices
        )
        return choose_way(self.given, (*self.WAYS, *shapes))

    @property
    def uniform(self) -> bool:
        """Whether all properties are the same along the beam."""
        return all(len({value for _, value in taper}) == 1 for taper in self.tapers.values())

    @property
    def tapers(self) -> dict[str, Any]:
        """The properties given as tables over the span, by name: rows (x, value), values may be points or matrices."""
        return {name: value for name, value in self.given.items() if is_table(value)}

    @property
    def knots(self) -> list[float]:
        """Places of all rows of tapers (m), and the root."""
        return sorted({0.0, *(x for taper in self.tapers.values() for x, _ in taper)})

    @property
    def steps(self) -> list[float]:
        """Places (m) at which a table has two rows of one x."""
        tables = ([x for x, _ in taper] for taper in self.tapers.values())
        return sorted({x for places in tables for x in places if places.count(x) > 1})

    def profile(self, name: str, x: npt.ArrayLike) -> Array:
        """Return the profile of a key at places x (m) along the beam, zeros where it is not given."""
        return evaluate(getattr(self, name) or 0.0, x)

    def _dimensions(self, x: Array) -> dict[str, Array]:
        """Return the dimensions of the shape at x; the caller knows from `way` that there is one."""
        return {name: self.profile(name, x) for name in self.way.required if name not in MATERIAL_AND_SHAPE}

    def _geometry(self, x: Array) -> Geometry:
        """Return the geometry of the shape, or as it is given with a material."""
        if self.shape is not None:
            shape: Shape = registry.shapes[self.shape]
            return shape.geometry(self.profile("nu", x), **self._dimensions(x))
        names = ["second_moment2", "second_moment3", "torsion_constant"]
        if "second_moment" in type(self).model_fields:
            names = ["second_moment"] * 3
        I2, I3, J = (self.profile(name, x) for name in names)
        return Geometry(self.profile("area", x), I2, I3, J, np.full(x.shape, 5.0 / 6.0))

    def _of_material(self, x: Array) -> tuple[Array, ...]:
        """Return EA, kGA (N), GJ, EI₂, EI₃ (N·m²), ρA (kg/m), ρI₂ and ρI₃ (kg·m) of a material with a geometry."""
        g, E, rho = self._geometry(x), self.profile("E", x), self.profile("rho", x)
        k = g.shear_correction if self.shear_correction is None else self.profile("shear_correction", x)
        G = E / (2.0 * (1.0 + self.profile("nu", x)))
        I2, I3 = g.second_moment2, g.second_moment3
        return E * g.area, k * G * g.area, G * g.torsion_constant, E * I2, E * I3, rho * g.area, rho * I2, rho * I3

    @classmethod
    def _read(cls, data: Mapping[str, Any], info: ValidationInfo) -> Mapping[str, Any]:
        """Read a file, and check the name of the shape before the keys, as it says which there are."""
        if data.get("shape") is not None:
            as_name(data["shape"], registry.shapes, "shape")
        return with_columns(data, info, "")

    def _check(self) -> None:
        if self.way.name == "shape":
            # All dimensions are linear between knots, so it is enough to look at the knots.
            dimensions = self._dimensions(np.array(self.knots))
            for key in dimensions.keys() - {*registry.shapes[str(self.shape)].may_vanish}:
                if np.min(dimensions[key]) <= 0.0 or any(row[1] <= 0.0 for row in self.tapers.get(key, ())):
                    raise problem(key, self.given[key], "must be greater than 0")
            for key, allowed in registry.shapes[str(self.shape)].check(**dimensions).items():
                raise problem(key, self.given[key], allowed)


def file_columns(value: Any, info: ValidationInfo) -> dict[str, Any]:
    """Return the properties of a section from a file whose header names its columns."""
    path = existing_file(value, info)
    names, rows = read_table(path)
    if not names or names[0] != "x":
        first = f' "{names[0]}"' if names else ""
        raise problem("", str(path), f"its first row must name the columns, x first, not{first or ' numbers'}")
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise problem("", str(path), f'column "{twice}" stands twice')
    column = dict(zip(names, np.array(rows).T.tolist(), strict=True))
    x = column.pop("x")
    out: dict[str, Any] = {}
    entries = {key: [f"{key}_{place}" for place in UPPER] for key in MATRICES}
    entries |= {key: [f"{key}_y", f"{key}_z"] for key in POINTS}
    for key, parts in entries.items():
        given = {name: column.pop(name) for name in parts if name in column}
        if given:
            out[key] = list(zip(x, *(given.get(name, [0.0] * len(x)) for name in parts), strict=True))
    return out | {name: list(zip(x, values, strict=True)) for name, values in column.items()}


def with_columns(section: Mapping[str, Any], info: ValidationInfo, path: str) -> dict[str, Any]:
    """Return the table of a section with the columns of its file in the place of that; `path` is before its keys."""
    given = {key: value for key, value in section.items() if key != "file"}
    if "file" not in section:
        return given
    with problems_at(f"{path}file", section["file"]):
        columns = file_columns(section["file"], info)
    for key in columns:
        if key in given:
            raise problem(f"{path}{key}", None, "given twice; section.file has a column of it too")
    return columns | given


class PlanarSection(Section):
    """Cross-section of a planar beam.

    Attributes:
        EA: axial stiffness (N).
        GA: effective shear stiffness GA_s, shear correction included (N).
        EI: bending stiffness (N·m²).
        mass_per_length: A_ρ (kg/m).
        rotary_inertia: I_ρ (kg·m).
        second_moment: second moment of area for bending in the plane (m⁴).
    """

    WAYS: ClassVar[tuple[Way, ...]] = (
        Way("stiffness", ("EA", "GA", "EI", "mass_per_length"), ("rotary_inertia",)),
        Way("material", ("E", "nu", "rho", "area", "second_moment"), ("shear_correction",)),
    )
    WITH_SHAPE: ClassVar[tuple[str, ...]] = ("shear_correction",)

    EA: Annotated[Profile[Positive], along("N")] | None = None
    GA: Annotated[Profile[Positive], along("N")] | None = None
    EI: Annotated[Profile[Positive], along("N*m**2")] | None = None
    mass_per_length: Annotated[Profile[NonNegative], along("kg/m")] | None = None
    rotary_inertia: Annotated[Profile[NonNegative], along("kg*m")] | None = None
    second_moment: Annotated[Profile[Positive], along("m**4")] | None = None

    def _check(self) -> None:
        super()._check()
        g = self._geometry(np.array(self.knots)) if self.way.name == "shape" else None
        if g is not None and g.centroid is not None and np.any(np.abs(g.centroid[1]) > ROUND_OFF * np.sqrt(g.area)):
            why = "has its centroid off the axis, in the plane: a planar_beam has no centres, a spatial_beam has"
            raise problem("shape", self.shape, why)

    @property
    def has_rotary_inertia(self) -> bool:
        """Whether the rotary inertia is positive anywhere."""
        return bool(np.any(self.at(self.knots)["rotary_inertia"] > 0.0))

    def at(self, x: npt.ArrayLike) -> dict[str, Array]:
        """Return EA, GA (N), EI (N·m²), mass_per_length (kg/m), rotary_inertia (kg·m) at x (m), each of its shape."""
        x = np.asarray(x, dtype=np.float64)
        names = ("EA", "GA", "EI", "mass_per_length", "rotary_inertia")
        if self.way.name == "stiffness":
            return {name: self.profile(name, x) for name in names}
        EA, GA, _, EI, _, mass, rotary_inertia, _ = self._of_material(x)
        return dict(zip(names, (EA, GA, EI, mass, rotary_inertia), strict=True))


# --- spatial beams ----------------------------------------------------------------------------------------------------


def _check_mass(value: Any) -> Any:
    """Return a mass matrix or a table of them; refuse any that no rigid mass has."""
    for x, M in value if is_table(value) else [(None, value)]:
        rows = np.array(M)
        m, coupling, size = rows[0, 0], rows[:3, 3:], ROUND_OFF * np.max(np.abs(rows))
        rigid = np.allclose(rows[:3, :3], m * np.eye(3), rtol=0, atol=ROUND_OFF * abs(m))
        if m < 0.0 or not rigid or not np.allclose(coupling, -coupling.T, rtol=0, atol=size):
            where = "" if x is None else f"at x = {x:g} it "
            rigid_mass = "m 1 with m ≥ 0 for velocities, m times a skew matrix off the diagonal"
            raise problem("", rows.tolist(), f"{where}must be that of rigid mass: {rigid_mass}")
    return value


#: What says where in a section its properties belong to, and the radius of its fibers.
_PLACES = ("mass_center", "shear_center", "tension_center", "principal_angle", "polar_radius")
_STIFFNESSES = ("EA", "GA2", "GA3", "GJ", "EI2", "EI3")
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
        mass_center, shear_center, tension_center: position (y, z) in the section (m), or a table of them.
        polar_radius: radius of gyration of the axial stiffness about the shear center, (∫Er² dA/∫E dA)^½ (m); if not
            given, from EA, EI2, EI3 and the centers. It is for the effect `trapeze`.
        principal_angle: angle (rad) about axis 1 from the section axes to those that GA2, GA3, EI2, EI3 and the rotary
            inertias belong to; the centers do not turn with it.
        stiffness: full 6×6 stiffness matrix, or a table of them.
        mass: full 6×6 mass matrix of (velocity, angular velocity) in section axes, or a table of them.
    """

    WAYS: ClassVar[tuple[Way, ...]] = (
        Way("stiffness", (*_STIFFNESSES, "mass_per_length"), (*_INERTIAS[1:], *_PLACES)),
        Way("matrix", ("stiffness", "mass"), ("polar_radius",)),
        Way(
            "material",
            ("E", "nu", "rho", "area", "second_moment2", "second_moment3", "torsion_constant"),
            ("shear_correction", *_PLACES),
        ),
    )
    WITH_SHAPE: ClassVar[tuple[str, ...]] = ("shear_correction", *_PLACES)

    EA: Annotated[Profile[Positive], along("N")] | None = None
    GA2: Annotated[Profile[Positive], along("N")] | None = None
    GA3: Annotated[Profile[Positive], along("N")] | None = None
    GJ: Annotated[Profile[Positive], along("N*m**2")] | None = None
    EI2: Annotated[Profile[Positive], along("N*m**2")] | None = None
    EI3: Annotated[Profile[Positive], along("N*m**2")] | None = None
    mass_per_length: Annotated[Profile[NonNegative], along("kg/m")] | None = None
    rotary_inertia2: Annotated[Profile[NonNegative], along("kg*m")] | None = None
    rotary_inertia3: Annotated[Profile[NonNegative], along("kg*m")] | None = None
    second_moment2: Annotated[Profile[Positive], along("m**4")] | None = None
    second_moment3: Annotated[Profile[Positive], along("m**4")] | None = None
    torsion_constant: Annotated[Profile[Positive], along("m**4")] | None = None
    mass_center: Center | None = None
    shear_center: Center | None = None
    tension_center: Center | None = None
    polar_radius: Annotated[Profile[NonNegative], along("m")] | None = None
    principal_angle: Annotated[Profile[Number], along("rad")] | None = None
    stiffness: Annotated[Matrices, symmetric(6, definite=True)] | None = None
    mass: Annotated[Matrices, symmetric(6, definite=False), AfterValidator(_check_mass)] | None = None

    @property
    def has_rotary_inertia(self) -> bool:
        """Whether the mass matrix has any rotary part."""
        return bool(np.any(self.at(self.knots)["mass"][..., 3:, 3:] != 0.0))

    def at(self, x: npt.ArrayLike) -> dict[str, Array]:
        """Return `stiffness` and `mass`, (…, 6, 6) in section axes and SI units, at positions x (m), (…)."""
        x = np.asarray(x, dtype=np.float64)
        if self.stiffness is not None and self.mass is not None:
            return {"stiffness": evaluate(self.stiffness, x), "mass": evaluate(self.mass, x)}
        central = self.central(x)
        stiffnesses = np.stack([central[key] for key in _STIFFNESSES], axis=-1)[..., None] * np.eye(6)
        m, J2, J3 = (central[key] for key in _INERTIAS)
        angle, mass_center = self.profile("principal_angle", x), self.center("mass_center", x)
        tension_center, shear_center = self.center("tension_center", x), self.center("shear_center", x)
        return {
            "stiffness": about_reference(stiffnesses, tension_center, shear_center, angle),
            "mass": mass_matrices(m, J2, J3, mass_center, angle),
        }

    def central(self, x: npt.ArrayLike) -> dict[str, Array]:
        """Return the section properties about their own centers at positions x (m), each of the shape of x.

        Both matrices are diagonal there: EA, GA2, GA3 (N), GJ, EI2, EI3 (N·m²), mass_per_length (kg/m),
        rotary_inertia2 and rotary_inertia3 (kg·m). Not for a section of full matrices.
        """
        x, names = np.asarray(x, dtype=np.float64), (*_STIFFNESSES, *_INERTIAS)
        if self.way.name == "stiffness":
            return {name: self.profile(name, x) for name in names}
        EA, GA, *rest = self._of_material(x)
        return dict(zip(names, (EA, GA, GA, *rest), strict=True))

    def center(self, name: str, x: npt.ArrayLike) -> Array:
        """Return a centre, `mass_center`, `shear_center` or `tension_center`, at positions x (m): (…, 2) in m."""
        of_shape = self._of_shape(name, np.asarray(x, dtype=np.float64))
        return evaluate(getattr(self, name) or (0.0, 0.0), x) if of_shape is None else of_shape

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


def about_axis(angle: npt.ArrayLike) -> Array:
    """Return R (…, 6, 6): components along the section axes from those along axes turned by an angle (rad) about 1."""
    c, s = np.cos(angle), np.sin(angle)
    R = np.broadcast_to(np.eye(6), (*np.shape(angle), 6, 6)).copy()
    for i in (1, 4):
        R[..., i, i], R[..., i, i + 1], R[..., i + 1, i], R[..., i + 1, i + 1] = c, -s, s, c
    return R


def mass_matrices(m: Array, J2: Array, J3: Array, center: npt.ArrayLike, angle: npt.ArrayLike) -> Array:
    """Return mass matrices (…, 6, 6) about the reference axis, of masses and rotary inertias about their centres."""
    central = np.stack([m, m, m, J2 + J3, J2, J3], axis=-1)[..., None] * np.eye(6)
    return about_reference(central, center, center, angle)


def about_reference(matrix: Array, axial: npt.ArrayLike, transverse: npt.ArrayLike, angle: npt.ArrayLike) -> Array:
    """Return Bᵀ M B (…, 6, 6) along section axes about the reference axis, of M along turned axes and about centres."""
    B = np.swapaxes(about_axis(angle), -1, -2) @ shifted(axial, transverse)
    return np.asarray(np.swapaxes(B, -1, -2) @ matrix @ B)


def shifted(axial: npt.ArrayLike, transverse: npt.ArrayLike) -> Array:
    """Return B (…, 6, 6): strains on the reference axis ↦ axial strain at one centre, shear strains at another.

    With (y, z), (…, 2) in m, of each centre these are Γ₁ + z K₂ − y K₃, Γ₂ − z K₁, Γ₃ + y K₁, and the curvatures
    themselves; motions have the same map, (v, ω) for (Γ, K).
    """
    axial, transverse = np.asarray(axial), np.asarray(transverse)
    B = np.broadcast_to(np.eye(6), (*axial.shape[:-1], 6, 6)).copy()
    B[..., 0, 4], B[..., 0, 5] = axial[..., 1], -axial[..., 0]
    B[..., 1, 3], B[..., 2, 3] = -transverse[..., 1], transverse[..., 0]
    return B
