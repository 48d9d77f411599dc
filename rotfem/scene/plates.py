"""The [structure] table of a plate."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, PlainValidator

from rotfem.scene.files import existing_file
from rotfem.scene.structure import Damping, StructureTable, check_one_hub
from rotfem.scene.table import Unit, Way, along, choose_way, problem, problems_at
from rotfem.scene.values import (
    Array,
    Bounds,
    Matrix,
    NonNegative,
    Number,
    PoissonRatio,
    Positive,
    Profile,
    ShearCorrection,
    Taper,
    Vector,
    as_rows,
    check_magnitudes,
    check_profile_length,
    evaluate,
    on_span,
)


def _as_thickness(value: Any) -> Profile | dict[str, float]:
    positive = Bounds(gt=0.0)
    if isinstance(value, dict):
        if not value:
            raise problem("", value, "must give a thickness for every region")
        for region, thickness in value.items():
            with problems_at(str(region), thickness):
                positive.number(thickness)
        return {str(region): float(thickness) for region, thickness in value.items()}
    return positive.profile(value, anywhere=True)  # a mesh may lie anywhere


def _as_point_masses(value: Any) -> Matrix:
    if isinstance(value, list | tuple) and not value:
        return ()
    rows = as_rows(value, (3,), "a list of point masses [[x, y, m], …]")
    for i, (_, _, mass) in enumerate(rows, start=1):
        if mass <= 0.0:
            raise problem("", value, f"the mass of row {i} must be greater than 0")
    return rows


Modulus = Annotated[Positive, Unit("Pa")]


class PlateStructure(StructureTable):
    """A plate in the plane (1, 2) of the rotating frame: a rectangle clamped at x = 0, or a mesh file.

    Attributes:
        type: "plate".
        length: side along x (m); None with a mesh.
        width: side along y (m); None with a mesh.
        mesh: path of a gmsh file with the physical groups "clamped" and "plate", or None.
        thickness: number (m), taper ((x, thickness), …), or with a mesh a dictionary region → thickness.
        E: Young's modulus (Pa), isotropic.
        nu: Poisson's ratio, isotropic.
        E1, E2: Young's moduli in directions 1 and 2 (Pa), orthotropic.
        nu12: Poisson's ratio, orthotropic.
        G12: shear modulus in the plane (Pa), orthotropic.
        G13, G23: transverse shear moduli (Pa), orthotropic; G12 if not given.
        rho: density (kg/m³).
        shear_correction: shear correction factor.
        hub_radius: distance of the clamped edge from the origin of the frame along direction 1 (m).
        hub_offset: position of the plate's origin in the frame (m), instead of the hub radius; None if not given.
        point_masses: rows (x, y, m) in m, m, kg.
        line_masses: named edge → mass per length (kg/m); a rectangle has clamped, tip, lower and upper.
        damping: damping coefficients.
    """

    WAYS: ClassVar[tuple[Way, ...]] = (Way("rectangle", ("length", "width")), Way("mesh", ("mesh",)))
    MATERIALS: ClassVar[tuple[Way, ...]] = (
        Way("isotropic", ("E", "nu")),
        Way("orthotropic", ("E1", "E2", "nu12", "G12"), ("G13", "G23")),
    )

    type: Literal["plate"] = "plate"
    length: Annotated[Positive, Unit("m")] | None = None
    width: Annotated[Positive, Unit("m")] | None = None
    mesh: Annotated[str, PlainValidator(lambda value, info: str(existing_file(value, info)))] | None = None
    thickness: Annotated[float | Taper | dict[str, float], PlainValidator(_as_thickness), along("m")] = Field(
        description="a number greater than 0 (m), a taper [[x, thickness], …], or with a mesh a table of regions"
    )
    E: Modulus | None = None
    nu: PoissonRatio | None = None
    E1: Modulus | None = None
    E2: Modulus | None = None
    nu12: Number | None = None
    G12: Modulus | None = None
    G13: Modulus | None = None
    G23: Modulus | None = None
    rho: Annotated[Positive, Unit("kg/m**3")] = Field(description="a number greater than 0 (kg/m³)")
    shear_correction: ShearCorrection = 5.0 / 6.0
    hub_radius: Annotated[NonNegative, Unit("m")] = 0.0
    hub_offset: Annotated[Vector, Unit("m")] | None = None
    point_masses: Annotated[Matrix, PlainValidator(_as_point_masses), Unit(("m", "m", "kg"))] = ()
    line_masses: dict[str, Annotated[Positive, Unit("kg/m")]] = Field(default_factory=dict)
    damping: Damping = Damping()

    @property
    def mesh_file(self) -> str | None:
        """Absolute path of the file that its mesh is in, None of a rectangle."""
        return self.mesh

    @property
    def is_orthotropic(self) -> bool:
        """Whether the material is given by E1, E2, nu12, G12 rather than E, nu."""
        return self.E1 is not None

    @property
    def root_position(self) -> tuple[float, float, float]:
        """Position of the plate's origin in the frame (m): the hub offset, or (hub radius, 0, 0)."""
        return self.hub_offset if self.hub_offset is not None else (self.hub_radius, 0.0, 0.0)

    @property
    def has_tip_mass(self) -> bool:
        """Whether there are point or line masses."""
        return bool(self.point_masses or self.line_masses)

    @property
    def has_rotary_inertia(self) -> bool:
        """Whether the sections have rotary inertia; a plate of any thickness has."""
        return True

    def thickness_at(self, x: npt.ArrayLike) -> Array:
        """Return the thickness (m), which is not given by region, at coordinates x (m) along the plate, shape of x."""
        return evaluate(self.thickness, x)

    def _check(self) -> None:
        geometry = self._way(self.WAYS)
        material = self._way(self.MATERIALS)
        check_one_hub(self.hub_radius, self.hub_offset)
        if isinstance(self.thickness, dict) and geometry.name != "mesh":
            raise problem("thickness", self.thickness, "thickness by region needs a mesh")
        if isinstance(self.thickness, tuple) and self.length is not None:
            if self.thickness[0][0] != 0.0:
                raise problem("thickness", self.thickness, "the taper must start at x = 0")
            check_profile_length("thickness", self.thickness, self.length)
        for x, _, _ in self.point_masses:
            if not on_span(x, self.length):
                reason = f"x = {x:.10g} is not on the plate, which runs from 0 to {self.length:g}"
                raise problem("point_masses", self.point_masses, reason)
        if material.name == "orthotropic" and self.E1 is not None and self.E2 is not None and self.nu12 is not None:
            limit = math.sqrt(self.E1 / self.E2)
            if abs(self.nu12) >= limit:
                raise problem("nu12", self.nu12, f"must be less than √(E1/E2) = {limit:g} in size, else not stable")
        check_magnitudes(self._stiffnesses, "thickness")

    def _stiffnesses(self) -> dict[str, Array]:
        """Return membrane and bending stiffnesses (N/m, N·m) and the mass per area (kg/m²) at all given thicknesses."""
        given = self.thickness
        rows = given if isinstance(given, dict) else dict(given) if isinstance(given, tuple) else {"": given}
        h = np.array(list(rows.values()))
        moduli = {name: getattr(self, name) for name in ("E", "E1", "E2", "G12", "G13", "G23")}
        stiffnesses = {
            f"{name}{of}": value * h**power
            for name, value in moduli.items()
            if value is not None
            for of, power in ((" h", 1), (" h³", 3))
        }
        return {**stiffnesses, "mass per area": self.rho * h, "rotary inertia": self.rho * h**3}

    def _way(self, ways: tuple[Way, ...]) -> Way:
        names = dict.fromkeys(key for way in ways for key in (*way.required, *way.optional))
        return choose_way({name: value for name in names if (value := getattr(self, name)) is not None}, ways)
