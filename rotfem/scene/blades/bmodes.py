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

COLUMNS = (
    *("str_tw", "tw_iner", "mass_den", "flp_iner", "edge_iner", "flp_stff", "edge_stff", "tor_stff", "axial_stff"),
    *("cg_offst", "sc_offst", "tc_offst"),
)

#: Keys of the section ↦ columns.
SECTION = {
    "EA": "axial_stff",
    "GJ": "tor_stff",
    "EI2": "flp_stff",
    "EI3": "edge_stff",
    "mass_per_length": "mass_den",
    "rotary_inertia2": "flp_iner",
    "rotary_inertia3": "edge_iner",
}

#: Versions in the first line of a main file that are known.
VERSIONS = ("1.03", "3.00")

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
    count = deck.count("n_secs", 2)
    x, table, first = deck.columns("str_tw mass_den", count, "sec_loc span_loc", COLUMNS, COLUMNS)
    for i in np.flatnonzero(table["tw_iner"] != table["str_tw"]):
        why = "tw_iner must be str_tw: principal axes of mass and stiffness that differ are not read"
        deck.fail(why, first + int(i))
    asked.needs(deck, ("GA2", "GA3"), "beams of BModes do not shear")
    table |= {column: factor * table[column] for column, factor in factors.items()}
    tension = table["tc_offst"] - table["sc_offst"]
    twist = -np.radians(table["str_tw"])
    # About the centres, not about the line.
    table["edge_stff"] = table["edge_stff"] - table["axial_stff"] * tension**2
    table["edge_iner"] = table["edge_iner"] - table["mass_den"] * table["cg_offst"] ** 2
    section = {key: table[column] for key, column in SECTION.items()}
    for key, y in (("mass_center", table["cg_offst"]), ("tension_center", tension)):
        section[key] = np.stack([y, np.zeros_like(y)], axis=-1)
    rows = {key: scaled_rows(x, length, values) for key, values in section.items()}
    return {"pretwist": scaled_rows(x, length, twist), "section": rows}


register(BladeFormat("bmodes", "BModes' section properties, or its main file (.bmi)", recognises, read))
