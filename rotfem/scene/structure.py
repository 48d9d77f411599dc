"""What every structure of a scene is asked: kinds and designs, damping, and what the tables of all types share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from inspect import Parameter, signature
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import ConfigDict, Discriminator, Field, Tag

from rotfem.errors import SceneError, show
from rotfem.registry import Registry, damping_models, register, structures
from rotfem.scene.table import LISTED, SceneModel, did_you_mean, problem, unit
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
    seen = set[str]()
    while isinstance(given := tables.get("structure"), Mapping):
        name = given.get("type")
        if not isinstance(name, str) or name not in structures or structures[name].table is None:
            break
        if name in seen:
            raise SceneError(file, "structure.type", name, "is a design that stands for itself")
        seen.add(name)
        parameters = {key: value for key, value in given.items() if key != "type"}
        tables = {**tables, "structure": _table_of(structures[name].table, parameters, name, file)}
    return tables


def _table_of(table: Any, given: dict[str, Any], name: str, file: str) -> dict[str, Any]:
    known = signature(table).parameters
    for key in given:
        if key not in known:
            allowed = f"unknown key; {did_you_mean(key, known)}allowed: {', '.join(known)}"
            raise SceneError(file, f"structure.{key}", None, allowed)
    for key, parameter in known.items():
        if parameter.default is Parameter.empty and key not in given:
            why = f"required key is missing; type = {show(name)} needs it"
            raise SceneError(file, f"structure.{key}", None, why)
    try:
        return dict(table(**given))
    except (ArithmeticError, LookupError, TypeError, ValueError) as error:
        raise SceneError(file, "structure.type", name, f"the design fails: {type(error).__name__}: {error}") from None


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

    def check_inertial(self) -> None:
        """Refuse what has no meaning in the inertial frame."""
        if self.mass_rate > 0.0:
            why = 'must be 0 with frame = "inertial", where it would brake the revolution itself'
            raise problem("structure.damping.rayleigh", list(self.rayleigh), f"the mass-proportional part {why}")
        if self.has_modal:
            why = 'is not available with frame = "inertial", where the modes at rest turn; use "rotating"'
            raise problem("structure.damping.modal", self.modal, why)


# --- what structures share --------------------------------------------------------------------------------------------


class StructureTable(SceneModel):
    """The [structure] table."""

    #: Whether it moves in the plane (1, 2) of the frame only, and has rotations about axis 3 only.
    is_planar: ClassVar[bool] = False

    @property
    def nodes(self) -> tuple[float, ...]:
        """Places (m) along a beam, increasing, that its mesh must have nodes at: masses, and kinks of its axis."""
        return ()

    @property
    def hinges(self) -> dict[int, Any]:
        """Axis, 1 to 3, ↦ name, stiffness and damping of the turn that the root may make about it."""
        return {}

    @property
    def pitches(self) -> bool:
        """Whether it has a pitch that changes with time."""
        return False

    @property
    def mesh_file(self) -> str | None:
        """Absolute path of the file that its mesh is in, None if [mesh] has numbers of elements."""
        return None


def check_one_hub(hub_radius: float, hub_offset: tuple[float, float, float] | None) -> None:
    """Refuse a clamp whose position is given twice."""
    if hub_offset is not None and hub_radius != 0.0:
        raise problem("hub_offset", hub_offset, "give either hub_radius or hub_offset")
