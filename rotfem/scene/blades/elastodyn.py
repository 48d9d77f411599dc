"""ElastoDyn's blade file (OpenFAST): mass, flap and edge stiffness, and twist over the fraction of the span.

Columns as the documentation of OpenFAST and its templates have them; others, as FAST 7 had, are refused by name.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rotfem.registry import register
from rotfem.scene.blades.axes import scaled_rows
from rotfem.scene.blades.deck import Deck
from rotfem.scene.blades.formats import Asked, BladeFormat

#: Versions in the first line that are known.
VERSIONS = ("1.00",)

#: Columns that must be there, and those that the motion does not depend on.
NEEDED, PASSED_OVER = ("BlFract", "StrcTwst", "BMassDen", "FlpStff", "EdgStff"), ("PitchAxis",)


def recognises(deck: Deck) -> bool:
    """Return whether the first line says so."""
    return "ELASTODYN" in deck.lines[0].upper() and "BLADE" in deck.lines[0].upper()


def read(deck: Deck, asked: Asked) -> dict[str, Any]:
    """Return section and pretwist; axial, shear and torsional stiffness are the scene's, as ElastoDyn has none."""
    deck.check_version("ElastoDyn", VERSIONS)
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
    asked.needs(deck, ("EA", "GA2", "GA3", "GJ"), "blades of ElastoDyn do not stretch, shear or twist")
    length = asked.length(deck, "BlFract is a part of TipRad − HubRad of ElastoDyn's main file")

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


register(BladeFormat("elastodyn", "ElastoDyn's blade file", recognises, read))
