"""The [structure] table of a plate."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

import numpy.typing as npt
from pydantic import BeforeValidator, Discriminator, Field, Tag

from rotfem.scene.files import existing_file
from rotfem.scene.structure import DampingTable, StructureTable, check_one_hub
from rotfem.scene.table import Way, along, choose_way, empty, problem, problems_at, unit
from rotfem.scene.values import (
    Array,
    NonNegative,
    Number,
    PoissonRatio,
    Positive,
    ShearCorrection,
    Tapered,
    Vector,
    check_on_span,
    check_profile_length,
    check_start,
    evaluate,
)

#: A number, a taper (of a mesh from anywhere), or region ↦ number.
Thickness = Annotated[
    Annotated[Tapered[Positive], Tag("<profile>")] | Annotated[dict[str, Positive], Tag("<table>")],
    Discriminator(lambda value: "<table>" if isinstance(value, dict) else "<profile>"),
]


Modulus = Annotated[Positive, unit("Pa")]


class PlateStructure(StructureTable):
    """A plate in the plane (1, 2) of the rotating frame: a rectangle clamped at x = 0, or a mesh file.

    Attributes:
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
    length: Annotated[Positive, unit("m")] | None = None
    width: Annotated[Positive, unit("m")] | None = None
    mesh: Annotated[str, BeforeValidator(lambda value, info: str(existing_file(value, info)))] | None = None
    thickness: Annotated[Thickness, along("m")]
    E: Modulus | None = None
    nu: PoissonRatio | None = None
    E1: Modulus | None = None
    E2: Modulus | None = None
    nu12: Number | None = None
    G12: Modulus | None = None
    G13: Modulus | None = None
    G23: Modulus | None = None
    rho: Annotated[NonNegative, unit("kg/m**3")]
    shear_correction: ShearCorrection = 5.0 / 6.0
    hub_radius: Annotated[NonNegative, unit("m")] = 0.0
    hub_offset: Annotated[Vector, unit("m")] | None = None
    point_masses: Annotated[tuple[tuple[Number, Number, Positive], ...], unit("m", "m", "kg")] = ()
    line_masses: dict[str, Annotated[Positive, unit("kg/m")]] = Field(default_factory=dict)
    damping: DampingTable = empty()

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
        if isinstance(self.thickness, dict) and (geometry.name != "mesh" or not self.thickness):
            raise problem("thickness", self.thickness, "thickness by region needs a mesh, and one for every region")
        if isinstance(self.thickness, tuple) and self.length is not None:
            with problems_at("thickness", self.thickness):
                check_start(self.thickness)
            check_profile_length("thickness", self.thickness, self.length)
        for i, (x, _, _) in enumerate(self.point_masses):
            check_on_span(f"point_masses.{i}.0", x, self.length)
        if material.name == "orthotropic" and self.E1 is not None and self.E2 is not None and self.nu12 is not None:
            limit = math.sqrt(self.E1 / self.E2)
            if abs(self.nu12) >= limit:
                raise problem("nu12", self.nu12, f"must be less than √(E1/E2) = {limit:g} in size, else not stable")

    def _way(self, ways: tuple[Way, ...]) -> Way:
        names = dict.fromkeys(key for way in ways for key in (*way.required, *way.optional))
        return choose_way({name: value for name in names if (value := getattr(self, name)) is not None}, ways)
