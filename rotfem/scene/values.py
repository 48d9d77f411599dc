"""Numbers, vectors, tapers and matrices as a scene may hold them, and how much of them it may ask for.

Booleans and strings are not numbers here, and nothing infinite or undefined gets past this module. Sequences
become tuples, so that a validated scene cannot be changed by accident.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from itertools import pairwise
from typing import Annotated, Any, ClassVar, TypeAlias

import numpy as np
import numpy.typing as npt
from pydantic import ConfigDict, PlainValidator, ValidationError, ValidationInfo
from pydantic_core import PydanticCustomError

from rotfem.errors import show
from rotfem.places import ONE
from rotfem.registry import Registry
from rotfem.scene.table import SceneModel, Unit, as_name, problem, problems_at

Array: TypeAlias = npt.NDArray[np.float64]
Vector3: TypeAlias = tuple[float, float, float]
Matrix: TypeAlias = tuple[tuple[float, ...], ...]
Taper: TypeAlias = tuple[tuple[float, float], ...]
Profile: TypeAlias = float | Taper

#: Sizes that a number of a scene may have, if it is not 0: its third power is a double, as those of thicknesses are.
SMALLEST, LARGEST = 1e-100, 1e100

#: The same of a stiffness or a mass made of them: its square is a double, as elements multiply two of them.
SMALLEST_PROPERTY, LARGEST_PROPERTY = 1e-140, 1e140

#: Part by which two numbers of a scene that mean the same may differ, and two of another program's file.
ROUND_OFF, DIGITS = 1e-9, 1e-6

#: Properties of a section without which it moves all the same.
MAY_BE_ZERO = ("rotary_inertia", "rotary_inertia2", "rotary_inertia3")


def check_magnitudes(values: Callable[[], Mapping[str, Array]], key: str) -> None:
    """Refuse at a key what a section makes of good numbers: infinite, undefined, or nothing at all."""
    with np.errstate(all="ignore"):
        try:
            found = values()
        except (OverflowError, ZeroDivisionError):
            raise problem(key, None, "its numbers cannot be multiplied: too large or too small") from None
    for name, value in found.items():
        size = np.abs(value)
        good = (size == 0.0) | ((size >= SMALLEST_PROPERTY) & (size <= LARGEST_PROPERTY))
        if np.all(good & (size > 0.0) if name not in MAY_BE_ZERO else good):
            continue
        worst = float(np.ravel(value)[np.argmin(good & (size > 0.0))])
        allowed = f"must be from {SMALLEST_PROPERTY:g} to {LARGEST_PROPERTY:g} in size"
        raise problem(key, None, f"its {name} comes out as {worst:g}; {allowed}")


# --- numbers ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Bounds:
    """An interval of numbers; None means unbounded. The methods read values and raise if they lie outside."""

    gt: float | None = None
    ge: float | None = None
    lt: float | None = None
    le: float | None = None

    def contains(self, number: float) -> bool:
        """Return whether the number lies in the interval."""
        return (
            (self.gt is None or number > self.gt)
            and (self.ge is None or number >= self.ge)
            and (self.lt is None or number < self.lt)
            and (self.le is None or number <= self.le)
        )

    def __str__(self) -> str:
        words = {"greater than": self.gt, "at least": self.ge, "less than": self.lt, "at most": self.le}
        return " and ".join(f"{word} {bound:g}" for word, bound in words.items() if bound is not None)

    def number(self, value: Any) -> float:
        """Return the value as a float; raise if it is not a finite number in the interval."""
        number = as_number(value)
        if not self.contains(number):
            raise problem("", value, f"must be {self}")
        return number

    def integer(self, value: Any) -> int:
        """Return the value; raise if it is not an integer in the interval, or one too long for a count."""
        if type(value) is not int or abs(value) > 2**31 or not self.contains(value):
            raise problem("", value, f"must be an integer {self}")
        return value

    def profile(self, value: Any, anywhere: bool = False) -> Profile:
        """Return a number or a taper ((x, value), …) with x from 0, or anywhere, upwards; raise on anything else."""
        if not isinstance(value, list | tuple):
            if not isinstance(value, int | float) or isinstance(value, bool):
                raise problem("", value, f"must be {f'a number {self}'.rstrip()}, or a taper [[x, value], …]")
            return self.number(value)
        shape = "a taper [[x, value], …]"
        rows = as_rows(value, (2,), shape)
        check_increasing(rows, value, shape)
        taper = tuple((x, number) for x, number in rows)
        if taper[0][0] != 0.0 and not anywhere:
            raise problem("", value, f"the taper must start at x = 0, not at {taper[0][0]:g}")
        for x, number in taper:
            if not self.contains(number):
                raise problem("", value, f"the value {number:g} at x = {x:g} must be {self}")
        return taper


def as_number(value: Any) -> float:
    """Return the value as a float; raise if it is not a finite number (booleans and strings are not)."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise problem("", value, "must be a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise problem("", value, "must be a finite number")
    if number != 0.0 and not SMALLEST <= abs(number) <= LARGEST:
        raise problem("", value, f"must be from {SMALLEST:g} to {LARGEST:g} in size")
    return number


