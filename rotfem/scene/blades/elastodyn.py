"""ElastoDyn's blade file (OpenFAST): mass, flap and edge stiffness, twist over the span; and its main file.

Columns as the documentation of OpenFAST and its templates have them; others, as FAST 7 had, are refused by name. The
main file has length, hub radius, precone and tip mass of blade 1, and names its blade file.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rotfem.registry import register
from rotfem.scene.blades.axes import coned_root, scaled_rows
from rotfem.scene.blades.deck import Deck
from rotfem.scene.blades.formats import Asked, BladeFormat
from rotfem.scene.files import existing_file_beside

#: Versions in the first line that are known.
VERSIONS = ("1.00",)

#: The same of the main file, and what newer ones say instead of a version.
MAIN_VERSIONS, WITHOUT = ("1.01", "1.03"), "ELASTODYN FOR OPENFAST"

#: Columns that must be there, and those that the motion does not depend on.
NEEDED, PASSED_OVER = ("BlFract", "StrcTwst", "BMassDen", "FlpStff", "EdgStff"), ("PitchAxis",)


def recognises(deck: Deck) -> bool:
    """Return whether the first line says so."""
    first = deck.lines[0].upper()
    return "ELASTODYN" in first and ("BLADE" in first or _is_main(deck))


def _is_main(deck: Deck) -> bool:
    first = deck.lines[0].upper()
    return "ELASTODYN" in first and "INPUT FILE" in first and "BLADE" not in first and "TOWER" not in first


def read(deck: Deck, asked: Asked) -> dict[str, Any]:
    """Return section and pretwist, of a main file length, root and tip mass too."""
    main = _is_main(deck)
    if not main:
        deck.check_version("ElastoDyn", VERSIONS)
    asked.needs(deck, ("EA", "GA2", "GA3", "GJ"), "blades of ElastoDyn do not stretch, shear or twist")
    if main:
        return _main(deck)
    return _blade(deck, asked.length(deck, "BlFract is a part of TipRad − HubRad of ElastoDyn's main file"))


def _main(deck: Deck) -> dict[str, Any]:
    """Return what a main file has of blade 1, and its blade file."""
    place, length = root(deck), deck.number("TipRad") - deck.number("HubRad")
    mass = deck.number("TipMass(1)")
    if mass < 0.0:
        deck.fail(f"TipMass(1) = {mass:g} must be at least 0", deck.named("TipMass(1)")[0], 1)
    line, name = deck.named("BldFile1" if deck.has("BldFile1") else "BldFile(1)")
    blade = Deck(existing_file_beside(deck.path, name, line))
    blade.check_version("ElastoDyn", VERSIONS)
    return {"length": length, **place, "tip_mass": mass, **_blade(blade, length)}


def root(deck: Deck) -> dict[str, Any]:
    """Return where a main file of a known version has the root of blade 1, and its precone."""
    if not _is_main(deck):
        deck.fail("the first line must be that of ElastoDyn's main file", 1)
    if WITHOUT not in deck.lines[0].upper():
        deck.check_version("ElastoDyn", MAIN_VERSIONS, "main")
    tip, hub = deck.number("TipRad"), deck.number("HubRad")
    if not 0.0 <= hub < tip:
        deck.fail(f"HubRad = {hub:g} must be at least 0 and less than TipRad = {tip:g}", deck.named("HubRad")[0], 1)
    return coned_root(hub, float(np.radians(deck.number("PreCone(1)"))))


def _blade(deck: Deck, length: float) -> dict[str, Any]:
    """Return section and pretwist of a blade file of a known version; other stiffness is the scene's."""
    count = deck.count("NBlInpSt", 2)
    factors = {name: deck.number(name) for name in ("AdjBlMs", "AdjFlSt", "AdjEdSt")}
    head = deck.find("DISTRIBUTED BLADE PROPERTIES") + 1
    names = deck.lines[head - 1].split() if head <= len(deck.lines) else []
    for column, name in enumerate(names, start=1):
        if name not in NEEDED + PASSED_OVER or name in names[: column - 1]:
            known = ", ".join(NEEDED + PASSED_OVER)
            deck.fail(f'the column "{name}" is not known, or stands twice; known: {known}', head, column)
    if missing := [name for name in NEEDED if name not in names]:
        deck.fail(f"the columns {', '.join(missing)} are missing", head)
    first = head + 2  # below the units
    table = dict(zip(names, np.array(deck.rows(first, count, len(names))).T, strict=True))
    deck.increasing(table["BlFract"], first, 1.0, "BlFract")
    for name in ("BMassDen", "FlpStff", "EdgStff"):
        for i in np.flatnonzero(table[name] <= 0.0):
            deck.fail(f"{name} must be greater than 0, not {table[name][i]:g}", first + int(i), names.index(name) + 1)

    def rows(values: Any) -> Any:
        return scaled_rows(table["BlFract"], length, values)

    return {
        "pretwist": rows(-np.radians(table["StrcTwst"])),
        "section": {
            "mass_per_length": rows(table["BMassDen"] * factors["AdjBlMs"]),
            "EI2": rows(table["FlpStff"] * factors["AdjFlSt"]),
            "EI3": rows(table["EdgStff"] * factors["AdjEdSt"]),
        },
    }


register(BladeFormat("elastodyn", "ElastoDyn's blade file, or its main file", recognises, read))
