"""The tables that say how to compute and what to record: model, initial state, mesh, time, modes, solver, output."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, PlainValidator, StrictBool, Tag, ValidationInfo

from rotfem import registry
from rotfem.along import FORCES, RESULTANTS, STRAINS
from rotfem.errors import show
from rotfem.scene.files import FROM_FILE
from rotfem.scene.table import BY_SHAPE, SceneModel, as_name, as_names, problem, unit
from rotfem.scene.values import (
    Count,
    NonNegative,
    Number,
    Positive,
    WithParameters,
    check_increasing,
    check_on_span,
    increasing,
    parameters_of,
)


def _as_effects(value: Any) -> str | tuple[str, ...]:
    if value in ("auto", "needed"):
        return str(value)
    return as_names(value, registry.effects.names, "an effect", '"auto", "needed" or ')


Degree = Annotated[int, Field(strict=True, ge=1, le=6)]
#: (nx, ny); a number stands for both.
Elements = Annotated[
    tuple[Count, Count], BeforeValidator(lambda given: given if isinstance(given, list | tuple) else (given, given))
]
Integration = Literal["reduced", "full"]


class ModelTable(SceneModel):
    """The [model] table.

    Attributes:
        theory: name of a registered theory, the order of the strain measure.
        effects: "auto", names of registered effects, those to include, or "needed": those that the accuracy of a run
            calls for.
        frame: frame to which displacements refer.
        prestress: stresses in the geometric stiffness of the prestressed linear theories of beams: "axial" forces, or
            "all" forces and moments. By default "all" for spatial beams without hinges, else "axial".
        all_unknowns: whether a history keeps unknowns that are zero by symmetry.
    """

    theory: Annotated[str, PlainValidator(lambda value: as_name(value, registry.theories))] = "reissner"
    effects: Annotated[str | tuple[str, ...], PlainValidator(_as_effects)] = "auto"
    frame: Literal["auto", "rotating", "inertial", "fixed"] = "auto"
    prestress: Literal["axial", "all"] | None = None
    all_unknowns: StrictBool = False


def _padded(rows: Any) -> Any:
    """Return rows (x, v1, v2, v3) of rows that may leave v3 out."""
    if not isinstance(rows, list | tuple):
        return rows
    return [(*row, 0.0) if isinstance(row, list | tuple) and len(row) == 3 else row for row in rows]


Velocities = Annotated[
    tuple[tuple[Number, Number, Number, Number], ...],
    BeforeValidator(_padded),
    FROM_FILE,
    AfterValidator(check_increasing),
    unit("m", "m/s"),
]


class Initial(SceneModel):
    """The [initial] table.

    Attributes:
        tip_displacement: u₂ of the tip (m) of the static shape from which a planar beam is released, or None.
        state: "steady", the equilibrium under the speed, loads and pitch of t = 0, or "undeformed"; with
            `tip_displacement` neither.
        mode: number of a mode about that state that is added, or None.
        amplitude: largest displacement of the tip in it (m).
        phase: of the mode (rad): at 0 the tip is displaced, at π/2 it moves.
        velocity: rows (x, v1, v2, v3) of a beam's axis relative to the turning frame (m, m/s), or None.
    """

    tip_displacement: Annotated[Number, unit("m")] | None = None
    state: Literal["steady", "undeformed"] = "steady"
    mode: Count | None = None
    amplitude: Annotated[Number, unit("m")] | None = None
    phase: Annotated[Number, unit("rad")] = 0.0
    velocity: Velocities | None = None

    @property
    def moves(self) -> bool:
        """Whether the structure does not start at rest, or in a mode."""
        return self.mode is not None or self.velocity is not None

    @property
    def first(self) -> str | None:
        """The key that says how a motion starts; None where it starts at rest in a state of balance."""
        return next((key for key in ("tip_displacement", "mode", "velocity") if getattr(self, key) is not None), None)

    @classmethod
    def _read(cls, data: Mapping[str, Any], info: ValidationInfo) -> Mapping[str, Any]:
        """Add that a static shape is no state of balance at speed."""
        return {"state": "undeformed", **data} if data.get("tip_displacement") is not None else data

    def _check(self) -> None:
        if (self.mode is None) != (self.amplitude is None):
            raise problem("amplitude", self.amplitude, "mode and amplitude are given together")
        if self.phase != 0.0 and self.mode is None:
            raise problem("phase", self.phase, "needs a mode")
        if self.moves and self.tip_displacement is not None:
            raise problem("tip_displacement", self.tip_displacement, "cannot be combined with mode or velocity")
        if self.mode is not None and self.velocity is not None:
            raise problem("velocity", None, "cannot be combined with mode, which has velocities")
        if self.tip_displacement is not None and self.state == "steady":
            raise problem("tip_displacement", self.tip_displacement, 'cannot be combined with state = "steady"')


class BeamMesh(SceneModel):
    """The [mesh] table of a beam.

    Attributes:
        elements: number of elements.
        degree: polynomial degree, 1 to 6.
        integration: quadrature of the elastic terms; "reduced" avoids locking.
    """

    elements: Count = 16
    degree: Degree = 3
    integration: Integration = "reduced"

    def suited(self, structure: Any) -> Self:
        """Return the mesh: the defaults of beams suit all lengths."""
        return self


class PlateMesh(SceneModel):
    """The [mesh] table of a plate.

    Attributes:
        elements: (nx, ny) of a rectangle; by default 64 cells by its aspect ratio (see `suited`). Without meaning if
            the structure has a mesh file.
        degree: polynomial degree, 1 to 6; if not given, 2 on quadrilaterals and 3 on triangles (see `degree_on`).
        cell: cell shape of a rectangle; without meaning if the structure has a mesh file.
        integration: quadrature of the membrane and shear terms; "reduced" avoids locking.
    """

    elements: Elements = (8, 8)
    degree: Degree = 2
    cell: Literal["quadrilateral", "triangle"] = "quadrilateral"
    integration: Integration = "reduced"

    def suited(self, structure: Any) -> Self:
        """Return the mesh with the counts that suit a rectangle, where none are given."""
        if "elements" in self.model_fields_set or structure.mesh_file is not None:
            return self
        counts = _counts_for(structure.length / structure.width)
        # Not by `model_copy`, which would count them as given: for another structure they are chosen anew.
        out: Self = self.model_construct(self.model_fields_set, **{**self.model_dump(), "elements": counts})  # type: ignore[arg-type,assignment]
        return out

    @classmethod
    def _read(cls, data: Mapping[str, Any], info: ValidationInfo) -> Mapping[str, Any]:
        """Add the degree that does not lock on triangles."""
        return {"degree": 3, **data} if data.get("cell") == "triangle" else data

    def degree_on(self, cell: str) -> int:
        """Return the polynomial degree on cells of a shape: as given, else 2 on quadrilaterals and 3 on triangles."""
        return 3 if cell == "triangle" and "degree" not in self.model_fields_set else self.degree

    def locking_on(self, cell: str) -> str | None:
        """Return why the elements lock on cells of a shape; None if they do not."""
        least = {("quadrilateral", "reduced"): 2, ("quadrilateral", "full"): 3, ("triangle", "reduced"): 3}
        needed, degree = least.get((cell, self.integration), 4), self.degree_on(cell)
        if degree >= needed:
            return None
        why = f"{cell}s of degree {degree} with {self.integration} integration lock: thin plates come out far too stiff"
        defaults = "defaults: quadrilaterals of degree 2, triangles of degree 3, reduced integration"
        return f"{why}; must be at least {needed} here ({defaults})"


def _counts_for(aspect: float) -> tuple[int, int]:
    """Return (nx, ny), 64 cells of a rectangle: (8, 8) up to 2:1, (16, 4) up to 32:1, (32, 2) beyond, or swapped.

    A strip bends with ever shorter waves along it before anything happens across it, where its cells stay narrower.
    """
    ratio = max(aspect, 1 / aspect)
    doublings = 0 if ratio <= 2.0 else 1 if ratio <= 32.0 else 2
    many, few = 8 * 2**doublings, 8 // 2**doublings
    return (many, few) if aspect >= 1.0 else (few, many)


def estimates_error(scheme: type) -> bool:
    """Return whether a class of `Scheme` says `local_error` itself, rather than have what all schemes inherit."""
    owner = next(base for base in scheme.__mro__ if "local_error" in base.__dict__)
    return "registry" not in owner.__dict__


def usual(given: Mapping[str, Any]) -> str:
    """Return the scheme of a [time] table that names none: generalised-α for fixed steps, esdirk4 for a tolerance."""
    fixed = "generalised_alpha"
    of_fixed = any(key in given for key in parameters_of(registry.schemes[fixed]))
    return "esdirk4" if given.get("tolerance") is not None and not of_fixed else fixed


Seconds = Annotated[Positive, unit("s")]


#: What a history without steps lacks.
NO_STEPS = (
    "missing: give step (fixed steps, s), tolerance (adaptive steps), or accuracy = 1e-3 beside [time], which finds it"
)


class Time(WithParameters):
    """The [time] table. Either step or tolerance is given; the parameters of the scheme are keys as well.

    Attributes:
        end: final time (s).
        step: time step (s), or None for adaptive steps.
        tolerance: error of all adaptive steps together, relative to the largest displacement, or None.
        max_step: longest adaptive step (s); `end`/20 if not given.
        min_step: shortest adaptive step (s); 1e-9 `end` if not given.
        scheme: name of a registered scheme; if not given, the usual one of fixed or adaptive steps.
        breakpoints: times (s) at which a function of time jumps or has a kink. Steps of order above 2 end there; others
            replace it by the straight line of the same impulse and first moment.
        output_every: number of steps from one output to the next.
        output_step: time (s) from one output to the next, independent of the steps; by default `output_every` steps.
    """

    CHOICE, ENTRIES = "scheme", registry.schemes

    end: Seconds
    step: Seconds | None = None
    tolerance: Positive | None = None
    max_step: Seconds | None = None
    min_step: Seconds | None = None
    scheme: str = "generalised_alpha"
    breakpoints: Annotated[tuple[NonNegative, ...], AfterValidator(lambda times: tuple(sorted(times))), unit("s")] = ()
    output_every: Count = 1
    output_step: Seconds | None = None

    @classmethod
    def _read(cls, data: Mapping[str, Any], info: ValidationInfo) -> Mapping[str, Any]:
        """Add the scheme that is not given, and its parameters; steps follow from an accuracy where none are given."""
        given = {key: value for key, value in data.items() if value is not None}
        wanted = (info.context or {}).get("accuracy")
        if isinstance(wanted, float) and wanted > 0.0 and not {"step", "tolerance"} & given.keys():
            given["tolerance"] = wanted
        return super()._read({"scheme": usual(given)} | given, info)

    def _check(self) -> None:
        super()._check()
        if self.tolerance is not None and not estimates_error(registry.schemes[self.scheme]):
            able = ", ".join(show(other.name) for other in registry.schemes if estimates_error(other))
            reason = "does not estimate its error, so its steps are fixed: give step, no tolerance"
            raise problem("scheme", self.scheme, f"{reason} (adaptive steps: {able})")
        self._check_steps()

    def _check_steps(self) -> None:
        if self.step is not None and self.tolerance is not None:
            raise problem("step", self.step, "give step (fixed steps, s) or tolerance (adaptive steps), not both")
        if self.step is not None and self.step > self.end:
            raise problem("step", self.step, f"must be at most time.end = {self.end:g}")
        if self.output_step is not None and self.output_every != 1:
            raise problem("output_step", self.output_step, "cannot be combined with output_every, which counts steps")


class ModesTable(SceneModel):
    """The [modes] table.

    Attributes:
        count: number of modes.
        about: state of the linearisation: "steady" (deformed equilibrium) or "undeformed".
        orders: k of the lines kΩ of a Campbell diagram, whose crossings are critical speeds. By default those up to 4Ω
            that meet a mode.
        rated: rated speed of the rotor, which the diagram marks (rad/s).
        operating: lowest and highest speed of operation, which the diagram marks (rad/s).
    """

    count: Count = 6
    about: Literal["steady", "undeformed"] = "steady"
    orders: Annotated[tuple[Count, ...], AfterValidator(lambda orders: tuple(sorted(set(orders))))] | None = None
    rated: Annotated[Positive, unit("rad/s")] | None = None
    operating: Annotated[tuple[NonNegative, NonNegative], AfterValidator(increasing), unit("rad/s")] | None = None


class Solver(SceneModel):
    """The [solver] table.

    Attributes:
        increment_tolerance: Newton's method stops at this relative size of the increment.
        max_iterations: most Newton iterations per solve.
    """

    increment_tolerance: Positive = 1e-9
    max_iterations: Count = 25


def _as_quantities(value: Any) -> tuple[str, ...]:
    sections = dict.fromkeys(name for table in (FORCES, STRAINS, RESULTANTS) for of in table.values() for name in of)
    return as_names(value, (*registry.outputs.names, *sections), "an output")


#: Positions that increase, or how many there are.
Stations = Annotated[
    Annotated[int, Field(strict=True, ge=2, le=10_000), Tag("<one>")]
    | Annotated[tuple[Number, ...], AfterValidator(increasing), Tag("<rows>")],
    BY_SHAPE,
    unit("m"),
]


#: Units in which speeds and frequencies can be printed and drawn.
AngularUnit = Literal["rad/s", "rpm", "Hz", "deg/s"]


class OutputTable(SceneModel):
    """The [output] table.

    Attributes:
        quantities: registered outputs to record, and quantities at the stations of a beam, by default all of these.
        stations: positions along a beam (m) where section forces, strains and unknowns are recorded; a number of them
            from end to end.
        every: rows of history.csv from one record of the stations to the next.
        format: of the file of the stations.
        fields: format of the files for ParaView, "xdmf"; empty for none.
        error: whether errors are estimated.
        speed: unit in which speeds are printed and drawn; that of motion.speed if not given.
        frequency: unit in which frequencies of modes are printed and drawn.
    """

    quantities: Annotated[tuple[str, ...], PlainValidator(_as_quantities)] = ()
    stations: Stations | None = None
    every: Count = 1
    format: Literal["csv", "netcdf"] = "csv"
    fields: tuple[Literal["xdmf"], ...] = ("xdmf",)
    error: StrictBool = True
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
            return
        if kind not in FORCES or length is None:
            shown = self.stations if isinstance(self.stations, int) else list(self.stations)
            raise problem("output.stations", shown, f"are places along a beam; a {kind} has none")
        for x in self.positions(length):
            check_on_span("output.stations", x, length)