def such(read: Callable[[Any], Any], holds: Callable[[Any], Any], allowed: str) -> PlainValidator:
    """Return the validator of what `read` makes of a value; `allowed` says what must hold of it."""

    def validated(value: Any) -> Any:
        read_value = read(value)
        if not holds(read_value):
            raise problem("", value, allowed)
        return read_value

    return PlainValidator(validated)


def as_list(
    value: Any, read: Callable[[Any], Any], shape: str, sizes: Container[int] = range(2**31)
) -> tuple[Any, ...]:
    """Return a list with its entries read; raise if it is none, or has not an allowed number of entries."""
    if not isinstance(value, list | tuple) or len(value) not in sizes:
        raise problem("", value, f"must be {shape}")
    with problems_at("", value, f"must be {shape}; an entry "):
        return tuple(map(read, value))


def as_vector(value: Any, sizes: Sequence[int]) -> tuple[float, ...]:
    """Return a vector as a tuple of floats; raise if it has not one of the allowed sizes."""
    return as_list(value, as_number, f"a list of {' or '.join(map(str, sizes))} numbers", sizes)


def as_vector3(value: Any) -> Vector3:
    """Return a vector of three components; raise on any other size."""
    a, b, c = as_vector(value, (3,))
    return a, b, c


def as_padded_vector3(value: Any) -> Vector3:
    """Return a vector of three components, the third zero if only two are given; raise on any other size."""
    a, b, c = (*as_vector(value, (2, 3)), 0.0)[:3]
    return a, b, c


# --- rows, tapers and matrices ----------------------------------------------------------------------------------------


def as_rows(value: Any, columns: Sequence[int], shape: str, row_name: Callable[[int], str] = "row {}".format) -> Matrix:
    """Return a rectangular table of numbers as a tuple of rows; on anything else raise, naming the shape expected."""
    if not isinstance(value, list | tuple) or not value or not all(isinstance(row, list | tuple) for row in value):
        raise problem("", value, f"must be {shape}")
    if len(value[0]) not in columns:
        raise problem("", value, f"must be {shape}; {row_name(1)} has {len(value[0])} entries")
    for i, row in enumerate(value, start=1):
        if len(row) != len(value[0]):
            reason = f"{row_name(i)} has {len(row)} entries, {row_name(1)} has {len(value[0])}"
            raise problem("", value, f"must be {shape}; {reason}")
        with problems_at("", value, f"must be {shape}; an entry of {row_name(i)} "):
            for entry in row:
                as_number(entry)
    return tuple(tuple(float(entry) for entry in row) for row in value)


def check_increasing(rows: Matrix, value: Any, shape: str, row_name: Callable[[int], str] = "row {}".format) -> None:
    """Refuse fewer than two rows, and a first column that does not increase strictly."""
    if len(rows) < 2:
        raise problem("", value, f"must be {shape} with at least two rows")
    for i, (before, after) in enumerate(pairwise(row[0] for row in rows), start=2):
        if after <= before:
            reason = f"{row_name(i)}: {after:g} ≤ {before:g}"
            raise problem("", value, f"the first column must increase strictly; {reason}")


def is_positive(matrix: Array, definite: bool = True, slack: float = ROUND_OFF) -> bool:
    """Return whether a symmetric matrix is positive definite, or semidefinite to a slack, as mass without inertias is.

    It is judged with ones on its diagonal, as its entries have different units and sizes: otherwise a soft direction
    would pass for round-off, or the reverse.
    """
    diagonal = np.diag(matrix)
    if not np.all(np.isfinite(matrix)) or np.any(diagonal <= 0.0 if definite else diagonal < 0.0):
        return False
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, np.max(diagonal) or 1.0))
    least = float(np.linalg.eigvalsh(0.5 * (matrix + matrix.T) * np.outer(scale, scale))[0])
    return least > 1e-12 if definite else least >= -slack


def as_symmetric_matrix(value: Any, size: int, *, definite: bool) -> Matrix:
    """Return a symmetric matrix as a tuple of rows.

    Raise on another size, a lack of symmetry of 1e-9 of the largest entry, or one that is not positive (semi)definite.
    """
    shape = f"a symmetric {size}×{size} matrix"
    rows = as_rows(value, (size,), shape)
    if len(rows) != size:
        raise problem("", value, f"must be {shape}; it has {len(rows)} rows")
    matrix = np.array(rows)
    if not np.allclose(matrix, matrix.T, rtol=0.0, atol=ROUND_OFF * np.max(np.abs(matrix))):
        raise problem("", value, f"must be {shape}; it is not symmetric")
    if not is_positive(matrix, definite):
        raise problem("", value, f"must be {shape}, positive {'definite' if definite else 'semidefinite'}")
    return rows


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
    """Return whether a validated value is a table over the span, not one number, point or matrix for all of it."""
    return isinstance(value, tuple) and isinstance(value[0], tuple) and len(value[0]) == 2


