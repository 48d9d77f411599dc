"""What a format of blade files is, and `section.from`: the file that a beam's keys are read from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from rotfem.errors import show
from rotfem.registry import Registry
from rotfem.registry import blade_formats as registered
from rotfem.scene.blades.deck import Deck
from rotfem.scene.problems import did_you_mean
from rotfem.scene.values import problem

#: Keys of [structure] that a scene may give beside a file that has them: they say how the blade is used.
SETTINGS = ("damping", "root")


@dataclass(frozen=True)
class Asked:
    """What a scene gives of a blade in addition to its file.

    Attributes:
        structure: the table [structure] as it is given, without its section.
        section: the table of the section as it is given.
        hints: what the files have and the scene does not get; readers add to it.
    """

    structure: Mapping[str, Any]
    section: Mapping[str, Any]
    hints: list[str] = field(default_factory=list)

    def length(self, deck: Deck, why: str) -> float:
        """Return structure.length (m), which the file does not have.

        Raises:
            PydanticCustomError: it is not there, or no length.
        """
        length = self.structure.get("length")
        if not isinstance(length, int | float) or isinstance(length, bool) or not length > 0.0:
            raise problem("length", length, f"must be given, greater than 0 (m), beside {deck.path.name}: {why}")
        return float(length)

    def needs(self, deck: Deck, keys: tuple[str, ...], why: str) -> None:
        """Refuse a file that leaves properties open which the scene does not give.

        Raises:
            PydanticCustomError: names those that are missing.
        """
        missing = [key for key in keys if key not in self.section]
        if missing:
            raise problem("section", None, f"must have {', '.join(missing)} beside {deck.path.name}: {why}")

    def leaves_out(self, deck: Deck, what: str, key: str = "") -> None:
        """Say what a file has that is not taken, and the key of the scene that takes its place."""
        self.hints.append(f"{deck.path.name}: left out: {what}" + (f"; {key} is the key for it" if key else ""))


@dataclass(frozen=True)
class BladeFormat:
    """A format of blade files.

    Attributes:
        name: what `section.format` calls it.
        what: which files these are, in words.
        recognises: whether a file says that it is one of these.
        read: (file, what the scene says beside it) ↦ keys of [structure], section among them.
    """

    registry: ClassVar[Registry[BladeFormat]] = registered

    name: str
    what: str
    recognises: Callable[[Deck], bool]
    read: Callable[[Deck, Asked], dict[str, Any]]


def format_of(deck: Deck, name: Any) -> BladeFormat:
    """Return the format that is asked for, or the one that a file says it has.

    Raises:
        PydanticCustomError: there is none of that name, or the file says of no format, or of several, that it has it.
    """
    allowed = ", ".join(show(each) for each in registered.names)
    if name is not None:
        if name not in registered.names:
            raise problem("section.format", name, f"{did_you_mean(name, registered.names)}allowed: {allowed}")
        chosen: BladeFormat = registered[name]
        return chosen
    found: list[BladeFormat] = [each for each in registered if each.recognises(deck)]
    if len(found) != 1:
        known = "; ".join(f"{show(each.name)}: {each.what}" for each in registered)
        deck.fail(f"does not say which format it has; give section.format, or a file of one of these: {known}")
    return found[0]


def keys_of(path: Path, asked: Asked) -> dict[str, Any]:
    """Return the keys of [structure] that a blade file stands for, merged with those of the scene.

    Damping and pitch are the scene's, where it has them.

    Raises:
        PydanticCustomError: the file is not one of a known format and version, naming line and column; or the scene
            gives what the file has.
    """
    deck = Deck(path)
    kind = format_of(deck, asked.section.get("format"))
    with np.errstate(all="ignore"):  # what overflows is refused by the section, with its key
        read = kind.read(deck, asked)
    own = {key: value for key, value in asked.section.items() if key not in ("from", "format", "set", "body")}
    for where, given, there in (("section.", own, read["section"]), ("", asked.structure, read)):
        for key in there:
            if key in given and key not in ("section", *SETTINGS):
                raise problem(f"{where}{key}", None, f"given twice; {path.name} has it too")
    settings = {key: asked.structure[key] for key in SETTINGS if key in asked.structure}
    return {**asked.structure, **read, **settings, "section": {**read["section"], **own}}
