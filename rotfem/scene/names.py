"""Names of what is registered: the registries say what a scene may name, at the moment it is validated."""

from __future__ import annotations

from typing import Any, Protocol

from rotfem.errors import show
from rotfem.registry import Registry
from rotfem.scene.problems import did_you_mean
from rotfem.scene.values import problem


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
        others: what is allowed beside a list, for the error message.

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
