"""Cross-section of a planar beam, and what all beam sections share.

A section is given in exactly one of several ways (stiffnesses, or material with geometry); every property may be a
number or a taper. Dimensions are interpolated first and properties computed from them, so a wedge has the cubic EI
of a wedge.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Self

import numpy as np
import numpy.typing as npt
from pydantic import ConfigDict, PlainValidator, model_validator

from rotfem import registry
from rotfem.scene.alternatives import Way, choose_way, shape_ways
from rotfem.scene.section_shapes import MATERIAL_AND_SHAPE, Geometry, Shape
from rotfem.scene.span_tables import is_table
from rotfem.scene.values import (
    Array,
    Bounds,
    NonNegativeProfile,
    PositiveProfile,
    Profile,
    SceneModel,
    as_name,
    evaluate,
    problem,
)

PoissonProfile = Annotated[Profile, PlainValidator(Bounds(gt=-1.0, le=0.5).profile)]
ShearProfile = Annotated[Profile, PlainValidator(Bounds(gt=0.0, le=1.0).profile)]

DEFAULT_SHEAR_CORRECTION = 5.0 / 6.0


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
    __pydantic_extra__: dict[str, PositiveProfile | None]

    E: PositiveProfile | None = None
    nu: PoissonProfile | None = None
    rho: PositiveProfile | None = None
    area: PositiveProfile | None = None
    shape: str | None = None
    shear_correction: ShearProfile | None = None

    @classmethod
    def keys(cls) -> list[str]:
        """Return the keys of the table and the dimensions of all shapes."""
        dimensions = (key for shape in registry.shapes for keys in shape.choices for key in keys)
        return list(dict.fromkeys([*super().keys(), *dimensions]))

    @classmethod
    def ways(cls) -> tuple[Way, ...]:
        """Return all ways of giving the section."""
        return *cls.WAYS, *shape_ways(cls.WITH_SHAPE)

    @property
    def given(self) -> dict[str, object]:
        """The keys that are set, with their values."""
        names = (*type(self).model_fields, *self.__pydantic_extra__)
        return {name: value for name in names if (value := getattr(self, name)) is not None}

    @property
    def way(self) -> Way:
        """The set of keys by which the section is given."""
        return choose_way(self.given, self.ways())

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """Interior knots of all tapers (m), increasing; a mesh should have a node at each."""
        return tuple(sorted({x for taper in self.tapers.values() for x, _ in taper[1:-1]}))

    @property
    def uniform(self) -> bool:
        """Whether all properties are the same along the beam."""
        return all(len({value for _, value in taper}) == 1 for taper in self.tapers.values())

    @property
    def tapers(self) -> dict[str, tuple[tuple[float, Any], ...]]:
        """The properties given as tables over the span, by name: rows (x, value), values may be points or matrices."""
        return {name: value for name, value in self.given.items() if isinstance(value, tuple) and is_table(value)}

    def _at(self, name: str, x: Array) -> Array:
        """Return the profile of that name at x; the caller knows from `way` that it is set."""
        profile: Profile = getattr(self, name)
        return evaluate(profile, x)

    def _dimensions(self, x: Array) -> dict[str, Array]:
        """Return the dimensions of the shape at x; the caller knows from `way` that there is one."""
        return {name: self._at(name, x) for name in self.way.required if name not in MATERIAL_AND_SHAPE}

    def _geometry(self, x: Array) -> Geometry:
        shape: Shape = registry.shapes[str(self.shape)]
        return shape.geometry(self._at("nu", x), **self._dimensions(x))

    @model_validator(mode="before")
    @classmethod
    def _check_shape(cls, data: Any) -> Any:
        """Check the name of the shape before the keys, as it says which there are."""
        if isinstance(data, Mapping) and data.get("shape") is not None:
            as_name(data["shape"], registry.shapes, "shape")
        return data

    @model_validator(mode="after")
    def _check_way(self) -> Self:
        if self.way.name == "shape":
            # All dimensions are linear between knots, so it is enough to look at the knots.
            knots = np.array(sorted({x for taper in self.tapers.values() for x, _ in taper} | {0.0}))
            for key, allowed in registry.shapes[str(self.shape)].check(**self._dimensions(knots)).items():
                raise problem(key, self.given[key], allowed)
        return self


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

    EA: PositiveProfile | None = None
    GA: PositiveProfile | None = None
    EI: PositiveProfile | None = None
    mass_per_length: PositiveProfile | None = None
    rotary_inertia: NonNegativeProfile | None = None
    second_moment: PositiveProfile | None = None

    @property
    def has_rotary_inertia(self) -> bool:
        """Whether the rotary inertia is positive anywhere."""
        if self.way.name != "stiffness":
            return True
        profile = self.rotary_inertia or 0.0
        return any(value > 0.0 for _, value in profile) if isinstance(profile, tuple) else profile > 0.0

    def at(self, x: npt.ArrayLike) -> dict[str, Array]:
        """Return the section properties at positions along the beam, by name, each of the shape of x.

        They are EA (N), GA (N), EI (N·m²), mass_per_length (kg/m) and rotary_inertia (kg·m).

        Args:
            x: positions from the clamp (m), any shape.
        """
        x = np.asarray(x, dtype=np.float64)
        way = self.way
        if way.name == "stiffness":
            rotary_inertia = np.zeros(x.shape) if self.rotary_inertia is None else self._at("rotary_inertia", x)
            return {key: self._at(key, x) for key in way.required} | {"rotary_inertia": rotary_inertia}
        if way.name == "shape":
            geometry = self._geometry(x)
            area, second_moment, k = geometry.area, geometry.second_moment2, geometry.shear_correction
        else:
            area, second_moment = self._at("area", x), self._at("second_moment", x)
            k = np.full(x.shape, DEFAULT_SHEAR_CORRECTION)
        if self.shear_correction is not None:
            k = self._at("shear_correction", x)
        E, rho = self._at("E", x), self._at("rho", x)
        G = E / (2.0 * (1.0 + self._at("nu", x)))
        return {
            "EA": E * area,
            "GA": k * G * area,
            "EI": E * second_moment,
            "mass_per_length": rho * area,
            "rotary_inertia": rho * second_moment,
        }
