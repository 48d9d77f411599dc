"""The registries: theories, effects, schemes, motions, damping, structures, section shapes, outputs and blade files.

They are the only lists. What a scene may say, the ladder of theories, the reasons of `explain`, the energies and the
hub's row follow from their entries. The package's own entries come into being when a registry is first asked for one; a
user's script adds others with `register`, and their names are then valid values of a scene.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any, ClassVar, Generic, Protocol, TypeVar, cast


class Entry(Protocol):
    """What can be registered: it has a name, and its class says where it belongs."""

    registry: ClassVar[Registry[Any]]

    @property
    def name(self) -> str:
        """What a scene calls it."""


E = TypeVar("E", bound=Entry)


class Registry(Generic[E]):
    """Entries of one kind by name, in the order they are listed.

    Args:
        kind: what an entry is, for messages.
        homes: modules that register the package's own entries when they are imported.
    """

    def __init__(self, kind: str, *homes: str):
        self.kind, self._homes = kind, homes
        self._entries: dict[str, E] = {}
        self._noted: set[str] = set()

    def add(self, entry: E, replace: bool = False, noted: bool = False) -> None:
        """Add an entry; it may replace another one, or both are noted: of a notebook."""
        self._load()
        if entry.name in self._entries and not (replace or (noted and entry.name in self._noted)):
            raise ValueError(f"{entry.name!r} is the name of another {self.kind} already; replace=True takes its place")
        self._entries[entry.name] = entry
        if noted:
            self._noted.add(entry.name)

    def remove(self, name: str) -> None:
        """Take an entry out again, as a test does with its own."""
        del self._entries[name]

    def _load(self) -> None:
        homes, self._homes = self._homes, ()
        for home in homes:
            import_module(home)

    @property
    def names(self) -> tuple[str, ...]:
        """All names."""
        self._load()
        return tuple(self._entries)

    def __getitem__(self, name: str) -> E:
        self._load()
        return self._entries[name]

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __iter__(self) -> Iterator[E]:
        return iter([self._entries[name] for name in self.names])


# The registries themselves are here, on the ground, so that a scene knows the names of what lies above it.
theories: Registry[Any] = Registry("theory", "rotfem.mechanics.theories")
effects: Registry[Any] = Registry("effect", "rotfem.mechanics.effects")
schemes: Registry[Any] = Registry("scheme", "rotfem.analysis.schemes")
shapes: Registry[Any] = Registry("section shape", "rotfem.scene.section_shapes")
outputs: Registry[Any] = Registry("output", "rotfem.mechanics.problem")
blade_formats: Registry[Any] = Registry(
    "format of blade files",
    "rotfem.scene.blades.openfast",
    "rotfem.scene.blades.bmodes",
    "rotfem.scene.blades.hawc2",
    "rotfem.scene.blades.windio",
    "rotfem.scene.rotors.ross",
)
motion_laws: Registry[Any] = Registry("type of motion", "rotfem.scene.motion")
damping_models: Registry[Any] = Registry("damping model")
structures: Registry[Any] = Registry("structure", "rotfem.scene.structure")

ALL: tuple[Registry[Any], ...] = tuple(registry for registry in globals().values() if isinstance(registry, Registry))


def register(entry: Entry | type[Entry], replace: bool = False) -> None:
    """Add an entry to the registry of its kind: its name is then a valid value of a scene.

    A cell of a notebook, or a prompt, may register a name of its own again, which replaces the entry.

    Args:
        entry: a `Theory`, `Effect`, `DampingModel`, `StructureKind`, `Shape`, `Output` or `BladeFormat`, or a class of
            `Scheme` or `MotionLaw`.
        replace: whether it may take the place of another one of its name.

    Raises:
        ValueError: its name is taken.
    """
    entry.registry.add(entry, replace, "__file__" not in sys._getframe(1).f_globals)


def resolved(function: str | Callable[..., Any]) -> Callable[..., Any]:
    """Return a function, or the one that "module:name" stands for, so that entries need not load what they call."""
    if not isinstance(function, str):
        return function
    module, _, name = function.partition(":")
    return cast(Callable[..., Any], getattr(import_module(module), name))
