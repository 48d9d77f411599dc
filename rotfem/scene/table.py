"""A table of the scene: its keys, alternatives among them, and from the errors of validation to one readable error."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from inspect import Parameter, Signature
from typing import TYPE_CHECKING, Any, Self, get_args, get_type_hints

from pydantic import BaseModel, ConfigDict, GetCoreSchemaHandler, ValidationError, ValidationInfo, model_validator
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from rotfem.errors import Problem, SceneError, show
from rotfem.registry import Registry
from rotfem.short import short
from rotfem.units import is_quantity, quantity

if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass
else:
    ModelMetaclass = type(BaseModel)  # which has no public name

# Names that validation puts into the path of an error to say which kind of table it tried.
_TAGS = {
    "structure": {"planar_beam", "spatial_beam", "plate"},
    "motion": {"constant", "spin_up", "table", "torque", "callable", "law"},
    "mesh": {"beam", "plate"},
}


def problem(key: str, value: Any, allowed: str) -> PydanticCustomError:
    """Return a validation error that names a key.

    Args:
        key: dotted path relative to the table being validated; empty for the validated value itself.
        value: the offending value, None if the key is absent.
        allowed: what is wrong and what is allowed.
    """
    return PydanticCustomError("scene", "{reason}", {"reason": allowed, "key": key, "value": value})


@contextmanager
def problems_at(key: str, value: Any, before: str = "") -> Iterator[None]:
    """Let a problem raised inside that names no key name one and its value, with some words before what it says."""
    try:
        yield
    except PydanticCustomError as error:
        if (error.context or {}).get("key"):
            raise
        raise problem(key, value, f"{before}{error.message()}") from None


def did_you_mean(name: object, names: Iterable[str]) -> str:
    """Return 'did you mean "x"? ' for the name closest to `name`, or an empty string if none is close."""
    matches = difflib.get_close_matches(str(name), list(names), n=1)
    return f'did you mean "{matches[0]}"? ' if matches else ""


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
        if list(value).count(name) > 1:
            raise problem("", value, f"{show(name)} is listed twice")
    return tuple(value)


# --- units ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Unit:
    """The unit of a key, as an annotation of its type: texts such as "12.1 rpm" become numbers before it is validated.

    Attributes:
        unit: of all numbers, or one for each component of a vector or column of rows, the last one of all further ones.
            "" stands for that of SI.
        over: units of the columns of rows that are before these.
    """

    unit: str | tuple[str, ...]
    over: tuple[str, ...] = ()

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self.read, handler(source))

    def read(self, value: Any) -> Any:
        """Return a value with numbers in the place of texts with units; raise if one of these is not of the kind."""
        if isinstance(value, Mapping):
            return {key: self.read(entry) for key, entry in value.items()}
        if not _has_text(value) or (isinstance(value, str) and not is_quantity(value)):
            return value  # a text that is no number with a unit stays, for who wants a number
        units = (self.unit,) if isinstance(self.unit, str) else self.unit
        return _in_units(value, units, self.over)


def along(unit: str) -> Unit:
    """Return the unit of what varies over the span: tables have x (m) in their first column."""
    return Unit(unit, ("m",))


def has_unit(kind: Any) -> bool:
    """Return whether a type says a unit."""
    return isinstance(kind, Unit) or any(map(has_unit, get_args(kind)))


def _has_text(value: Any) -> bool:
    return any(map(_has_text, value)) if isinstance(value, list | tuple) else isinstance(value, str)


def _in_units(value: Any, units: tuple[str, ...], over: tuple[str, ...]) -> Any:
    """Return a number, a vector or rows."""
    if isinstance(value, list | tuple):
        if any(isinstance(entry, list | tuple) for entry in value):
            return [_in_units(row, (*over, *units), ()) for row in value]
        return [_in_units(entry, units[min(i, len(units) - 1) :], ()) for i, entry in enumerate(value)]
    if not isinstance(value, str):
        return value
    try:
        return quantity(value, units[0])
    except ValueError as error:
        raise problem("", value, str(error)) from None


# --- tables -----------------------------------------------------------------------------------------------------------


class InputErrors(ModelMetaclass):
    """The metaclass of tables: what a script makes of wrong values is an `InputError`, as in a scene."""

    def __call__(cls, *args: Any, **kwargs: Any) -> Any:
        """Return the table; values may be texts with units, as in a scene.

        Raises:
            SceneError: it is not valid; the name of the class stands for that of the file.
        """
        try:
            return super().__call__(*args, **kwargs)
        except ValidationError as error:
            raise scene_error(cls.__name__, error) from None

    @property
    def __signature__(cls) -> Signature:
        """Signature of the class: the keys of the table, with the types that a script may give."""
        parameters, kinds, whole = [], get_type_hints(cls), get_type_hints(cls, include_extras=True)
        for name, field in cls.model_fields.items():
            kind = kinds[name] | str if has_unit(whole[name]) else kinds[name]
            default = Parameter.empty if field.is_required() else field.get_default(call_default_factory=True)
            parameters.append(Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=kind))
        return Signature(parameters)

    @__signature__.setter
    def __signature__(cls, _: Any) -> None:
        """Keep it from pydantic, whose own has validators in the place of types."""


class SceneModel(BaseModel, metaclass=InputErrors):
    """A table of the scene: immutable, and unknown or missing keys are errors that say what is allowed."""

    model_config = ConfigDict(defer_build=True, extra="forbid", frozen=True)

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
            raise problem("", data, "must be a table of key = value pairs")
        data, names = cls._read(data, info), cls.keys()
        for key in data:
            if key not in names:
                hint = did_you_mean(key, names)
                raise problem(str(key), None, f"unknown key; {hint}allowed: {', '.join(names)}")
        for name, field in cls.model_fields.items():
            if field.is_required() and name not in data:
                raise problem(name, None, f"required key is missing; must be {field.description or 'given'}")
        return data

    @model_validator(mode="after")
    def _check_keys(self) -> Self:
        self._check()
        return self


@dataclass(frozen=True)
class Way:
    """A complete set of keys, of which a table must hold exactly one.

    Attributes:
        name: what the set is called.
        required: keys that must be given.
        optional: keys that may be given.
        shape: value the key `shape` must have, if it is among the required ones.
    """

    name: str
    required: tuple[str, ...]
    optional: tuple[str, ...] = ()
    shape: str | None = None

    def __str__(self) -> str:
        keys = ", ".join(f'shape = "{self.shape}"' if key == "shape" else key for key in self.required)
        return f"{keys} (optional: {', '.join(self.optional)})" if self.optional else keys


def choose_way(given: dict[str, object], ways: Sequence[Way]) -> Way:
    """Return the way that the given keys make up; raise if none, saying what is missing or does not belong."""
    keys = set(given)

    def misfit(way: Way) -> tuple[bool, int]:
        wrong_shape = "shape" in keys and way.shape != given["shape"]
        return wrong_shape, len(set(way.required) - keys) + len(keys - {*way.required, *way.optional})

    nearest = min(ways, key=misfit)
    if misfit(nearest) == (False, 0):
        return nearest
    parts = [] if given else ["none is given"]
    if given and (missing := [key for key in nearest.required if key not in keys]):
        parts.append(f"missing {', '.join(missing)}")
    if foreign := [key for key in given if key not in {*nearest.required, *nearest.optional}]:
        parts.append(f"{', '.join(foreign)} cannot be combined with the rest")
    possible = "".join(f"\n    ({i}) {way}" for i, way in enumerate(ways, start=1))
    raise problem("", None, f"not a complete set of keys: {'; '.join(parts)}; give exactly one of{possible}")


# --- errors -----------------------------------------------------------------------------------------------------------


def scene_error(file: str, error: ValidationError) -> SceneError:
    """Return the problems found by validation as one error."""
    first, *others = [_problem(dict(details)) for details in error.errors(include_url=False)]
    return SceneError(file, *first, others)


#: Types of pydantic's errors ↦ what is allowed.
_ALLOWED = {
    **dict.fromkeys(("model_type", "model_attributes_type", "dict_type"), "must be a table of key = value pairs"),
    "tuple_type": "must be a list of tables",
    "bool_type": "must be true or false",
}


def _problem(details: dict[str, Any]) -> Problem:
    path = list(details["loc"])
    if len(path) > 1 and path[1] in _TAGS.get(str(path[0]), ()):
        del path[1]
    context: dict[str, Any] = details.get("ctx", {})
    value, kind = details["input"], details["type"]
    if kind == "scene":
        if context["key"]:
            path.append(context["key"])
        value = context["value"] if context["key"] or context["value"] is None else value
        reason = context["reason"]
    elif kind in ("literal_error", "union_tag_invalid"):
        names = re.findall(r"'([^']*)'", context.get("expected") or context.get("expected_tags", ""))
        if kind == "union_tag_invalid":
            path.append("type")
            value = value.get("type") if isinstance(value, Mapping) else value
        reason = f"{did_you_mean(value, names)}allowed: {', '.join(show(name) for name in names)}"
    elif kind == "union_tag_not_found":
        path.append("type")
        value, reason = None, f"required key is missing; allowed: {', '.join(map(show, sorted(_TAGS[str(path[0])])))}"
    else:
        message = str(details["msg"])
        reason = _ALLOWED.get(kind, message[0].lower() + message[1:])
    if isinstance(value, Mapping):
        value = None  # a whole table says nothing that its key does not
    return Problem(".".join(str(part) for part in path), value, reason)
