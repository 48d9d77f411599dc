"""The [structure] table of a plate."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag

from rotfem.scene.files import FROM_FILE, existing_file
from rotfem.scene.structure import DampingTable, StructureTable, check_one_hub
from rotfem.scene.table import SceneModel, Way, along, choose_way, empty, problem, problems_at, unit
from rotfem.scene.values import (
    ROUND_OFF,
    Array,
    NonNegative,
    Number,
    PoissonRatio,
    Positive,
    ShearCorrection,
    T,
    Tapered,
    Vector,
    check_on_span,
    check_profile_length,
    check_span,
    check_start,
    evaluate,
)


class Over(SceneModel):
    """A table over the place.

    Attributes:
        over: "x", or "r", the distance from the origin of the plate.
        table: rows (m, value), increasing; two rows of one place are a step.
    """

    over: Literal["x", "r"]
    table: Annotated[tuple[tuple[Number, Positive], ...], FROM_FILE, AfterValidator(check_span)]


def _shape(value: Any) -> str:
    if isinstance(value, Mapping):
        return "<over>" if "over" in value or "table" in value else "<table>"
    if isinstance(value, Over):
        return "<over>"
    return "<function>" if callable(value) else "<profile>"


#: A number, of a rectangle a taper along it, a table over the place, region ↦ number, or a function of (x, y).
OverPlace = Annotated[
    Annotated[Tapered[T], Tag("<profile>")]
    | Annotated[dict[str, T], Tag("<table>")]
    | Annotated[Over, Tag("<over>")]
    | Annotated[Callable[[float, float], Any], Tag("<function>")],
    Discriminator(_shape),
]
Modulus = Annotated[OverPlace[Positive], along("Pa")]
MATERIAL = ("E", "nu", "E1", "E2", "nu12", "G12", "G13", "G23", "rho")


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
        thickness: of the plate (m): a number, or, as those of the material may, it varies over the place: a taper
            ((x, value), …) of a rectangle, a table over "r" or "x", region → value of a mesh, in Python a function of
            (x, y).
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
    thickness: Annotated[OverPlace[Positive], along("m")]
    E: Modulus | None = None
    nu: OverPlace[PoissonRatio] | None = None
    E1: Modulus | None = None
    E2: Modulus | None = None
    nu12: Number | None = None
    G12: Modulus | None = None
    G13: Modulus | None = None
    G23: Modulus | None = None
    rho: Annotated[OverPlace[NonNegative], along("kg/m**3")]
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

    @property
    def varying(self) -> dict[str, Any]:
        """Thickness and constants of the material that vary over the place, by name."""
        given = {name: getattr(self, name) for name in ("thickness", *MATERIAL)}
        return {name: value for name, value in given.items() if value is not None and not isinstance(value, float)}

    def at(self, name: str, places: Array, near: Array) -> Array:
        """Return a property that is a table, at places along x, or distances from the origin (m), of their shape.

        At a step it is that on the side of `near`.
        """
        value = getattr(self, name)
        table = value.table if isinstance(value, Over) else value
        steps = len({row[0] for row in table}) < len(table)
        return evaluate(table, places + ROUND_OFF * steps * (near - places))

    @property
    def regions(self) -> tuple[str, ...]:
        """Names of the regions of the mesh that a value is given for; none of a plate of one region."""
        return next((tuple(value) for value in self.varying.values() if isinstance(value, dict)), ())

    @property
    def knots(self) -> tuple[float, ...]:
        """Places x (m) of the rows of tables over x, increasing."""
        tables = [v.table if isinstance(v, Over) and v.over == "x" else v for v in self.varying.values()]
        return tuple(sorted({row[0] for table in tables if isinstance(table, tuple) for row in table}))

    def _check(self) -> None:
        geometry = self._way(self.WAYS)
        self._way(self.MATERIALS)
        check_one_hub(self.hub_radius, self.hub_offset)
        for name, value in self.varying.items():
            if isinstance(value, dict) and (geometry.name != "mesh" or set(value) != set(self.regions) or not value):
                raise problem(name, value, "by region it needs a mesh, and a value for every one")
            if not isinstance(value, tuple):
                continue
            if self.length is None:
                raise problem(name, value, 'say what the table of a mesh is over: { over = "r", table = … }, or "x"')
            with problems_at(name, value):
                check_start(value)
            check_profile_length(name, value, self.length)
        for key in ("point_masses", "point_supports"):
            for i, (x, _, _) in enumerate(getattr(self, key)):
                check_on_span(f"{key}.{i}.0", x, self.length)
        E1, E2, nu12 = self.E1, self.E2, self.nu12
        if isinstance(E1, float) and isinstance(E2, float) and isinstance(nu12, float):
            limit = math.sqrt(E1 / E2)
            if abs(nu12) >= limit:
                raise problem("nu12", self.nu12, f"must be less than √(E1/E2) = {limit:g} in size, else not stable")

    def _way(self, ways: tuple[Way, ...]) -> Way:
        names = dict.fromkeys(key for way in ways for key in (*way.required, *way.optional))
        return choose_way({name: value for name in names if (value := getattr(self, name)) is not None}, ways)
