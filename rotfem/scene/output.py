"""The [output] table: what is recorded in addition to what always is, and in which units numbers are shown."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import PlainValidator

from rotfem import registry
from rotfem.scene.table import SceneModel, as_names, problem
from rotfem.scene.values import Count
from rotfem.section_quantities import FORCES, RESULTANTS, STRAINS

AngularUnit = Literal["rad/s", "rpm", "Hz", "deg/s"]

#: Most stations along a beam.
MOST = 10_000


def _as_quantities(value: Any) -> tuple[str, ...]:
    sections = dict.fromkeys(name for table in (FORCES, STRAINS, RESULTANTS) for of in table.values() for name in of)
    return as_names(value, (*registry.outputs.names, *sections), "an output")


def _as_stations(value: Any) -> int | tuple[float, ...]:
    if type(value) is int and 2 <= value <= MOST:
        return value
    numbers = isinstance(value, list | tuple) and all(type(x) in (int, float) and np.isfinite(x) for x in value)
    if not numbers or not 0 < len(value) <= MOST:
        raise problem("", value, f"must be a list of positions along the beam (m), or how many there are, 2 to {MOST}")
    if any(b <= a for a, b in pairwise(value)):
        raise problem("", value, "must be positions that increase")
    return tuple(float(x) for x in value)


def _as_formats(value: Any) -> tuple[str, ...]:
    return as_names(value, ("vtx", "xdmf"), "a format")


class OutputTable(SceneModel):
    """The [output] table.

    Attributes:
        quantities: names of registered outputs, to be computed in addition to what is always recorded; and of what
            beams have at their stations, all of it if none is named.
        stations: positions along a beam (m) where section forces, strains and unknowns are recorded; a number of them
            from end to end.
        every: rows of history.csv from one record of the stations to the next.
        format: of the file that they go to.
        fields: formats of the files for ParaView, "vtx" and "xdmf"; VTX of a plate and XDMF of a beam if not given.
        error: whether the error of what is computed is estimated.
        speed: unit in which speeds are printed and drawn.
        frequency: unit in which frequencies of modes are printed and drawn.
    """

    quantities: Annotated[tuple[str, ...], PlainValidator(_as_quantities)] = ()
    stations: Annotated[int | tuple[float, ...] | None, PlainValidator(_as_stations)] = None
    every: Count = 1
    format: Literal["csv", "hdf5"] = "csv"
    fields: Annotated[tuple[str, ...] | None, PlainValidator(_as_formats)] = None
    error: bool = True
    speed: AngularUnit = "rad/s"
    frequency: AngularUnit = "rad/s"

    @property
    def functionals(self) -> tuple[str, ...]:
        """The registered outputs among the quantities."""
        return tuple(name for name in self.quantities if name in registry.outputs)

    def resultants(self, kind: str) -> tuple[str, ...]:
        """Return the stress resultants of a plate among the quantities."""
        return tuple(name for name in self.quantities if name in RESULTANTS.get(kind, ()))

    def sections(self, kind: str) -> tuple[str, ...]:
        """Return the quantities that a beam of a type is to have recorded at its stations: those named, or all."""
        known = (*FORCES[kind], *STRAINS[kind])
        return tuple(name for name in self.quantities if name in known) or known

    def formats(self, kind: str) -> tuple[str, ...]:
        """Return the formats of the files for ParaView of a structure of a type."""
        if self.fields is not None:
            return self.fields
        if kind in FORCES:
            return ("xdmf",)
        return ("vtx", "xdmf") if self.resultants(kind) else ("vtx",)

    def positions(self, length: float) -> tuple[float, ...]:
        """Return the stations along a beam of a length, m; empty if there are none."""
        if isinstance(self.stations, int):
            return tuple(float(x) for x in np.linspace(0.0, length, self.stations))
        return self.stations or ()

    def check(self, kind: str, length: float | None) -> None:
        """Refuse quantities and stations that a structure of a type, of a length (m) or None with a mesh, has not."""
        named = [name for name in self.quantities if name not in registry.outputs]
        known = (*FORCES.get(kind, ()), *STRAINS.get(kind, ()), *RESULTANTS.get(kind, ()))
        for name in named:
            if name not in known:
                allowed = f'"{name}" is none of a {kind}; allowed: {", ".join(known)}'
                raise problem("output.quantities", list(self.quantities), allowed)
        if self.stations is None:
            if named and kind in FORCES:
                raise problem("output.quantities", list(self.quantities), f'"{named[0]}" needs output.stations')
            for key in ("every", "format"):
                if getattr(self, key) != type(self).model_fields[key].default:
                    raise problem(f"output.{key}", getattr(self, key), "has no meaning without output.stations")
            return
        if kind not in FORCES or length is None:
            shown = self.stations if isinstance(self.stations, int) else list(self.stations)
            raise problem("output.stations", shown, f"are places along a beam; a {kind} has none")
        outside = [x for x in self.positions(length) if not 0.0 <= x <= length]
        if outside:
            raise problem("output.stations", outside[0], f"must be from 0 to the length {length:g} m")
