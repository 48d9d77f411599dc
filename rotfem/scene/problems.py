"""From the errors of validation to one readable error."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ValidationError

from rotfem.errors import Problem, SceneError, show

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


def did_you_mean(name: object, names: Iterable[str]) -> str:
    """Return 'did you mean "x"? ' for the name closest to `name`, or an empty string if none is close."""
    matches = difflib.get_close_matches(str(name), list(names), n=1)
    return f'did you mean "{matches[0]}"? ' if matches else ""


class InputErrors(ModelMetaclass):
    """The metaclass of tables: what a script makes of wrong values is an `InputError`, as in a scene."""

    def __call__(cls, *args: Any, **kwargs: Any) -> Any:
        """Return the table.

        Raises:
            SceneError: it is not valid; the name of the class stands for that of the file.
        """
        try:
            return super().__call__(*args, **kwargs)
        except ValidationError as error:
            raise scene_error(cls.__name__, error) from None


def scene_error(file: str, error: ValidationError) -> SceneError:
    """Return the problems found by validation as one error."""
    first, *others = [_problem(dict(details)) for details in error.errors(include_url=False)]
    return SceneError(file, *first, others)


def _problem(details: dict[str, Any]) -> Problem:
    path = list(details["loc"])
    if len(path) > 1 and path[1] in _TAGS.get(str(path[0]), ()):
        del path[1]
    context: dict[str, Any] = details.get("ctx", {})
    value, kind = details["input"], details["type"]
    if kind == "scene":
        if context["key"]:
            path.append(context["key"])
            value = context["value"]
        elif context["value"] is None:
            value = None
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
    elif kind in ("model_type", "model_attributes_type", "dict_type"):
        reason = "must be a table of key = value pairs"
    elif kind == "tuple_type":
        reason = "must be a list of tables"
    elif kind == "bool_type":
        reason = "must be true or false"
    else:
        message = str(details["msg"])
        reason = message[0].lower() + message[1:]
    if isinstance(value, Mapping):
        value = None  # a whole table says nothing that its key does not
    return Problem(".".join(str(part) for part in path), value, reason)
