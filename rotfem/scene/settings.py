"""The tables that say how to compute: model, initial state, mesh, modes, solver; time and output in their own ones."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import PlainValidator, ValidationInfo, model_validator

from rotfem import registry
from rotfem.scene.files import as_table
from rotfem.scene.plates import locking
from rotfem.scene.values import (
    Bounds,
    Count,
    Matrix,
    Number,
    Positive,
    SceneModel,
    as_increasing_rows,
    as_name,
    as_names,
    problem,
)


def _as_theory(value: Any) -> str:
    return as_name(value, registry.theories)


def _as_effects(value: Any) -> str | tuple[str, ...]:
    return "auto" if value == "auto" else as_names(value, registry.effects, '"auto" or ')


def _as_plate_elements(value: Any) -> tuple[int, int]:
    entries = list(value) if isinstance(value, list | tuple) else [value, value]
    if len(entries) != 2 or any(type(n) is not int or not 1 <= n <= 10**6 for n in entries):
        raise problem("", value, "must be an integer at least 1, or two of them [nx, ny]")
    return entries[0], entries[1]


def _as_reduced(value: Any) -> bool | float:
    if isinstance(value, bool):
        return value
    if isinstance(value, int | float) and 0.0 < value < 1.0:
        return float(value)
    raise problem("", value, "must be true, false, or an accuracy between 0 and 1")


Degree = Annotated[int, PlainValidator(Bounds(ge=1, le=6).integer)]
Integration = Literal["reduced", "full"]


class Model(SceneModel):
    """The [model] table.

    Attributes:
        theory: name of a registered theory, the order of the strain measure.
        effects: "auto", or names of registered effects, those to include.
        frame: frame to which displacements refer.
        prestress: of the prestressed linear theories of beams, what their geometric stiffness is of: "axial" forces, or
            "all" forces and moments; None for what is usual for the structure.
        tolerance: estimated error of the theory up to which a poorer one may take its place, or None.
        on_exceed: what happens where the named theory misses the tolerance, too: "stop" ends with the failure that it
            is, "warn" and "upgrade" (a richer one is tried before in any case) warn.
        reduced: whether a history is that of a reduced model, of a linear theory; a number is its accuracy.
        foreshortening: whether a reduced model gives back the foreshortening that linear strains lack.
        all_unknowns: whether unknowns that are zero by symmetry are unknowns of a history all the same.
    """

    theory: Annotated[str, PlainValidator(_as_theory)] = "reissner"
    effects: Annotated[str | tuple[str, ...], PlainValidator(_as_effects)] = "auto"
    frame: Literal["rotating", "inertial"] = "rotating"
    prestress: Literal["axial", "all"] | None = None
    tolerance: Positive | None = None
    on_exceed: Literal["upgrade", "stop", "warn"] = "upgrade"
    reduced: Annotated[bool | float, PlainValidator(_as_reduced)] = False
    foreshortening: bool = False
    all_unknowns: bool = False

    @model_validator(mode="after")
    def _check_choice(self) -> Self:
        if self.tolerance is not None and self.frame == "inertial":
            raise problem("tolerance", self.tolerance, 'needs frame = "rotating", as the cheaper theories do')
        if self.tolerance is not None and self.reduced:
            raise problem("reduced", self.reduced, "cannot be combined with tolerance, which chooses the model")
        if self.foreshortening and not self.reduced:
            raise problem(
                "foreshortening", True, "needs reduced = true: it is given back to the shapes of a reduced model"
            )
        return self


def _as_velocities(value: Any, info: ValidationInfo) -> Matrix:
    rows = as_table(value, info, (3, 4), "a table [[x, v1, v2, v3], …] (v3 may be left out)", as_increasing_rows)
    return tuple((*row, 0.0)[:4] for row in rows)


class Initial(SceneModel):
    """The [initial] table.

    Attributes:
        tip_displacement: u₂ of the tip (m) of the static shape from which a planar beam is released, or None.
        state: "steady", the equilibrium under the speed, loads and pitch of t = 0, or "undeformed"; a static shape
            (`tip_displacement`) is no equilibrium of theirs.
        mode: number of a mode about that state which the motion starts in, or None.
        amplitude: largest displacement of the tip in it (m).
        phase: of the mode (rad): at 0 the tip is displaced, at π/2 it moves.
        velocity: rows (x, v1, v2, v3) of a beam's axis relative to the turning frame (m, m/s), or None.
    """

    tip_displacement: Number | None = None
    state: Literal["steady", "undeformed"] = "steady"
    mode: Count | None = None
    amplitude: Number | None = None
    phase: Number = 0.0
    velocity: Annotated[Matrix, PlainValidator(_as_velocities)] | None = None

    @property
    def moves(self) -> bool:
        """Whether the structure does not start at rest, or in a mode."""
        return self.mode is not None or self.velocity is not None

    @property
    def first(self) -> str | None:
        """The key that says how a motion starts; None where it starts at rest in a state of balance."""
        return next((key for key in ("tip_displacement", "mode", "velocity") if getattr(self, key) is not None), None)

    @model_validator(mode="after")
    def _check_one(self) -> Self:
        if (self.mode is None) != (self.amplitude is None):
            raise problem("amplitude", self.amplitude, "mode and amplitude are given together")
        if self.phase != 0.0 and self.mode is None:
            raise problem("phase", self.phase, "needs a mode")
        if self.moves and self.tip_displacement is not None:
            raise problem("tip_displacement", self.tip_displacement, "cannot be combined with mode or velocity")
        if self.mode is not None and self.velocity is not None:
            raise problem("velocity", None, "cannot be combined with mode, which has velocities")
        if self.tip_displacement is not None:
            if self.state == "steady" and "state" in self.model_fields_set:
                raise problem("tip_displacement", self.tip_displacement, 'cannot be combined with state = "steady"')
            vars(self)["state"] = "undeformed"
        return self


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

    @property
    def locking(self) -> str | None:
        """Why the elements lock; None, as those of beams are not refused."""
        return None

    def suited(self, structure: Any) -> Self:
        """Return the mesh: the defaults of beams suit all lengths."""
        return self

    def at_most(self, nodes: int) -> Self:
        """Return the mesh, with no more elements than so many nodes along the beam need."""
        return self.model_copy(update={"elements": min(self.elements, math.ceil(nodes / self.degree))})


class PlateMesh(SceneModel):
    """The [mesh] table of a plate.

    Attributes:
        elements: (nx, ny) of a rectangle; if not given, 64 cells by its aspect ratio (see `suited`). Without meaning if
            the structure has a mesh file.
        degree: polynomial degree, 1 to 6; if not given, 2 on quadrilaterals and 3 on triangles (see `degree_on`).
        cell: cell shape of a rectangle; without meaning if the structure has a mesh file.
        integration: quadrature of the membrane and shear terms; "reduced" avoids locking.
    """

    elements: Annotated[tuple[int, int], PlainValidator(_as_plate_elements)] = (8, 8)
    degree: Degree = 2
    cell: Literal["quadrilateral", "triangle"] = "quadrilateral"
    integration: Integration = "reduced"

    @property
    def locking(self) -> str | None:
        """Why the elements of a rectangle lock; None if they do not."""
        return self.locking_on(self.cell)

    def suited(self, structure: Any) -> Self:
        """Return the mesh with the counts that suit a rectangle, where none are given.

        Args:
            structure: a plate; its `length` and `width` (m) are None of one with a mesh file.
        """
        if "elements" in self.model_fields_set or structure.mesh_file is not None:
            return self
        out = self.model_copy()
        # Not by `update`, which would count them as given: for another structure they are chosen anew.
        vars(out)["elements"] = counts_for(structure.length / structure.width)
        return out

    @model_validator(mode="before")
    @classmethod
    def _fill_degree(cls, data: Any) -> Any:
        """Add the degree that does not lock on triangles."""
        triangles = isinstance(data, Mapping) and data.get("cell") == "triangle"
        return {"degree": 3, **data} if triangles else data

    def degree_on(self, cell: str) -> int:
        """Return the polynomial degree on cells of a shape: as given, else 2 on quadrilaterals and 3 on triangles."""
        return 3 if cell == "triangle" and "degree" not in self.model_fields_set else self.degree

    def at_most(self, nodes: int) -> Self:
        """Return the mesh of a rectangle, with no more elements than so many nodes in each direction need."""
        enough = math.ceil(nodes / self.degree)
        return self.model_copy(update={"elements": tuple(min(n, enough) for n in self.elements)})

    def locking_on(self, cell: str) -> str | None:
        """Return why the elements lock on cells of a shape; None if they do not (see `locking`)."""
        return locking(cell, self.degree_on(cell), self.integration)


def counts_for(aspect: float) -> tuple[int, int]:
    """Return (nx, ny), 64 cells of a rectangle: (8, 8) up to 2:1, (16, 4) up to 32:1, (32, 2) beyond, or swapped.

    A strip bends with ever shorter waves along it before anything happens across it, where its cells stay narrower.

    Args:
        aspect: length over width.
    """
    ratio = max(aspect, 1 / aspect)
    doublings = 0 if ratio <= 2.0 else 1 if ratio <= 32.0 else 2
    many, few = 8 * 2**doublings, 8 // 2**doublings
    return (many, few) if aspect >= 1.0 else (few, many)


class Modes(SceneModel):
    """The [modes] table.

    Attributes:
        count: number of modes.
        about: state about which the motion is small: "steady" (deformed equilibrium) or "undeformed".
    """

    count: Count = 6
    about: Literal["steady", "undeformed"] = "steady"


class Solver(SceneModel):
    """The [solver] table.

    Attributes:
        increment_tolerance: Newton's method stops at this relative size of the increment.
        max_iterations: most Newton iterations per solve.
        continuation: how an equilibrium is reached: "load", growing with it up to the first limit point, or
            "arc_length", along the path of equilibria past limit points.
    """

    increment_tolerance: Positive = 1e-9
    max_iterations: Count = 25
    continuation: Literal["load", "arc_length"] = "load"

    @property
    def past_limits(self) -> bool:
        """Whether a path of equilibria is followed past limit points."""
        return self.continuation == "arc_length"
