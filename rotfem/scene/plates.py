"""The [structure] table of a plate."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal

import numpy.typing as npt
from pydantic import BeforeValidator, Discriminator, Field, Tag

from rotfem.scene.files import existing_file
from rotfem.scene.structure import DampingTable, StructureTable, check_one_hub
from rotfem.scene.table import SceneModel, Way, along, choose_way, empty, problem, problems_at, unit
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


def _as_edge(value: Any) -> Any:
    return {"kind": value} if isinstance(value, str) else value


class EdgeTable(SceneModel):
    """How an edge of a plate is held; in a scene a kind alone may stand for it.

    Attributes:
        kind: "clamped"; "simply_supported", whose directors do not tilt along the edge either; "simply_supported_soft",
            whose do; "symmetric", the middle of a plate that moves alike on both sides; "elastic", on springs; "free".
        in_plane: whether displacements in the plane are zero: "held" by default where the deflection is zero.
        stiffness: of a spring against the deflection (N/m per length, N/m²).
        rotation: of a spring against turns about the edge (N·m/rad per length, N/rad).
    """

    kind: Literal["clamped", "simply_supported", "simply_supported_soft", "symmetric", "elastic", "free"]
    in_plane: Literal["held", "free"] | None = None
    stiffness: Annotated[NonNegative, unit("N/m**2")] = 0.0
    rotation: Annotated[NonNegative, unit("N/rad")] = 0.0

    @property
    def held_in_plane(self) -> bool:
        """Whether displacements in the plane are zero."""
        return self.in_plane == "held" or (self.in_plane is None and self.kind not in ("symmetric", "elastic", "free"))

    def _check(self) -> None:
        for key in ("stiffness", "rotation"):
            if getattr(self, key) > 0.0 and self.kind != "elastic":
                raise problem(key, getattr(self, key), 'has a meaning with kind = "elastic" only')
        if self.kind == "elastic" and not (self.stiffness or self.rotation):
            raise problem("stiffness", None, 'missing; kind = "elastic" needs it, or rotation')
        if self.kind in ("symmetric", "free") and self.in_plane is not None:
            raise problem("in_plane", self.in_plane, f'has no meaning with kind = "{self.kind}"')


class PlateStructure(StructureTable):
    """A plate in the plane (1, 2) of the rotating frame: a rectangle 0 ≤ x ≤ length, |y| ≤ width/2, or a mesh file.

    Attributes:
        length: side along x (m); None with a mesh.
        width: side along y (m); None with a mesh.
        mesh: path of a gmsh file with the physical surface "plate" and physical curves, or None.
        edges: named edge → how it is held. A rectangle has clamped, tip, lower and upper, a mesh its physical curves;
            one that is called "clamped" is clamped unless it is said otherwise, the others are free.
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
        point_supports: rows (x, y, stiffness) in m, m, N/m, of springs against the deflection.
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
    edges: dict[str, Annotated[EdgeTable, BeforeValidator(_as_edge)]] = Field(default_factory=dict)
    point_masses: Annotated[tuple[tuple[Number, Number, Positive], ...], unit("m", "m", "kg")] = ()
    point_supports: Annotated[tuple[tuple[Number, Number, Positive], ...], unit("m", "m", "N/m")] = ()
    line_masses: dict[str, Annotated[Positive, unit("kg/m")]] = Field(default_factory=dict)
    damping: DampingTable = empty()

    @property
    def mesh_file(self) -> str | None:
        """Absolute path of the file that its mesh is in, None of a rectangle."""
        return self.mesh

    @property
    def holds(self) -> dict[str, EdgeTable]:
        """Named edge ↦ how it is held, of all that are not free; "clamped" too, which a mesh need not have."""
        edges = {"clamped": EdgeTable(kind="clamped"), **self.edges}
        return {name: edge for name, edge in edges.items() if edge.kind != "free"}

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
        for key in ("point_masses", "point_supports"):
            for i, (x, _, _) in enumerate(getattr(self, key)):
                check_on_span(f"{key}.{i}.0", x, self.length)
        if material.name == "orthotropic" and self.E1 is not None and self.E2 is not None and self.nu12 is not None:
            limit = math.sqrt(self.E1 / self.E2)
            if abs(self.nu12) >= limit:
                raise problem("nu12", self.nu12, f"must be less than √(E1/E2) = {limit:g} in size, else not stable")

    def _way(self, ways: tuple[Way, ...]) -> Way:
        names = dict.fromkeys(key for way in ways for key in (*way.required, *way.optional))
        return choose_way({name: value for name in names if (value := getattr(self, name)) is not None}, ways)
