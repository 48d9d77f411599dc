"""The types of structures: those that are meshed, and designs of a user, which stand for one of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from inspect import Parameter, signature
from typing import Any, ClassVar

from rotfem.errors import SceneError, show
from rotfem.registry import Registry, register, structures
from rotfem.scene.problems import did_you_mean


@dataclass(frozen=True)
class StructureKind:
    """A type of structure, which `structure.type` names.

    Attributes:
        name: what a scene calls it.
        table: keys of [structure] but for type ↦ the [structure] table of another kind, as a function with these as its
            arguments: a design with parameters of its own. None: the kind has a table and a mesh itself.
        discretised: (problem, communicator) ↦ the structure with its mesh, of a kind without `table`.
    """

    registry: ClassVar[Registry[StructureKind]] = structures

    name: str
    table: Callable[..., Mapping[str, Any]] | None = None
    discretised: str | Callable[..., Any] = ""


def is_design(tables: Mapping[str, Any]) -> bool:
    """Return whether the structure of a scene is given by a design."""
    given = tables.get("structure")
    name = given.get("type") if isinstance(given, Mapping) else None
    return isinstance(name, str) and name in structures and structures[name].table is not None


def designed(tables: dict[str, Any], file: str) -> dict[str, Any]:
    """Return the tables of a scene with the structure that a design stands for in its place.

    Raises:
        SceneError: a key is missing or unknown, or the design refuses the values.
    """
    seen = set[str]()
    while is_design(tables):
        given = dict(tables["structure"])
        name = given.pop("type")
        if name in seen:
            raise SceneError(file, "structure.type", name, "is a design that stands for itself")
        seen.add(name)
        tables = {**tables, "structure": _table_of(structures[name].table, given, name, file)}
    return tables


def _table_of(table: Any, given: dict[str, Any], name: str, file: str) -> dict[str, Any]:
    known = signature(table).parameters
    for key in given:
        if key not in known:
            allowed = f"unknown key; {did_you_mean(key, known)}allowed: {', '.join(known)}"
            raise SceneError(file, f"structure.{key}", None, allowed)
    for key, parameter in known.items():
        if parameter.default is Parameter.empty and key not in given:
            why = f"required key is missing; type = {show(name)} needs it"
            raise SceneError(file, f"structure.{key}", None, why)
    try:
        return dict(table(**given))
    except (ArithmeticError, LookupError, TypeError, ValueError) as error:
        raise SceneError(file, "structure.type", name, f"the design fails: {type(error).__name__}: {error}") from None


for _name, _home in (
    ("planar_beam", "planar_beam:PlanarBeam"),
    ("spatial_beam", "spatial_beam:SpatialBeam"),
    ("plate", "plate:Plate"),
):
    register(StructureKind(_name, discretised=f"rotfem.structures.{_home}"))