def evaluate(value: Any, x: npt.ArrayLike) -> Array:
    """Return a number, point or matrix, or a table of them over the span, at positions x (m), any shape (…).

    Tables are linear between their rows, entry by entry. The shape is (…, *shape of the value).
    """
    positions = np.asarray(x, dtype=np.float64)
    if not is_table(value):
        entry = np.asarray(value, dtype=np.float64)
        return np.broadcast_to(entry, (*positions.shape, *entry.shape)).copy()
    knots = np.array([row[0] for row in value])
    entries = np.array([row[1] for row in value], dtype=np.float64)
    columns = entries.reshape(len(knots), -1).T
    values = np.stack([np.interp(positions, knots, column) for column in columns], axis=-1)
    return np.asarray(values.reshape((*positions.shape, *entries.shape[1:])))


def on_span(x: float, length: float | None) -> bool:
    """Return whether x (m) is from 0 to the length of a structure, but for round-off; True if that is not known."""
    return length is None or -ROUND_OFF <= x / length <= 1 + ROUND_OFF


def check_profile_length(key: str, profile: Profile, length: float, slack: float = ROUND_OFF) -> None:
    """Refuse a taper that does not end at the length (m), to a relative slack, or has two rows in one place."""
    if not isinstance(profile, tuple):
        return
    places = [row[0] for row in profile]
    if not math.isclose(places[-1], length, rel_tol=slack):
        reason = f"the taper must run from x = 0 to the length {length:.9g}; it ends at {places[-1]:.9g}"
        raise problem(key, [list(row) for row in profile], reason)
    apart = ((after - before, after) for before, after in pairwise(places) if after > before)  # equal is a kink
    closest, x = min(apart, default=(length, length))
    if closest <= ONE * length:
        least = f"more than {ONE * length:.2g} m, 1e-7 of the length"
        raise problem(key, x, f"is {closest:.2g} m beyond the row before; rows of a jump must be apart by {least}")


Number = Annotated[float, PlainValidator(as_number)]
Positive = Annotated[float, PlainValidator(Bounds(gt=0.0).number)]
NonNegative = Annotated[float, PlainValidator(Bounds(ge=0.0).number)]
PoissonRatio = Annotated[float, PlainValidator(Bounds(gt=-1.0, lt=0.5).number)]
ShearCorrection = Annotated[float, PlainValidator(Bounds(gt=0.0, le=1.0).number)]
Count = Annotated[int, PlainValidator(Bounds(ge=1).integer)]
Vector = Annotated[Vector3, PlainValidator(as_vector3)]
PaddedVector = Annotated[Vector3, PlainValidator(as_padded_vector3)]


# --- parameters of what is registered ---------------------------------------------------------------------------------


def parameters_of(entry: type) -> dict[str, Field[Any]]:
    """Return name ↦ field of the parameters of a registered class, which are keys of a table: those of a dataclass."""
    return {field.name: field for field in fields(entry) if field.init} if is_dataclass(entry) else {}


class WithParameters(SceneModel):
    """A table of which one key names a registered class, whose parameters are keys as well."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Annotated[Number, Unit("")]]

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
        if data.get(key) is None:
            raise problem(key, None, f"required key is missing; allowed: {', '.join(map(show, cls.ENTRIES.names))}")
        name = as_name(data[key], cls.ENTRIES, key)
        for parameter, field in parameters_of(cls.ENTRIES[name]).items():
            if parameter in cls.model_fields:
                raise problem(key, name, f"cannot have a parameter {parameter}, which is a key of the table already")
            if field.default is not MISSING:
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


# --- how much may be asked for ----------------------------------------------------------------------------------------


class Limits(SceneModel):
    """The [limits] table. What lies above is taken for a slip and refused before it is computed.

    Attributes:
        steps: steps of a time history.
        rows: rows of a table.
        modes: modes at one speed.
        speeds: speeds of a Campbell diagram.
    """

    steps: Count = 10_000_000
    rows: Count = 2_000_000
    modes: Count = 1_000
    speeds: Count = 100_000

    def refusal(self, name: str, wanted: float) -> str | None:
        """Return why so many of what a limit is of are refused, with how to allow them; None where they are not."""
        most = getattr(self, name)
        if wanted <= most:
            return None
        return f"makes {wanted:.4g} {name}, more than limits.{name} = {most}; a larger one in [limits] allows them"

    def check(self, name: str, wanted: float, key: str = "", value: object = None) -> None:
        """Refuse more than a limit, at the key that asks for them and its value."""
        if (why := self.refusal(name, wanted)) is not None:
            raise problem(key, value, why)


def limits_of(tables: object) -> Limits:
    """Return the limits of a scene's tables; where those are wrong, which is reported elsewhere, the usual ones."""
    given = tables.get("limits") if isinstance(tables, dict) else None
    try:
        return Limits.model_validate({} if given is None else given)
    except (ValidationError, PydanticCustomError):
        return Limits()


def limits_in(info: ValidationInfo) -> Limits:
    """Return the limits of the scene being validated; the usual ones outside of a scene."""
    found = (info.context or {}).get("limits")
    return found if isinstance(found, Limits) else Limits()
