"""What structures share: kinds and designs, damping, what holds a beam, and what the tables of all types are asked."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from inspect import signature
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, cast

import numpy as np
from pydantic import ConfigDict, Discriminator, Field, StrictBool, Tag

from rotfem.errors import SceneError
from rotfem.registry import Registry, damping_models, register, structures
from rotfem.scene.loads import Harmonics, TimeFunction
from rotfem.scene.table import LISTED, SceneModel, problem, unit, unknown_key
from rotfem.scene.values import NonNegative


@dataclass(frozen=True)
class StructureKind:
    """A type of structure, which `structure.type` names.

    Attributes:
        name: what a scene calls it.
        table: keys of [structure] but for type ↦ the [structure] table of another kind, as a function with these as its
            arguments: a design with parameters of its own. None: the kind has a table and a mesh itself.
        discretised: (problem, communicator) ↦ the structure with its mesh, of a kind without `table`.
    """

    registry: ClassVar[Registry[StructureKind]] = structures

    name: str
    table: Callable[..., Mapping[str, Any]] | None = None
    discretised: str | Callable[..., Any] = ""


def designed(tables: dict[str, Any], file: str) -> dict[str, Any]:
    """Return the tables of a scene with the structure that a design stands for in its place."""
    given = tables.get("structure")
    name = given.get("type") if isinstance(given, Mapping) else None
    design: Any = structures[name].table if isinstance(name, str) and name in structures else None
    if not isinstance(given, Mapping) or design is None:
        return tables
    parameters = {key: value for key, value in given.items() if key != "type"}
    known = signature(design).parameters
    for key in parameters:
        if key not in known:
            raise SceneError(file, f"structure.{key}", None, unknown_key(key, known))
    try:
        table = dict(design(**parameters))
    except (ArithmeticError, LookupError, TypeError, ValueError) as error:  # TypeError: a parameter is missing
        raise SceneError(file, "structure.type", name, f"the design fails: {type(error).__name__}: {error}") from None
    return designed({**tables, "structure": table}, file)


for _name, _home in (
    ("planar_beam", "beam:PlanarBeam"),
    ("spatial_beam", "spatial_beam:SpatialBeam"),
    ("plate", "plate:Plate"),
):
    register(StructureKind(_name, discretised=f"rotfem.structures.{_home}"))


# --- damping ----------------------------------------------------------------------------------------------------------

Ratio = Annotated[float, Field(strict=True, ge=0, lt=1)]
#: Ratios in the order of frequency; a number is one.
Ratios = Annotated[tuple[Ratio, ...], LISTED]


def _kind_of_ratios(value: Any) -> str:
    return "<table>" if isinstance(value, Mapping) else "<rows>" if isinstance(value, list | tuple) else "<one>"


#: One ratio for the first modes, one for each in the order of frequency, or family ↦ such ratios.
Modal = Annotated[
    Annotated[Ratio, Tag("<one>")] | Annotated[Ratios, Tag("<rows>")] | Annotated[dict[str, Ratios], Tag("<table>")],
    Discriminator(_kind_of_ratios),
]


class DampingTable(SceneModel):
    """The [structure.damping] table.

    Attributes:
        kelvin_voigt: η (s) in stress = C (ε + η ε̇).
        rayleigh: (a0, a1): mass-proportional (1/s) and stiffness-proportional (s) coefficient.
        modal: damping ratios of modes at rest: one for the first ten, one for each in the order of frequency, or by
            family. See `rotfem.equations.modal_damping`.

    The coefficients of registered damping models are further keys.
    """

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, NonNegative]

    kelvin_voigt: Annotated[NonNegative, unit("s")] = 0.0
    rayleigh: Annotated[tuple[NonNegative, NonNegative], unit("1/s", "s")] = (0.0, 0.0)
    modal: Annotated[Modal, unit("dimensionless")] = 0.0

    @classmethod
    def keys(cls) -> list[str]:
        """Return the keys of the table and those of all registered models."""
        return [*super().keys(), *damping_models.names]

    @property
    def viscosity(self) -> float:
        """η (s) of the stress C η ε̇, of Kelvin–Voigt's model and Rayleigh's stiffness-proportional part."""
        return self.kelvin_voigt + self.rayleigh[1]

    @property
    def mass_rate(self) -> float:
        """Mass-proportional rate (1/s)."""
        return self.rayleigh[0]

    @property
    def models(self) -> dict[str, float]:
        """Coefficients of registered models by name, those that are not zero."""
        return {name: c for name, c in self.__pydantic_extra__.items() if c != 0.0}

    @property
    def is_zero(self) -> bool:
        """Whether there is no damping at all."""
        return not (self.viscosity or self.mass_rate or self.has_modal or self.models)

    @property
    def has_modal(self) -> bool:
        """Whether modes at rest have ratios that are not zero."""
        families = self.modal.values() if isinstance(self.modal, dict) else [self.modal]
        return any(bool(np.any(np.asarray(ratios))) for ratios in families)


# --- root and supports of beams ---------------------------------------------------------------------------------------


class PitchAngle(Harmonics):
    """The pitch over time.

    Attributes:
        value: a constant angle (rad), or None.
        over_time: rows (t, angle), at rest before the first and after the last; or a function of t; or None.
        rate: Python function t (s) ↦ rate of the function's angle (rad/s); by default differences.
    """

    SIZES: ClassVar[tuple[int, ...]] = (1,)
    UNIT: ClassVar[str] = "rad"

    rate: TimeFunction | None = None

    @property
    def changes(self) -> bool:
        """Whether it changes with time; a function is taken to."""
        rows = self.over_time
        moves = callable(rows) or len({angle for _, angle in rows or ()}) > 1
        return moves or any(h.amplitude != (0.0,) for h in self.harmonic)

    @property
    def constant(self) -> float:
        """The angle of one that does not change, rad."""
        return next((angle for _, (angle,) in self.vectors), 0.0)

    def _check(self) -> None:
        super()._check()
        if self.rate is not None and not callable(self.over_time):
            raise problem("rate", None, "is that of a function; tables and harmonics have their own")


class Hinge(NamedTuple):
    """A turn that the root may make: its name, and stiffness (N·m/rad) and damping (N·m·s/rad) against it."""

    name: str
    stiffness: float
    damping: float


Spring = Annotated[NonNegative, unit("N*m")]
Damper = Annotated[NonNegative, unit("N*m*s")]


class Root(SceneModel):
    """What holds the root of a beam: rigid but about the axes that have a stiffness; 0 is a hinge.

    Attributes:
        lag_stiffness: against turns about direction 3 (N·m/rad), or None: rigid.
        lag_damping: against their rate (N·m·s/rad).
        hinge_offset: from the end of the hub to the root (m), a rigid arm in direction 1.
    """

    #: Name of a turn ↦ the axis that it is about.
    AXES: ClassVar[dict[str, int]] = {"lag": 3}

    lag_stiffness: Spring | None = None
    lag_damping: Damper = 0.0
    hinge_offset: Annotated[NonNegative, unit("m")] = 0.0

    @property
    def hinges(self) -> dict[int, Hinge]:
        """Axis, 1 to 3, ↦ the hinge about it; axes that are rigid are left out."""
        given = ((axis, name, getattr(self, f"{name}_stiffness")) for name, axis in self.AXES.items())
        return {a: Hinge(name, k, getattr(self, f"{name}_damping")) for a, name, k in given if k is not None}

    def _check(self) -> None:
        for name in self.AXES:
            damping = getattr(self, f"{name}_damping")
            if damping > 0.0 and getattr(self, f"{name}_stiffness") is None:
                why = f"needs {name}_stiffness, which may be 0: without it the root is rigid"
                raise problem(f"{name}_damping", damping, why)


class SpatialRoot(Root):
    """What holds the root of a spatial beam.

    Attributes:
        flap_stiffness: against turns about direction 2 (N·m/rad), or None: rigid.
        flap_damping: against their rate (N·m·s/rad).
        pitch_stiffness: against turns about the axis of the blade (N·m/rad), or None: rigid.
        pitch_damping: against their rate (N·m·s/rad).
        pitch: angle that the whole blade is turned by about its axis at the root (rad), a number or over time.
        driven: whether the drive constrains a shaft along and about its axis alone; `supports` carry the rest.
        free: components that nothing holds at the root: u1 leaves thrust free, theta1 torsion.
    """

    AXES: ClassVar[dict[str, int]] = {"pitch": 1, "flap": 2, "lag": 3}

    flap_stiffness: Spring | None = None
    flap_damping: Damper = 0.0
    pitch_stiffness: Spring | None = None
    pitch_damping: Damper = 0.0
    pitch: PitchAngle = Field(default_factory=lambda: cast(Any, 0.0), validate_default=True)
    driven: StrictBool = False
    free: tuple[Literal["u1", "u2", "u3", "theta1", "theta2", "theta3"], ...] = ()

    @property
    def released(self) -> set[int]:
        """Numbers of the components that the root leaves free, 0 to 5, but for the turns of its hinges."""
        names = ("u1", "u2", "u3", "theta1", "theta2", "theta3")
        return {names.index(name) for name in self.free} | ({1, 2, 4, 5} if self.driven else set())

    def check(self, precone: float) -> None:
        """Refuse springs of a root that a drive frees, and one of two whose axes precone (rad) or pitch turns."""
        if self.released and (self.hinges or self.pitch.changes):
            why = "leaves the root free to turn, without hinges and a pitch over time; structure.supports hold it"
            raise problem("root.driven" if self.driven else "root.free", None, why)
        pairs = [(1, 3, "a precone")] if precone != 0.0 else []
        for first, second, what in [*pairs, (2, 3, "a pitch over time")] if self.pitch.changes else pairs:
            if (first in self.hinges) != (second in self.hinges):
                missing = next(name for name, axis in self.AXES.items() if axis in {first, second} - self.hinges.keys())
                why = f"must be given too with {what}, which turns the axes of both; a large number holds it"
                raise problem(f"root.{missing}_stiffness", None, why)


# --- what structures share --------------------------------------------------------------------------------------------


class StructureTable(SceneModel):
    """The [structure] table."""

    #: Whether it moves in the plane (1, 2) of the frame only, and has rotations about axis 3 only.
    is_planar: ClassVar[bool] = False

    #: Places (m) along a beam, increasing, that its mesh must have nodes at: masses, and kinks of its axis.
    nodes: ClassVar[Any] = ()
    #: Axis, 1 to 3, ↦ name, stiffness and damping of the turn that the root may make about it.
    hinges: ClassVar[Any] = MappingProxyType({})
    #: Whether it has a pitch that changes with time.
    pitches: ClassVar[Any] = False
    #: Absolute path of the file that its mesh is in, None if [mesh] has numbers of elements.
    mesh_file: ClassVar[Any] = None


def check_one_hub(hub_radius: float, hub_offset: tuple[float, float, float] | None) -> None:
    """Refuse a clamp whose position is given twice."""
    if hub_offset is not None and hub_radius != 0.0:
        raise problem("hub_offset", hub_offset, "give either hub_radius or hub_offset")
