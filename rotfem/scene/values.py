"""Numbers, vectors, tapers and matrices as a scene may hold them.

Booleans and strings are not numbers here, and nothing infinite or undefined gets past this module. Sequences
become tuples, so that a validated scene cannot be changed by accident.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Any, ClassVar, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt
from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, Tag, ValidationInfo

from rotfem.along import JUMP
from rotfem.registry import Registry
from rotfem.scene.files import FROM_FILE
from rotfem.scene.table import BY_SHAPE, SceneModel, as_name, problem, unit

Array: TypeAlias = npt.NDArray[np.float64]
T = TypeVar("T")

#: Largest number of a scene: its third power is a double, as those of thicknesses are.
LARGEST = 1e100

#: Part by which two numbers of a scene that mean the same may differ, and two of another program's file.
ROUND_OFF, DIGITS = 1e-9, 1e-6

# --- numbers and vectors ----------------------------------------------------------------------------------------------

Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-LARGEST, le=LARGEST)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=LARGEST)]
NonNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=LARGEST)]
PoissonRatio = Annotated[float, Field(strict=True, gt=-1, lt=0.5)]
ShearCorrection = Annotated[float, Field(strict=True, gt=0, le=1)]
Count = Annotated[int, Field(strict=True, ge=1, le=2**31)]
Vector = tuple[Number, Number, Number]


def padded(value: Any) -> Any:
    """Return a vector of three components, the third zero if only two are given; raise on any other size."""
    if not isinstance(value, list | tuple) or len(value) not in (2, 3):
        raise problem("", value, "must be a list of 2 or 3 numbers")
    return (*value, 0.0)[:3]


PaddedVector = Annotated[Vector, BeforeValidator(padded)]

# --- rows, tapers and matrices ----------------------------------------------------------------------------------------

Matrix: TypeAlias = tuple[tuple[float, ...], ...]
Rows = tuple[tuple[Number, ...], ...]


def check_increasing(rows: Any) -> Any:
    """Return rows; refuse fewer than two of them, and a first column that does not increase strictly."""
    if isinstance(rows, float):
        return rows
    check_span(rows)
    for i, (before, after) in enumerate(pairwise(row[0] for row in rows), start=2):
        if after == before:
            raise problem("", None, f"the first column must increase strictly; row {i}: {after:g} twice")
    return rows


def check_times(rows: Any) -> Any:
    """Return rows (t, …) at least JUMP of the largest |t| (s) apart: two of one t are a ramp that keeps its digits."""
    out, width = [check_span(rows)[0]], JUMP * max(abs(rows[0][0]), abs(rows[-1][0]))
    for t, *values in rows[1:]:
        out.append((max(t, out[-1][0] + width), *values))
    return tuple(out)


def check_span(rows: Any) -> Any:
    """Return rows (x, …); refuse x (m) that decreases, or does not change; one x may stand in two of them: a jump."""
    if isinstance(rows, float):
        return rows
    x = [row[0] for row in rows]
    if len(rows) < 2 or x[0] == x[-1]:
        raise problem("", None, "must have at least two rows at different x")
    for i, (before, after) in enumerate(pairwise(x), start=2):
        if after < before:
            raise problem("", None, f"the first column must not decrease; row {i}: {after:g} < {before:g}")
    return rows


def increasing(values: tuple[float, ...]) -> tuple[float, ...]:
    """Return numbers that increase strictly; refuse others, and none."""
    if not values or any(b <= a for a, b in pairwise(values)):
        raise problem("", None, "must be numbers that increase")
    return values


def check_start(rows: Any) -> Any:
    """Return a profile; refuse one that is a taper which does not start at x = 0."""
    if isinstance(rows, tuple) and rows[0][0] != 0.0:
        raise problem("", None, f"the taper must start at x = 0, not at {rows[0][0]:g}")
    return rows


#: Rows nearer than this part of the last x are a step: with a ramp so short no answer differs by more.
STEEP = 1e-6


def check_steps(rows: Any) -> Any:
    """Return a profile with steps in the place of ramps that no mesh has nodes for."""
    if isinstance(rows, float):
        return rows
    out = [rows[0]]
    for x, value in rows[1:]:
        steep = x - out[-1][0] <= STEEP * rows[-1][0]
        if steep and len(out) > 1:
            out[-1] = (x, out[-1][1])
        out.append((out[0][0] if steep and len(out) == 1 else x, value))
    return tuple(out)


#: A number, or rows of x and numbers in any order, in the scene or in a file.
Span = Annotated[
    Annotated[T, Tag("<one>")] | Annotated[tuple[tuple[Number, T], ...], Tag("<rows>")], BY_SHAPE, FROM_FILE
]
#: A number, or a taper ((x, value), …), x (m) strictly increasing.
Tapered = Annotated[Span[T], AfterValidator(check_increasing)]
#: A number, or a taper from x = 0, in which two rows of one x are a step.
Profile = Annotated[Span[T], AfterValidator(check_span), AfterValidator(check_start), AfterValidator(check_steps)]
#: Rows (t, value), t (s) increasing.
TimeTable = Annotated[tuple[tuple[Number, Number], ...], FROM_FILE, AfterValidator(check_times)]


def is_positive(matrix: Array, definite: bool = True) -> bool:
    """Return whether a symmetric matrix, with ones on its diagonal, is positive (semi)definite."""
    diagonal = np.diag(matrix)
    if not np.all(np.isfinite(matrix)) or np.any(diagonal <= 0.0 if definite else diagonal < 0.0):
        return False
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, np.max(diagonal) or 1.0))
    least = float(np.linalg.eigvalsh(0.5 * (matrix + matrix.T) * np.outer(scale, scale))[0])
    return least > 1e-12 if definite else least >= -ROUND_OFF


def symmetric(size: int, definite: bool) -> AfterValidator:
    """Return what refuses matrices that are not symmetric, to round-off, and positive (semi)definite."""

    def fits(rows: Any) -> bool:
        if [len(row) for row in rows] != [size] * size:
            return False
        matrix = np.array(rows)
        even = np.allclose(matrix, matrix.T, rtol=0.0, atol=ROUND_OFF * np.max(np.abs(matrix)))
        return even and is_positive(matrix, definite)

    def check(value: Any) -> Any:
        table = is_table(value) and isinstance(value[0][1], tuple)
        for x, rows in value if table else [(None, value)]:
            if not fits(rows):
                kind = f"a symmetric {size}×{size} matrix, positive {'definite' if definite else 'semidefinite'}"
                raise problem("", None, f"{'' if x is None else f'at x = {x:g} it '}must be {kind}")
        return value

    return AfterValidator(check)


#: Rows and columns of the entries of the upper triangle of a 6×6 matrix, row by row, in names.
UPPER = tuple(f"{i}{j}" for i in range(1, 7) for j in range(i, 7))


def symmetric_matrices(upper: npt.ArrayLike) -> Array:
    """Return symmetric matrices (…, 6, 6) of their upper triangles (…, 21), row by row."""
    entries = np.asarray(upper, dtype=np.float64)
    i, j = np.triu_indices(6)
    M = np.zeros((*entries.shape[:-1], 6, 6))
    M[..., i, j] = M[..., j, i] = entries
    return M


def is_table(value: object) -> bool:
    """Return whether a value is a table over the span, not one number, point or matrix for all of it."""
    first = value[0] if isinstance(value, list | tuple) and value else None
    return isinstance(first, list | tuple) and len(first) == 2


def evaluate(value: Any, x: npt.ArrayLike) -> Array:
    """Return a number, point or matrix, or a table of them, at x (m): (…, *shape of the value)."""
    positions = np.asarray(x, dtype=np.float64)
    if not is_table(value):
        entry = np.asarray(value, dtype=np.float64)
        return np.broadcast_to(entry, (*positions.shape, *entry.shape)).copy()
    knots = np.array([row[0] for row in value])
    entries = np.array([row[1] for row in value], dtype=np.float64)
    columns = entries.reshape(len(knots), -1).T
    values = np.stack([np.interp(positions, knots, column) for column in columns], axis=-1)
    return np.asarray(values.reshape((*positions.shape, *entries.shape[1:])))


def check_on_span(key: str, x: float, length: float | None) -> None:
    """Refuse a place x (m) beside a structure of a length (m), but for round-off; none is where that is not known."""
    if length is not None and not -ROUND_OFF <= x / length <= 1 + ROUND_OFF:
        raise problem(key, x, f"must be from 0 to the length {length:g}")


def check_profile_length(key: str, profile: float | Matrix, length: float, slack: float = ROUND_OFF) -> None:
    """Refuse a taper that does not end at the length (m), to a relative slack."""
    if isinstance(profile, tuple) and not math.isclose(profile[-1][0], length, rel_tol=slack):
        reason = f"the taper must run from x = 0 to the length {length:.9g}; it ends at {profile[-1][0]:.9g}"
        raise problem(key, [list(row) for row in profile], reason)


# --- parameters of what is registered ---------------------------------------------------------------------------------


def parameters_of(entry: type) -> dict[str, dataclasses.Field[Any]]:
    """Return name ↦ field of the parameters of a registered class, which are keys of a table: those of a dataclass."""
    found = dataclasses.fields(entry) if dataclasses.is_dataclass(entry) else ()
    return {field.name: field for field in found if field.init}


class WithParameters(SceneModel):
    """A table of which one key names a registered class, whose parameters are keys as well."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Annotated[Number, unit("")]]

    #: The key, and where the classes are registered.
    CHOICE: ClassVar[str]
    ENTRIES: ClassVar[Registry[Any]]

    @classmethod
    def keys(cls) -> list[str]:
        """Return the keys of the table and the parameters of all classes."""
        return list(dict.fromkeys([*super().keys(), *(key for entry in cls.ENTRIES for key in parameters_of(entry))]))

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters by name, those that are not given with their defaults."""
        return dict(self.__pydantic_extra__)

    @classmethod
    def _read(cls, data: Mapping[str, Any], info: ValidationInfo) -> Mapping[str, Any]:
        """Add the parameters that are not given; a slip in the name of the class comes before all others."""
        key, defaults = cls.CHOICE, dict[str, Any]()
        name = as_name(data.get(key), cls.ENTRIES, key)
        for parameter, field in parameters_of(cls.ENTRIES[name]).items():
            if field.default is not dataclasses.MISSING:
                defaults[parameter] = field.default
            elif parameter not in data:
                raise problem(parameter, None, f'required key is missing; {key} = "{name}" needs it')
        return {**defaults, **data}

    def _check(self) -> None:
        """Refuse parameters that the class does not have, or not allow."""
        entry = self.ENTRIES[getattr(self, self.CHOICE)]
        for name, value in self.parameters.items():
            if name not in parameters_of(entry):
                raise problem(name, value, f'has no meaning with {self.CHOICE} = "{entry.name}"')
        for name, allowed in entry.check(self.parameters).items():
            raise problem(name, self.parameters[name], allowed)
