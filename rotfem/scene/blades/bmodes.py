"""BModes' section properties, and its main file (.bmi) with radius, hub and the factors of the properties.

Rows are over fractions of the length beyond the hub. They are read as the program computes with them: its line is the
elastic axis, `cg_offst` is counted from it along the chord to the leading edge, the tension centre is at `tc_offst −
sc_offst`, and inertias and bending stiffness are about that line, not about centres. There is no shear stiffness.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from rotfem.registry import register
from rotfem.scene.blades.deck import Asked, BladeFormat, Deck, coned_root, scaled_rows
from rotfem.scene.values import Array

COLUMNS = [
    *("str_tw", "tw_iner", "mass_den", "flp_iner", "edge_iner", "flp_stff", "edge_stff", "tor_stff", "axial_stff"),
    *("cg_offst", "sc_offst", "tc_offst"),
]

#: Versions in the first line of a main file that are known.
VERSIONS = ("1.03", "3.00")

#: Names of the first column: of BModes and of what writes its files.
FIRST = ("sec_loc", "span_loc")

POSITIVE = ("mass_den", "flp_iner", "edge_iner", "flp_stff", "edge_stff", "tor_stff", "axial_stff")

#: Factor of the main file ↦ column.
FACTORS = {
    "sec_mass_mult": "mass_den",
    "flp_iner_mult": "flp_iner",
    "lag_iner_mult": "edge_iner",
    "flp_stff_mult": "flp_stff",
    "edge_stff_mult": "edge_stff",
    "tor_stff_mult": "tor_stff",
    "axial_stff_mult": "axial_stff",
    "cg_offst_mult": "cg_offst",
    "sc_offst_mult": "sc_offst",
    "tc_offst_mult": "tc_offst",
}

#: Values of the main file that are known, and no others: what else there is would be left out unsaid.
ONLY = {"beam_type": 1.0, "hub_conn": 1.0, "bl_thp": 0.0, "id_mat": 1.0}
NO_TIP = ("cm_loc", "ixx_tip", "iyy_tip", "izz_tip", "ixy_tip", "izx_tip", "iyz_tip")

SHEAR = ("GA2", "GA3")


def _is_main(deck: Deck) -> bool:
    return "MAIN INPUT FILE" in deck.lines[0].upper() and deck.has("beam_type")


def recognises(deck: Deck) -> bool:
    """Return whether the first line is that of a main file, or the second has the number of sections (n_secs)."""
    return _is_main(deck) or (len(deck.lines) > 1 and "n_secs" in deck.lines[1])


def read(deck: Deck, asked: Asked) -> dict[str, Any]:
    """Return section and pretwist of section properties; with a main file length, hub radius and precone too."""
    if not _is_main(deck):
        length = asked.length(deck, "sec_loc is a part of radius − hub_rad of BModes' main file")
        return _keys(deck, asked, length, {})
    if "BMODES" in deck.lines[0].upper():  # files of pyBModes name neither program nor version
        version = re.search(r"BModes\s+V(\d+\.\d+)", deck.lines[0], re.IGNORECASE)
        if version is None or version[1] not in VERSIONS:
            named = version[1] if version else "missing"
            deck.fail(f"the version of BModes' main file is {named}; known: {', '.join(VERSIONS)}", 1)
    for name, value in ONLY.items():
        if (found := deck.number(name)) != value:
            deck.refuse(name, f"{name} = {found:g} is not known; only {value:g}")
    for name in NO_TIP:
        if deck.number(name) != 0.0:
            deck.refuse(name, f"{name} is not read; set it to 0 and give tip_offset and tip_inertia in the scene")
    hub, length = deck.hub_and_length("hub_rad", "radius")
    factors = {column: deck.number(factor) for factor, column in FACTORS.items()}
    properties = deck.file("sec_props_file")
    keys = _keys(properties, asked, length, factors)
    place = coned_root(hub, float(np.radians(deck.number("precone"))))
    return {"length": length, **place, "tip_mass": deck.number("tip_mass"), **keys}


def _keys(deck: Deck, asked: Asked, length: float, factors: dict[str, float]) -> dict[str, Any]:
    """Return section and pretwist of a file of section properties, whose columns a main file multiplies by factors."""
    x, table, first = _table(deck)
    asked.needs(deck, SHEAR, "beams of BModes do not shear")
    table |= {column: factor * table[column] for column, factor in factors.items()}
    tension = table["tc_offst"] - table["sc_offst"]
    central = {
        "EI3": table["edge_stff"] - table["axial_stff"] * tension**2,
        "rotary_inertia3": table["edge_iner"] - table["mass_den"] * table["cg_offst"] ** 2,
    }
    for key, about in central.items():
        for i in np.flatnonzero(about <= 0.0):
            deck.fail(
                f"its offset leaves {key} = {about[i]:g} about the centre; must be greater than 0", first + int(i)
            )

    def rows(found: Array) -> Any:
        return scaled_rows(x, length, found)

    def points(y: Array) -> Any:
        return rows(np.stack([y, np.zeros_like(y)], axis=-1))

    return {
        "pretwist": rows(-np.radians(table["str_tw"])),
        "section": {
            "EA": rows(table["axial_stff"]),
            "GJ": rows(table["tor_stff"]),
            "EI2": rows(table["flp_stff"]),
            "EI3": rows(central["EI3"]),
            "mass_per_length": rows(table["mass_den"]),
            "rotary_inertia2": rows(table["flp_iner"]),
            "rotary_inertia3": rows(central["rotary_inertia3"]),
            "mass_center": points(table["cg_offst"]),
            "tension_center": points(tension),
        },
    }


def _table(deck: Deck) -> tuple[Array, dict[str, Array], int]:
    """Return the places of the sections, parts of the length, the columns there, and the line that they start at."""
    count = deck.count("n_secs", 2)
    head = deck.find("str_tw mass_den")
    names = deck.lines[head - 1].split()
    if names[0] not in FIRST or names[1:] != COLUMNS:
        deck.fail(f"columns must be {FIRST[0]} {' '.join(COLUMNS)}", head)
    first = head + 2  # below the units
    table = deck.table(first, count, names, POSITIVE)
    x = table.pop(names[0])
    deck.increasing(x, range(first, first + count), 1.0, names[0])
    for i in np.flatnonzero(table["tw_iner"] != table["str_tw"]):
        deck.fail(
            "tw_iner must be str_tw: principal axes of mass and stiffness that differ are not read", first + int(i), 3
        )
    return x, table, first


register(BladeFormat("bmodes", "BModes' section properties, or its main file (.bmi)", recognises, read))
