"""A table of the scene: its keys, alternatives among them, units, and one translator of pydantic's errors into ours."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    PlainValidator,
    ValidationError,
    ValidationInfo,
    model_validator,
)
from pydantic_core import PydanticCustomError

from rotfem.errors import Fault, SceneError, show
from rotfem.registry import Registry
from rotfem.short import short
from rotfem.units import is_quantity, quantity


def problem(key: str, value: Any, allowed: str) -> PydanticCustomError:
    """Return a validation error that names a key."""
    return PydanticCustomError("scene", "{reason}", {"reason": allowed, "key": key, "value": value})


@contextmanager
def problems_at(key: str, value: Any) -> Iterator[None]:
    """Let a problem raised inside that names no key name one and its value."""
    try:
        yield
    except PydanticCustomError as error:
        if (error.context or {}).get("key"):
            raise
        raise problem(key, value, error.message()) from None
    except ValidationError as error:
        raise problem(key, value, scene_error("", error).allowed) from None


def did_you_mean(name: object, names: Iterable[str]) -> str:
    """Return 'did you mean "x"? ' for the name closest to `name`, or an empty string if none is close."""
    import difflib  # only where something is wrong

    matches = difflib.get_close_matches(str(name), list(names), n=1)
    return f'did you mean "{matches[0]}"? ' if matches else ""


def unknown_key(key: object, names: Collection[str]) -> str:
    """Return what is allowed in the place of a key that a table does not have."""
    return f"unknown key; {did_you_mean(key, names)}allowed: {', '.join(names)}"


def as_name(value: Any, registry: Registry[Any], key: str = "") -> str:
    """Return the value; raise a problem at `key` if it is not the name of an entry."""
    names = registry.names
    if isinstance(value, str) and value in names:
        return value
    raise problem(key, value, f"{did_you_mean(value, names)}allowed: {', '.join(map(show, names))}")


def as_names(value: Any, names: Sequence[str], kind: str, others: str = "") -> tuple[str, ...]:
    """Return a list of names as a tuple; raise if one is not among `names`, or is listed twice."""
    allowed = f"allowed: {others}a list of {', '.join(names)}" if names else "none are registered"
    if not isinstance(value, list | tuple):
        raise problem("", value, allowed)
    for name in value:
        if name not in names:
            raise problem("", value, f"{show(name)} is not {kind}; {did_you_mean(name, names)}{allowed}")
    return tuple(value)


# --- units ------------------------------------------------------------------------------------------------------------


def in_units(value: Any, units: Sequence[str], over: Sequence[str] = ()) -> Any:
    """Return a value with numbers in the place of texts such as "12.1 rpm"; other texts stay."""
    if isinstance(value, Mapping):
        return {key: in_units(entry, units, over) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        if any(isinstance(entry, list | tuple) for entry in value):
            return [in_units(row, (*over, *units)) for row in value]
        if not any(isinstance(entry, str) for entry in value):
            return value
        return [in_units(entry, units[min(i, len(units) - 1) :]) for i, entry in enumerate(value)]
    if not isinstance(value, str) or not is_quantity(value):
        return value
    try:
        return quantity(value, units[0])
    except ValueError as error:
        raise problem("", value, str(error)) from None


def unit(*units: str, over: tuple[str, ...] = ()) -> BeforeValidator:
    """Return what reads texts with units before a key is validated, as an annotation of its type (see `in_units`)."""
    return BeforeValidator(partial(in_units, units=units, over=over))


def along(name: str) -> BeforeValidator:
    """Return the unit of what varies over the span: tables have x (m) in their first column."""
    return unit(name, over=("m",))


#: An annotation of the type of a list: one entry may stand for it.
LISTED = BeforeValidator(lambda value: value if isinstance(value, list | tuple) else [value])


# --- tables -----------------------------------------------------------------------------------------------------------

_TABLE = "must be a table of key = value pairs"


class SceneModel(BaseModel):
    """A table of the scene: immutable, and unknown or missing keys are errors that say what is allowed."""

    model_config = ConfigDict(defer_build=True, extra="forbid", frozen=True)

    def __init__(self, **data: Any) -> None:
        """Make a table in a script; values may be texts with units, as in a scene."""
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise scene_error(type(self).__name__, error) from None

    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]  # tables in tables are validated with theirs

    def __setattr__(self, name: str, value: Any) -> None:
        if not name.startswith("_"):
            why = "cannot be set, as scenes are never changed; scene.replace({key: value}) returns a variant"
            raise SceneError(type(self).__name__, name, None, why)
        super().__setattr__(name, value)

    def __repr__(self) -> str:
        given = {name: getattr(self, name) for name in type(self).model_fields if name in self.model_fields_set}
        return short(type(self).__name__, given)

    def __str__(self) -> str:
        return repr(self)

    @classmethod
    def keys(cls) -> list[str]:
        """Return all keys that the table may have."""
        return list(cls.model_fields)

    @classmethod
    def _table(cls, data: Any) -> Any:
        """Return the table that a value stands for, which may be written without it."""
        return data

    @classmethod
    def _read(cls, data: Mapping[str, Any], info: ValidationInfo) -> Mapping[str, Any]:
        """Return a table as it is given with what other keys say in addition, before its keys are checked."""
        return data

    def _check(self) -> None:
        """Raise a problem where keys do not go together."""

    @model_validator(mode="before")
    @classmethod
    def _read_keys(cls, data: Any, info: ValidationInfo) -> Any:
        if isinstance(data, cls):
            return data
        data = cls._table(data)
        if not isinstance(data, Mapping):
            raise problem("", data, _TABLE)
        data, names = cls._read(data, info), cls.keys()
        for key in data:
            if key not in names:
                raise problem(str(key), None, unknown_key(key, names))
        return data

    @model_validator(mode="after")
    def _check_keys(self) -> Self:
        self._check()
        return self


def empty() -> Any:
    """Return the default of a table whose keys all have defaults."""
    return Field(default_factory=dict, validate_default=True)


def one_of(tables: Mapping[str, type[SceneModel]], other: type[SceneModel] | None = None) -> PlainValidator:
    """Return what reads a table of the type that its key `type` names, or `other`; it makes no other validators."""

    def read(value: Any, info: ValidationInfo) -> Any:
        if isinstance(value, SceneModel):
            return value
        if not isinstance(value, Mapping):
            raise problem("", value, _TABLE)
        kind = value.get("type")
        table = tables.get(kind, other) if isinstance(kind, str) else other
        if table is None:
            missing = "required key is missing; " if kind is None else did_you_mean(kind, tables)
            raise problem("type", kind, f"{missing}allowed: {', '.join(map(show, tables))}")
        return table.model_validate(value, context=info.context)

    return PlainValidator(read)


#: Annotations of types that lists and other values have: those tagged "<rows>" and "<one>".
BY_SHAPE = Discriminator(lambda value: "<rows>" if isinstance(value, list | tuple) else "<one>")


@dataclass(frozen=True)
class Way:
    """A complete set of keys, of which a table must hold exactly one, and the value of the key `shape` in it."""

    name: str
    required: tuple[str, ...]
    optional: tuple[str, ...] = ()
    shape: str | None = None

    def __str__(self) -> str:
        keys = ", ".join(f'shape = "{self.shape}"' if key == "shape" else key for key in self.required)
        return f"{keys} (optional: {', '.join(self.optional)})" if self.optional else keys


def choose_way(given: dict[str, object], ways: Sequence[Way]) -> Way:
    """Return the way that the given keys make up; refuse other keys."""
    for way in ways:
        complete = {*way.required} <= given.keys() <= {*way.required, *way.optional}
        if complete and way.shape in (None, given.get("shape")):
            return way
    possible = "".join(f"\n    ({i}) {way}" for i, way in enumerate(ways, start=1))
    why = f"{', '.join(given) or 'nothing'} is not a complete set of keys; give exactly one of{possible}"
    raise problem("", None, why)


# --- errors -----------------------------------------------------------------------------------------------------------


#: What pydantic says ↦ our words.
_WORDS = {
    "Field required": "required key is missing",
    "Input should": "must",
    "Tuple should": "must",
    "a valid tuple": "a list",
    "a valid dictionary": "a table",
    "a valid number": "a number",
    "a valid integer": "an integer",
    "a valid boolean": "true or false",
    "greater than or equal to": "at least",
    "less than or equal to": "at most",
}


def scene_error(file: str, error: ValidationError) -> SceneError:
    """Return the problems found by validation as one error."""
    found = [_problem(dict(details)) for details in error.errors(include_url=False)]
    first, *others = {(each.key, each.allowed): each for each in found}.values()  # once where two entries are missing
    return SceneError(file, *first, others)


def _problem(details: dict[str, Any]) -> Fault:
    """Return a problem in our words: path of the key without the tags of types, value, what is allowed."""
    path = [part for part in map(str, details["loc"]) if not part.startswith("<")]
    context, value, kind = details.get("ctx", {}), details["input"], details["type"]
    if kind == "scene":
        if context["key"]:
            path.append(context["key"])
        value = context["value"] if context["key"] or context["value"] is not None else value
        reason = context["reason"]
    elif kind == "missing" and isinstance(details["loc"][-1], int):
        path, reason = path[:-1], f"must have more entries than {len(value)}"
    else:
        reason = details["msg"]
        for theirs, ours in _WORDS.items():
            reason = reason.replace(theirs, ours)
    if isinstance(value, Mapping):
        value = None  # a whole table says nothing that its key does not
    return Fault(".".join(path), value, reason)
