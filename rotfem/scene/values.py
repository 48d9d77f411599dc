"""Numbers, vectors, tapers and tables as a scene may hold them: what is accepted and how it is stored.

Booleans and strings are not numbers here, and nothing infinite or undefined gets past this module. Sequences
become tuples, so that a validated scene cannot be changed by accident.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, PlainValidator, model_validator
from pydantic_core import PydanticCustomError

from rotfem.errors import show
from rotfem.registry import Registry
from rotfem.scene.problems import InputErrors, did_you_mean

#: Sizes that a stiffness or a mass may have, if it is not 0; beyond them the products of the elements are none.
SMALLEST, LARGEST = 1e-140, 1e140

#: Properties of a section without which it moves all the same.
MAY_BE_ZERO = ("rotary_inertia", "rotary_inertia2", "rotary_inertia3")


def check_magnitudes(values: Callable[[], Mapping[str, Array]], key: str) -> None:
    """Refuse what a section makes of good numbers: infinite, undefined, or nothing at all.

    Args:
        values: returns the properties of the section by name, each of any shape.
        key: where the section is given.

    Raises:
        PydanticCustomError: names the property.
    """
    with np.errstate(all="ignore"):
        try:
            found = values()
        except (OverflowError, ZeroDivisionError):
            raise problem(key, None, "its numbers cannot be multiplied: too large or too small") from None
    for name, value in found.items():
        size = np.abs(value)
        good = (size == 0.0) | ((size >= SMALLEST) & (size <= LARGEST))
        if np.all(good & (size > 0.0) if name not in MAY_BE_ZERO else good):
            continue
        worst = float(np.ravel(value)[np.argmin(good & (size > 0.0))])
        reason = f"its {name} comes out as {worst:g}; must be from {SMALLEST:g} to {LARGEST:g} in size"
        raise problem(key, None, reason)


class Named(Protocol):
    """What a list may name, where that is more than one registry."""

    kind: str

    @property
    def names(self) -> tuple[str, ...]:
        """All names, in their order."""


def as_name(value: Any, registry: Registry[Any], key: str = "") -> str:
    """Return the value; raise a problem at `key` if it is not the name of an entry."""
    names = registry.names
    if isinstance(value, str) and value in names:
        return value
    raise problem(key, value, f"{did_you_mean(value, names)}allowed: {', '.join(map(show, names))}")


def as_names(value: Any, registry: Registry[Any] | Named, others: str = "") -> tuple[str, ...]:
    """Return the value as a tuple.

    Args:
        value: a list of names.
        registry: what they name: effects or outputs.
        others: what is allowed instead of a list, for the error message.

    Raises:
        PydanticCustomError: it is not a list, or has something in it that is not registered, or is there twice.
    """
    names = registry.names
    allowed = f"allowed: {others}a list of {', '.join(names)}" if names else "none are registered"
    if not isinstance(value, list | tuple):
        raise problem("", value, allowed)
    for name in value:
        if name not in names:
            hint = did_you_mean(name, names)
            raise problem("", value, f"{show(name)} is not an {registry.kind}; {hint}{allowed}")
        if list(value).count(name) > 1:
            raise problem("", value, f"{show(name)} is listed twice")
    return tuple(value)


Array: TypeAlias = npt.NDArray[np.float64]
Vector3: TypeAlias = tuple[float, float, float]
Matrix: TypeAlias = tuple[tuple[float, ...], ...]
Taper: TypeAlias = tuple[tuple[float, float], ...]
Profile: TypeAlias = float | Taper

#: Sizes that a number may have, if it is not 0: beyond them squares and products are none any more.
SMALLEST, LARGEST = 1e-100, 1e100


def problem(key: str, value: Any, allowed: str) -> PydanticCustomError:
    """Return a validation error that names a key.

    Args:
        key: dotted path relative to the table being validated; empty for the validated value itself.
        value: the offending value, None if the key is absent.
        allowed: what is wrong and what is allowed.
    """
    return PydanticCustomError("scene", "{reason}", {"reason": allowed, "key": key, "value": value})


class SceneModel(BaseModel, metaclass=InputErrors):
    """A table of the scene: immutable, and unknown or missing keys are errors that say what is allowed."""

    model_config = ConfigDict(defer_build=True, extra="forbid", frozen=True)

    @classmethod
    def keys(cls) -> list[str]:
        """Return all keys that the table may have."""
        return list(cls.model_fields)

    @model_validator(mode="before")
    @classmethod
    def _check_keys(cls, data: Any) -> Any:
        if isinstance(data, cls):
            return data
        if not isinstance(data, Mapping):
            raise problem("", data, "must be a table of key = value pairs")
        names = cls.keys()
        for key in data:
            if key not in names:
                hint = did_you_mean(key, names)
                raise problem(str(key), None, f"unknown key; {hint}allowed: {', '.join(names)}")
        for name, field in cls.model_fields.items():
            if field.is_required() and name not in data:
                raise problem(name, None, f"required key is missing; must be {field.description or 'given'}")
        return data


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
        """Return the value; raise if it is not an integer in the interval."""
        if not isinstance(value, int) or isinstance(value, bool):
            raise problem("", value, f"must be an integer {self}")
        # Before the bound check: an integer too long to print, or to become a float, is not a count of anything.
        if abs(value) > 2**31 or not self.contains(value):
            raise problem("", value, f"must be an integer {self}")
        return value

    def profile(self, value: Any) -> Profile:
        """Return a number or a taper ((x, value), …) with x from 0 upwards; raise on anything else."""
        if not isinstance(value, list | tuple):
            if not isinstance(value, int | float) or isinstance(value, bool):
                raise problem("", value, f"must be {f'a number {self}'.rstrip()}, or a taper [[x, value], …]")
            return self.number(value)
        taper = as_taper(value)
        if taper[0][0] != 0.0:
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


def as_rows(
    value: Any, columns: Sequence[int], shape: str, row_name: Callable[[int], str] = "row {}".format
) -> tuple[tuple[float, ...], ...]:
    """Return a rectangular table of numbers as a tuple of rows.

    Args:
        value: a sequence of rows.
        columns: allowed numbers of columns; all rows must have the same.
        shape: the expected form in words, for the error message.
        row_name: number of a row, from 1 ↦ what the error message calls it.

    Raises:
        PydanticCustomError: it is not such a table.
    """
    if not isinstance(value, list | tuple) or not value or not all(isinstance(row, list | tuple) for row in value):
        raise problem("", value, f"must be {shape}")
    if len(value[0]) not in columns:
        raise problem("", value, f"must be {shape}; {row_name(1)} has {len(value[0])} entries")
    if (quick := _quick_rows(value)) is not None:
        return quick
    for i, row in enumerate(value, start=1):
        if len(row) != len(value[0]):
            reason = f"{row_name(i)} has {len(row)} entries, {row_name(1)} has {len(value[0])}"
            raise problem("", value, f"must be {shape}; {reason}")
        for entry in row:
            try:
                as_number(entry)
            except PydanticCustomError as error:
                raise problem("", value, f"must be {shape}; an entry of {row_name(i)} {error.message()}") from None
    return tuple(tuple(float(entry) for entry in row) for row in value)


def as_increasing_rows(
    value: Any, columns: Sequence[int], shape: str, row_name: Callable[[int], str] = "row {}".format
) -> tuple[tuple[float, ...], ...]:
    """Return `as_rows`, at least two of them with a strictly increasing first column; raise on anything else."""
    rows = as_rows(value, columns, shape, row_name)
    if len(rows) < 2:
        raise problem("", value, f"must be {shape} with at least two rows")
    first = np.fromiter((row[0] for row in rows), dtype=np.float64, count=len(rows))
    bad = np.flatnonzero(first[1:] <= first[:-1])
    if len(bad):
        i = int(bad[0])
        reason = f"{row_name(i + 2)}: {first[i + 1]:g} ≤ {first[i]:g}"
        raise problem("", value, f"the first column must increase strictly; {reason}")
    return rows


def are_numbers(table: Array) -> bool:
    """Return whether all numbers are 0 or of a size that is allowed."""
    size = np.abs(table)
    return bool(np.all((size == 0.0) | ((size >= SMALLEST) & (size <= LARGEST))))


def rows_of(table: Array) -> Matrix:
    """Return the rows of an array (n, columns)."""
    rows: Any = table.tolist()
    return tuple(map(tuple, rows))


def _quick_rows(value: Sequence[Sequence[Any]]) -> Matrix | None:
    """Return a table of good numbers as a tuple of rows; None where every entry has to be checked."""
    if set(map(len, value)) != {len(value[0])} or not set(map(type, itertools.chain(*value))) <= {int, float}:
        return None
    try:
        table = np.array(value, dtype=np.float64)
    except OverflowError:
        return None
    return rows_of(table) if are_numbers(table) else None


def as_taper(value: Any) -> Taper:
    """Return a taper ((x, value), …) with x (m) strictly increasing; raise on anything else."""
    rows = as_increasing_rows(value, (2,), "a taper [[x, value], …]")
    return tuple((x, number) for x, number in rows)


def as_vector(value: Any, sizes: Sequence[int]) -> tuple[float, ...]:
    """Return a vector as a tuple of floats; raise if it has not one of the allowed sizes."""
    wanted = " or ".join(str(size) for size in sizes)
    if not isinstance(value, list | tuple) or len(value) not in sizes:
        raise problem("", value, f"must be a list of {wanted} numbers")
    for entry in value:
        try:
            as_number(entry)
        except PydanticCustomError as error:
            raise problem("", value, f"must be a list of {wanted} numbers; an entry {error.message()}") from None
    return tuple(float(entry) for entry in value)


def as_vector3(value: Any) -> Vector3:
    """Return a vector of three components; raise on any other size."""
    a, b, c = as_vector(value, (3,))
    return a, b, c


def as_padded_vector3(value: Any) -> Vector3:
    """Return a vector of three components, the third zero if only two are given; raise on any other size."""
    a, b, c = (*as_vector(value, (2, 3)), 0.0)[:3]
    return a, b, c


def as_symmetric_matrix(value: Any, size: int, *, definite: bool) -> Matrix:
    """Return a symmetric matrix as a tuple of rows.

    Args:
        value: a sequence of rows.
        size: number of rows and columns.
        definite: whether it must be positive definite; positive semidefinite otherwise.

    Raises:
        PydanticCustomError: the size, the symmetry (to 1e-9 of the largest entry) or the definiteness is wrong.
    """
    shape = f"a symmetric {size}×{size} matrix"
    rows = as_rows(value, (size,), shape)
    if len(rows) != size:
        raise problem("", value, f"must be {shape}; it has {len(rows)} rows")
    matrix = np.array(rows)
    scale = float(np.max(np.abs(matrix))) or 1.0
    if not np.allclose(matrix, matrix.T, rtol=0.0, atol=1e-9 * scale):
        raise problem("", value, f"must be {shape}; it is not symmetric")
    # Entries of one matrix differ in units and by many orders of magnitude, so definiteness is judged after
    # scaling to a unit diagonal; otherwise a soft direction would pass for a rounding error, or the reverse.
    diagonal = np.diag(matrix)
    if np.any(diagonal < 0.0) or (definite and np.any(diagonal == 0.0)):
        raise problem("", value, f"must be {shape}, positive {'definite' if definite else 'semidefinite'}")
    weights = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, scale))
    lowest = float(np.linalg.eigvalsh(0.5 * (matrix + matrix.T) * np.outer(weights, weights))[0])
    if lowest < -1e-9 or (definite and lowest <= 1e-12):
        raise problem("", value, f"must be {shape}, positive {'definite' if definite else 'semidefinite'}")
    return rows


def evaluate(profile: Profile, x: npt.ArrayLike) -> Array:
    """Return the profile at positions x (m), shape of x; linear between the knots of a taper."""
    positions = np.asarray(x, dtype=np.float64)
    if isinstance(profile, float | int):
        return np.full(positions.shape, float(profile))
    knots, values = np.array(profile).T
    return np.asarray(np.interp(positions, knots, values), dtype=np.float64)


def check_profile_length(key: str, profile: Profile, length: float, slack: float = 1e-9) -> None:
    """Refuse a taper that does not end at the length (m), to a relative slack; the problem is at `key`."""
    if isinstance(profile, tuple) and not math.isclose(profile[-1][0], length, rel_tol=slack):
        reason = f"the taper must run from x = 0 to the length {length:.9g}; it ends at {profile[-1][0]:.9g}"
        raise problem(key, [list(row) for row in profile], reason)


Number = Annotated[float, PlainValidator(as_number)]
Positive = Annotated[float, PlainValidator(Bounds(gt=0.0).number)]
NonNegative = Annotated[float, PlainValidator(Bounds(ge=0.0).number)]
PoissonRatio = Annotated[float, PlainValidator(Bounds(gt=-1.0, lt=0.5).number)]
ShearCorrection = Annotated[float, PlainValidator(Bounds(gt=0.0, le=1.0).number)]
Count = Annotated[int, PlainValidator(Bounds(ge=1).integer)]
PositiveProfile = Annotated[Profile, PlainValidator(Bounds(gt=0.0).profile)]
NonNegativeProfile = Annotated[Profile, PlainValidator(Bounds(ge=0.0).profile)]
AnyProfile = Annotated[Profile, PlainValidator(Bounds().profile)]
Vector = Annotated[Vector3, PlainValidator(as_vector3)]
PaddedVector = Annotated[Vector3, PlainValidator(as_padded_vector3)]
