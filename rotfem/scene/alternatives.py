"""Alternative sets of keys, of which a table must hold exactly one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rotfem import registry
from rotfem.scene.section_shapes import MATERIAL_AND_SHAPE
from rotfem.scene.values import problem


@dataclass(frozen=True)
class Way:
    """A complete set of keys.

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


def shape_ways(optional: tuple[str, ...]) -> tuple[Way, ...]:
    """Return the ways of giving a material and a shape, as they are registered, all with the same optional keys."""
    return tuple(
        Way("shape", (*MATERIAL_AND_SHAPE, *dimensions), optional, shape.name)
        for shape in registry.shapes
        for dimensions in shape.choices
    )


def choose_way(given: dict[str, object], ways: Sequence[Way]) -> Way:
    """Return the way that the given keys make up.

    Args:
        given: the keys that are set, with their values.
        ways: the possible ways.

    Raises:
        PydanticCustomError: they make up none, saying what is missing or does not belong, and what is possible.
    """
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
