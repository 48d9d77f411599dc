"""The [structure] table of a beam, planar or spatial; that of a plate is in its own module."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import AfterValidator, ConfigDict, Tag, TypeAdapter, ValidationError, ValidationInfo

from rotfem.along import apart
from rotfem.scene.blades.deck import Asked, keys_of
from rotfem.scene.files import FROM_FILE, existing_file
from rotfem.scene.plates import PlateStructure
from rotfem.scene.reference_line import ReferenceLine, SweptLine, as_line, line_through
from rotfem.scene.section import PlanarSection, SpatialSection, with_columns
from rotfem.scene.structure import DampingTable, Hinge, Root, SpatialRoot, StructureTable, check_one_hub
from rotfem.scene.supports import CouplingTable, SupportTable
from rotfem.scene.table import (
    BY_SHAPE,
    SceneModel,
    along,
    empty,
    in_units,
    one_of,
    problem,
    problems_at,
    scene_error,
    unit,
)
from rotfem.scene.values import (
    DIGITS,
    ROUND_OFF,
    Array,
    Matrix,
    NonNegative,
    Number,
    PaddedVector,
    Positive,
    Rows,
    Span,
    Tapered,
    Vector,
    check_on_span,
    check_profile_length,
    check_span,
    check_start,
    symmetric,
)

#: A moment of inertia or a tensor, 3×3.
Inertia = Annotated[
    Annotated[NonNegative, Tag("<one>")] | Annotated[Rows, symmetric(3, definite=False), Tag("<rows>")],
    BY_SHAPE,
    unit("kg*m**2"),
]
Length = Annotated[NonNegative, unit("m")]
Mass = Annotated[NonNegative, unit("kg")]


class DiskTable(SceneModel):
    """A disk on a shaft.

    Attributes:
        outer_diameter: of the disk (m).
        inner_diameter: of its bore (m).
        width: along the shaft (m).
        rho: density (kg/m³).
    """

    outer_diameter: Annotated[Positive, unit("m")]
    inner_diameter: Annotated[NonNegative, unit("m")] = 0.0
    width: Annotated[Positive, unit("m")]
    rho: Annotated[Positive, unit("kg/m**3")]

    def _check(self) -> None:
        if self.inner_diameter >= self.outer_diameter:
            raise problem("inner_diameter", self.inner_diameter, "must be less than outer_diameter")

    @property
    def mass(self) -> float:
        """Mass, kg."""
        return float(self.rho * np.pi / 4 * (self.outer_diameter**2 - self.inner_diameter**2) * self.width)

    @property
    def inertias(self) -> tuple[float, float]:
        """Moments of inertia about its axis, and about a diameter through its centre (kg·m²)."""
        polar = self.mass / 8 * (self.outer_diameter**2 + self.inner_diameter**2)
        return polar, polar / 2 + self.mass * self.width**2 / 12


class PointMass(SceneModel):
    """A rigid body fixed to a section: by mass and inertia, by polar and transverse inertia, or as a disk.

    Attributes:
        x: place along the beam (m).
        mass: of the body (kg).
        offset: position of its center relative to the axis, section axes (m): three numbers for a spatial beam.
        inertia: about its center (kg·m²): of a planar beam about axis 3; of a spatial one a tensor in section axes, or
            a number, isotropic.
        polar_inertia: of a body that is round about the axis (kg·m²), instead of inertia.
        transverse_inertia: of the same about a diameter (kg·m²).
        disk: a disk that has mass and inertia, instead of these.
    """

    x: Annotated[Number, unit("m")]
    mass: Mass = 0.0
    offset: Annotated[PaddedVector, unit("m")] = (0.0, 0.0, 0.0)
    inertia: Inertia = 0.0
    polar_inertia: Annotated[NonNegative, unit("kg*m**2")] | None = None
    transverse_inertia: Annotated[NonNegative, unit("kg*m**2")] | None = None
    disk: DiskTable | None = None

    @property
    def inertia_matrix(self) -> Array:
        """Inertia tensor (kg·m²), shape (3, 3)."""
        return self.inertia * np.eye(3) if isinstance(self.inertia, float) else np.array(self.inertia)

    @classmethod
    def _read(cls, data: Mapping[str, Any], info: ValidationInfo) -> Mapping[str, Any]:
        """Write mass and inertia of a disk, and the inertia of a round body."""
        data = dict(data)
        if data.get("disk") is not None:
            if given := {"mass", "inertia", "polar_inertia", "transverse_inertia"} & data.keys():
                raise problem(sorted(given)[0], None, "cannot be combined with disk, which has it")
            try:
                disk = DiskTable.model_validate(data.pop("disk"), context=info.context)
            except ValidationError as error:
                found = scene_error("", error)
                raise problem(f"disk.{found.key}", found.value, found.allowed) from None
            data |= {
                "mass": disk.mass,
                **dict(zip(("polar_inertia", "transverse_inertia"), disk.inertias, strict=True)),
            }
        round_body = [data.pop(name, None) for name in ("polar_inertia", "transverse_inertia")]
        if round_body != [None, None]:
            if None in round_body or "inertia" in data:
                raise problem("polar_inertia", None, "needs transverse_inertia, and no inertia with them")
            polar, across = round_body
            data["inertia"] = [[polar, 0, 0], [0, across, 0], [0, 0, across]]
        return data


class SpatialPointMass(PointMass):
    """A rigid body fixed to a section of a spatial beam."""

    offset: Annotated[Vector, unit("m")] = (0.0, 0.0, 0.0)


class BeamStructure(StructureTable):
    """What planar and spatial beams share; a planar one is clamped at (hub_radius, 0, 0) of the frame.

    Attributes:
        length: from the clamp to the tip, along the axis (m).
        hub_radius: distance of the clamp from the axis of rotation, or from the origin, along direction 1 (m).
        tip_mass: mass at the free end (kg).
        masses: further masses along the beam.
        damping: damping coefficients.
    """

    type: str
    length: Annotated[Positive, unit("m")]
    hub_radius: Length = 0.0
    tip_mass: Mass = 0.0
    masses: tuple[PointMass, ...] = ()
    damping: DampingTable = empty()

    if TYPE_CHECKING:
        section: PlanarSection | SpatialSection
        root: Root
        tip_inertia: float | Matrix

    @property
    def knots(self) -> tuple[float, ...]:
        """Places (m) of all rows of tables between the ends, and of masses, increasing."""
        return apart({*self.section.knots, *self.nodes}, self.length)

    @property
    def nodes(self) -> tuple[float, ...]:
        """Places (m) of masses, and of steps of the section."""
        return apart([*(body.x for body in self.masses), *self.section.steps], self.length)

    @property
    def hinges(self) -> dict[int, Hinge]:
        """Axis ↦ the hinge about it at the root."""
        return self.root.hinges

    @property
    def pitches(self) -> bool:
        """Whether its pitch changes with time."""
        return isinstance(self.root, SpatialRoot) and self.root.pitch.changes

    @property
    def bodies(self) -> dict[str, PointMass]:
        """Name ↦ rigid body fixed to a section: that at the tip and the masses along the beam."""
        tip: dict[str, Any] = {"x": self.length, "mass": self.tip_mass, "inertia": self.tip_inertia}
        tip["offset"] = getattr(self, "tip_offset", (0.0, 0.0, 0.0))
        return {"tip": PointMass.model_construct(**tip)} | {f"masses_{i}": body for i, body in enumerate(self.masses)}

    @property
    def has_tip_mass(self) -> bool:
        """Whether there is anything at the tip, or at another point, that has inertia."""
        return any(body.mass > 0.0 or bool(np.any(body.inertia_matrix)) for body in self.bodies.values())

    @property
    def has_rotary_inertia(self) -> bool:
        """Whether the sections have rotary inertia."""
        return self.section.has_rotary_inertia

    def _check_tables(self, slack: float = ROUND_OFF) -> None:
        """Refuse tapers of the section that end elsewhere, and masses elsewhere."""
        section = self.section
        for name, taper in section.tapers.items():
            check_profile_length(f"section.{name}", taper, self.length, slack)
        for i, body in enumerate(self.masses):
            key = f"masses.{i}"
            check_on_span(f"{key}.x", body.x, self.length)
            if self.is_planar and body.offset[2] != 0.0:
                raise problem(f"{key}.offset", list(body.offset), "the third component must be 0 for a planar_beam")
            if self.is_planar and not isinstance(body.inertia, float):
                raise problem(f"{key}.inertia", None, "must be a number, about axis 3, for a planar_beam")


class PlanarBeamStructure(BeamStructure):
    """A beam that moves in the plane (1, 2) of the rotating frame, clamped at X = 0.

    Attributes:
        tip_inertia: moment of inertia of the tip mass about axis 3 (kg·m²).
        section: cross-section.
        root: hinge, spring and damper at the clamp.
    """

    is_planar: ClassVar[bool] = True
    type: Literal["planar_beam"] = "planar_beam"
    tip_inertia: Annotated[NonNegative, unit("kg*m**2")] = 0.0
    root: Root = empty()
    section: PlanarSection

    @property
    def root_position(self) -> tuple[float, float, float]:
        """Position of the root in the frame (m)."""
        return self.hub_radius + self.root.hinge_offset, 0.0, 0.0

    def _check(self) -> None:
        self._check_tables()


Line = Annotated[tuple[Vector, ...], AfterValidator(as_line), FROM_FILE, unit("m")]


class SpatialBeamStructure(BeamStructure):
    """A beam in space, its axis along direction 1 of the rotating frame (before precone), clamped at X = 0.

    Attributes:
        hub_offset: position of the clamp in the frame (m), instead of the hub radius; None if not given.
        tip_inertia: its inertia tensor (kg·m²) as 3×3 rows, or a number for an isotropic one.
        tip_offset: position of its center relative to the end of the axis, in section axes (m).
        section: cross-section.
        pretwist: angle of the section axes about the beam axis (rad), a number or a taper. May also stand in the
            section table.
        sweep: angle of the axis in the plane (1, 2), towards direction 2 (rad), over the length of arc: a number, or
            rows (x, angle), which are arcs between, and a kink where one x stands twice.
        line: points (x, y, z) of the axis from the clamp (m), before the precone, instead of sweep: cubic splines, a
            kink where one point stands twice. x of all tables is the arc length along it, and so is the length, which
            need not be given then.
        precone: angle of the beam axis out of the plane (1, 2), towards direction 3 (rad). May also stand in the
            section table.
        root: hinges, springs, dampers and pitch angle at the clamp.
        supports: bearings along a shaft.
        couplings: between parts of it.
    """

    type: Literal["spatial_beam"] = "spatial_beam"
    hub_offset: Annotated[Vector, unit("m")] | None = None
    masses: tuple[SpatialPointMass, ...] = ()
    tip_inertia: Inertia = 0.0
    tip_offset: Annotated[Vector, unit("m")] = (0.0, 0.0, 0.0)
    section: SpatialSection
    pretwist: Annotated[Tapered[Number], AfterValidator(check_start), along("rad")] = 0.0
    sweep: Annotated[Span[Number], AfterValidator(check_span), AfterValidator(check_start), along("rad")] = 0.0
    line: Line | None = None
    precone: Annotated[Number, unit("rad")] = 0.0
    root: SpatialRoot = empty()
    supports: tuple[SupportTable, ...] = ()
    couplings: tuple[CouplingTable, ...] = ()

    @property
    def reference_line(self) -> ReferenceLine | SweptLine | None:
        """The axis before precone, through points or by its angle; None where it is straight, along direction 1."""
        if self.line is not None:
            return line_through(self.line)
        if isinstance(self.sweep, tuple):
            return SweptLine(self.sweep)
        return SweptLine(((0.0, self.sweep), (self.length, self.sweep))) if self.sweep != 0.0 else None

    @property
    def knots(self) -> tuple[float, ...]:
        """Places (m) of all rows of tables over the span, and of masses, increasing."""
        twist = {x for x, _ in self.pretwist[1:-1]} if isinstance(self.pretwist, tuple) else set()
        line = self.reference_line
        return apart(twist | {*super().knots, *(line.knots if line is not None else ())}, self.length)

    @property
    def nodes(self) -> tuple[float, ...]:
        """Places (m) of masses, supports, and couplings, of kinks of the line, and of the ends of arcs."""
        line, joints = self.reference_line, sorted(coupling.x for coupling in self.couplings)
        joints += [(a + b) / 2 for a, b in pairwise(joints)]  # no element is between two of them
        kinks = line.kinks if line is not None else ()
        return apart((*super().nodes, *(support.x for support in self.supports), *joints, *kinks), self.length)

    @property
    def root_position(self) -> tuple[float, float, float]:
        """Position of the root in the frame (m): the hub offset, or (hub radius, 0, 0), and the hinge offset."""
        x, y, z = self.hub_offset if self.hub_offset is not None else (self.hub_radius, 0.0, 0.0)
        return x + self.root.hinge_offset, y, z

    @property
    def root_axis(self) -> tuple[float, float, float]:
        """Unit vector along the blade at its root, before sweep, which it is pitched about."""
        return float(np.cos(self.precone)), 0.0, float(np.sin(self.precone))

    @property
    def is_straight(self) -> bool:
        """Whether its axis is along direction 1, from a root on that axis."""
        return self.precone == 0.0 and self.reference_line is None and not any(self.root_position[1:])

    @property
    def is_round(self) -> bool:
        """Whether it is straight, the same in all directions about its axis but for unbalance, and no support turns."""
        if not self.is_straight or self.hinges or self.pitches or any(s.frame == "rotating" for s in self.supports):
            return False
        return self.has_round_sections and all(same_about_axis(body.inertia_matrix) for body in self.bodies.values())

    @cached_property
    def has_round_sections(self) -> bool:
        """Whether all sections are the same in all directions about the axis."""
        places = np.union1d(self.section.knots, self.length)
        places = np.union1d(places, (places[1:] + places[:-1]) / 2)
        return all(map(same_about_axis, self.section.at(places).values()))

    @property
    def has_tip_mass(self) -> bool:
        """Whether there is anything at the tip, at another point, or under a support, that has inertia."""
        return super().has_tip_mass or any(support.housing for support in self.supports)

    @property
    def has_fibers(self) -> bool:
        """Whether the sections have fibers off the axis they twist about, as all have but where it is denied."""
        return self.section.polar_radius != 0.0

    @classmethod
    def _read(cls, data: Mapping[str, Any], info: ValidationInfo) -> Mapping[str, Any]:
        """Read the blade file of another program, and move pretwist and precone out of a section that holds them."""
        section = data.get("section")
        if isinstance(section, Mapping) and "from" in section:
            with problems_at("section.from", section["from"]):
                path = existing_file(section["from"], info)
            without = {key: value for key, value in data.items() if key != "section"}
            data = keys_of(path, Asked(without, section, (info.context or {}).get("hints", [])))
            section = data["section"]
        data = _with_length(data, info)
        if not isinstance(section, Mapping):
            return data
        section = with_columns(section, info, "section.")
        lifted: dict[str, Any] = {key: section.pop(key) for key in ("pretwist", "precone") if key in section}
        for key in lifted.keys() & data.keys():
            raise problem(f"section.{key}", None, f"given twice; structure.{key} is also set")
        return {**data, **lifted, "section": section}

    def _check(self) -> None:
        slack = ROUND_OFF if self.line is None else DIGITS
        check_profile_length("pretwist", self.pretwist, self.length, slack)
        check_profile_length("sweep", self.sweep, self.length)
        if self.line is not None and self.sweep != 0.0:
            raise problem("sweep", None, "cannot be combined with line, which holds it")
        check_one_hub(self.hub_radius, self.hub_offset)
        self._check_tables(slack)
        self.root.check(self.precone)
        self._check_supports()

    def _check_supports(self) -> None:
        """Refuse supports elsewhere or of a beam that is no straight shaft, and too few for a driven root."""
        for i, support in enumerate(self.supports):
            check_on_span(f"supports.{i}.x", support.x, self.length)
        for i, x in enumerate(joints := [coupling.x for coupling in self.couplings]):
            if not 0.0 < x < self.length or x in joints[:i]:
                raise problem(
                    f"couplings.{i}.x", x, f"must be between 0 and the length {self.length:g}, one at a place"
                )
        for key in ("supports", "couplings"):
            if getattr(self, key) and not self.is_straight:
                raise problem(key, None, "need a straight beam: without precone, sweep, line, and hub_offset across it")
        springs = {s.x for s in self.supports if s.holds}
        if self.root.driven and not self.root.free and len(springs) < 2:
            why = "needs structure.supports with a stiffness at two places at least, or root.free"
            raise problem("root.driven", True, why)


def same_about_axis(A: Array) -> bool:
    """Return whether matrices (…, 3 n, 3 n) of vectors commute with turns about direction 1, but for round-off."""
    turn = np.kron(np.eye(A.shape[-1] // 3), [[0, 0, 0], [0, 0, -1], [0, 1, 0]])
    size = np.sqrt(np.abs(np.einsum("...i,...j->...ij", *2 * [np.einsum("...ii->...i", A)])))
    size = np.maximum(size, np.abs(turn) @ size @ np.abs(turn.T))
    return bool(np.all(np.abs(A @ turn - turn @ A) <= ROUND * np.maximum(size, np.swapaxes(size, -1, -2))))


#: Relative difference by directions up to which a shaft counts as round.
ROUND = 1e-9


if TYPE_CHECKING:
    Structure = PlanarBeamStructure | SpatialBeamStructure | PlateStructure
else:
    _TYPES = {"planar_beam": PlanarBeamStructure, "spatial_beam": SpatialBeamStructure, "plate": PlateStructure}
    Structure = Annotated[Any, one_of(_TYPES)]


#: What reads the line before the whole table is read.
_LINE = TypeAdapter[Any](Line | None, config=ConfigDict(defer_build=True))


def _with_length(data: Mapping[str, Any], info: ValidationInfo) -> Mapping[str, Any]:
    """Return the table with the arc length of its line as its length; raise if another one is given."""
    try:
        rows = _LINE.validate_python(data.get("line"), context=info.context)
    except ValidationError:
        return {**data, "length": 1.0}  # the error of the line is reported at its key
    if rows is None:
        return data
    arc = line_through(rows).length
    given = in_units(data.get("length", arc), ["m"])
    if isinstance(given, int | float) and not isinstance(given, bool) and abs(given - arc) > DIGITS * arc:
        raise problem("length", given, f"is not the arc length of the line, {arc:.9g}; it may be left out")
    return {**data, "line": rows, "length": arc}
