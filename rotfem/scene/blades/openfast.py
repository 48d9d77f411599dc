"""OpenFAST's files: the main file (.fst), ElastoDyn's main and blade file, BeamDyn's driver, primary and blade file.

A file is recognised by its keys (`value  NAME`), as these programs read it; the words of its first line are anybody's.
Files of FAST 7 and 8 have the same keys: the main file of FAST 7 is one of ElastoDyn.

ElastoDyn has mass, flap and edge stiffness and twist over fractions of the length. Files that FAST 7 shared with ADAMS
have more columns: torsional and axial stiffness and inertias are taken, though ElastoDyn computes without them.

BeamDyn's matrices are about the reference axis in the order of x (flapwise), y (edgewise) and z (along the blade),
displacements before rotations. Its primary file has key points with the initial twist, about −z, and names the blade
file; a driver's file names the primary file. BeamDyn's axes of a section without twist are those whose x has no
component along y (`BD_ComputeIniNodalCrv`), not ours, whose axis 2 has none along 3: where a blade has both sweep and
prebend the twist makes up for it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rotfem.registry import register
from rotfem.scene.blades.deck import (
    FROM_IEC,
    Asked,
    BladeFormat,
    Deck,
    coned_root,
    iec_pretwist,
    line_of,
    rows_over,
    scaled_rows,
    turned_matrix,
)
from rotfem.scene.values import DIGITS, ROUND_OFF, Array

#: Columns of ElastoDyn's blade file that must be there, after BlFract.
NEEDED = ("StrcTwst", "BMassDen", "FlpStff", "EdgStff")

#: Those that may be there ↦ the property of a section; they are taken where all their values are greater than 0.
TAKEN = {"GJStff": "GJ", "EAStff": "EA", "FlpIner": "rotary_inertia2", "EdgIner": "rotary_inertia3"}

#: Those that are left out. Of offsets the signs are not documented, and ElastoDyn computes without them.
LEFT_OUT = ("Alpha", "PrecrvRef", "PreswpRef", "FlpcgOf", "EdgcgOf", "FlpEAOf", "EdgEAOf")

#: All that are known, with those that the motion does not depend on.
KNOWN = (*NEEDED, *TAKEN, *LEFT_OUT, "PitchAxis", "AeroCent")


# --- OpenFAST's main file -----------------------------------------------------------------------------------------


def _is_openfast(deck: Deck) -> bool:
    return deck.has("CompElast") and deck.has("EDFile")


def _openfast(deck: Deck, asked: Asked) -> dict[str, Any]:
    """Return what the files of blade 1 have; of BeamDyn's, with root and precone of ElastoDyn's main file."""
    which = deck.count("CompElast", 0)
    if which not in (1, 2):
        deck.refuse("CompElast", f"CompElast = {which} is not known; known: 1 (ElastoDyn) and 2 (BeamDyn)")
    main = deck.file("EDFile")
    if which == 1:
        return _elastodyn(main, asked)
    if (mass := main.number("TipMass(1)")) > 0.0:
        asked.leaves_out(main, f"TipMass(1) = {mass:g} kg, as the blade is BeamDyn's", "structure.tip_mass")
    return _beamdyn(deck.file("BDBldFile(1)"), asked) | _root(main, asked)


# --- ElastoDyn ----------------------------------------------------------------------------------------------------


def _is_elastodyn(deck: Deck) -> bool:
    return _is_main(deck) or deck.has("NBlInpSt")


def _is_main(deck: Deck) -> bool:
    return deck.has("TipRad")


def _elastodyn(deck: Deck, asked: Asked) -> dict[str, Any]:
    """Return section, pretwist and damping; of a main file length, root and tip mass too."""
    if not _is_main(deck):
        return _blade(deck, asked)
    length, place = deck.hub_and_length("HubRad", "TipRad")[1], _root(deck, asked)
    blade = deck.file("BldFile1" if deck.has("BldFile1") else "BldFile(1)")
    return {"length": length, **place, "tip_mass": deck.number("TipMass(1)"), **_blade(blade, asked, length)}


def _root(deck: Deck, asked: Asked) -> dict[str, Any]:
    """Return where a main file has the root of blade 1, its precone and its pitch, about −z there."""
    if not _is_main(deck):
        deck.fail("must be ElastoDyn's main file, with a value of TipRad")
    hub, _ = deck.hub_and_length("HubRad", "TipRad")
    if deck.has("RotSpeed") and (speed := deck.number("RotSpeed")) != 0.0:
        asked.leaves_out(deck, f"RotSpeed = {speed:g} rpm = {speed * np.pi / 30:.6g} rad/s", "motion.speed")
    keys = coned_root(hub, float(np.radians(deck.number("PreCone(1)"))))
    pitch = deck.number("BlPitch(1)") if deck.has("BlPitch(1)") else 0.0
    return keys if pitch == 0.0 else keys | {"root": {"pitch": -float(np.radians(pitch))}}


def _blade(deck: Deck, asked: Asked, length: float | None = None) -> dict[str, Any]:
    """Return section, pretwist and damping of a blade file; the scene has other stiffness, and a length (m) of None."""
    count = deck.count("NBlInpSt", 2)
    factors = {name: deck.number(name) for name in ("AdjBlMs", "AdjFlSt", "AdjEdSt")}
    x, table, _ = deck.columns("BlFract BMassDen", count, "BlFract", KNOWN, NEEDED)
    taken = {key: table[name] for name, key in TAKEN.items() if name in table and np.all(table[name] > 0.0)}
    without = [key for key in ("EA", "GA2", "GA3", "GJ") if key not in taken]
    asked.needs(deck, tuple(without), "blades of ElastoDyn do not stretch, shear or twist")
    if length is None:
        length = asked.length(deck, "BlFract is a part of TipRad − HubRad of ElastoDyn's main file")
    if left := [name for name in LEFT_OUT if name in table and np.any(table[name] != 0.0)]:
        asked.leaves_out(deck, f"{', '.join(left)}, without which ElastoDyn computes")
    section = {
        "mass_per_length": table["BMassDen"] * factors["AdjBlMs"],
        "EI2": table["FlpStff"] * factors["AdjFlSt"],
        "EI3": table["EdgStff"] * factors["AdjEdSt"],
    } | taken
    keys: dict[str, Any] = {
        "pretwist": scaled_rows(x, length, -np.radians(table["StrcTwst"])),
        "section": {key: scaled_rows(x, length, values) for key, values in section.items()},
    }
    ratios = {
        family: [deck.number(name) / 100.0 for name in names if deck.has(name)]
        for family, names in (("flap", ("BldFlDmp(1)", "BldFlDmp(2)")), ("lag", ("BldEdDmp(1)",)))
    }
    if given := {family: found for family, found in ratios.items() if any(found)}:
        keys["damping"] = {"modal": given}
    return keys


# --- BeamDyn ------------------------------------------------------------------------------------------------------


def _is_beamdyn(deck: Deck) -> bool:
    return any(deck.has(name) for name in ("station_total", "member_total")) or _is_driver(deck)


def _is_driver(deck: Deck) -> bool:
    return deck.has("InputFile") and deck.has("GlbPos(1)")


def _beamdyn(deck: Deck, asked: Asked) -> dict[str, Any]:
    """Return section and damping of a blade file; of a primary file, or a driver's, line and pretwist too."""
    if _is_driver(deck):
        deck = deck.file("InputFile")
    if deck.has("member_total"):
        return _primary(deck, asked)
    return _matrices(
        deck, asked, asked.length(deck, "stations are parts of the arc length; BeamDyn's primary file has the line")
    )


def _primary(deck: Deck, asked: Asked) -> dict[str, Any]:
    """Return line, pretwist, section and damping of a primary file."""
    members, count = deck.count("member_total", 1), deck.count("kp_total", 3)
    if members != 1:
        why = f"has {members} members; only blades of one member are known, as a line of splines"
        deck.refuse("member_total", why)
    first = deck.find("kp_xr kp_yr kp_zr initial_twist") + 2
    table = deck.table(first, count, ("x", "y", "z", "twist"))
    line = np.stack([table[name] for name in "xyz"], axis=-1) @ FROM_IEC.T
    if np.linalg.norm(line[0]) > ROUND_OFF * np.linalg.norm(line[-1]):
        deck.fail("the first key point must be (0, 0, 0)", first)
    rows, through, at = line_of(line)
    if len(at) != count:
        deck.fail("two key points are the same", first)
    pretwist = iec_pretwist(through.at(at)[1], np.radians(table["twist"]))
    return {"line": rows, "pretwist": rows_over(at, pretwist), **_matrices(deck.file("BldFile"), asked, through.length)}


def _matrices(deck: Deck, asked: Asked, length: float) -> dict[str, Any]:
    """Return the tables of matrices of a blade file, and its damping."""
    count, head = deck.count("station_total", 2), deck.find("DISTRIBUTED PROPERTIES")
    lines = [number for number, line in enumerate(deck.lines, start=1) if number > head and line.strip()]
    if len(lines) < 13 * count:
        deck.fail(f"ends before station {len(lines) // 13 + 1} is complete; station_total says that there are {count}")
    matrices: dict[str, list[Array]] = {"stiffness": [], "mass": []}
    stations = list[float]()
    for i in range(0, 13 * count, 13):
        stations += deck.row(lines[i], 1)
        for (name, found), first in zip(matrices.items(), (i + 1, i + 7), strict=True):
            matrix = np.array([deck.row(line, 6) for line in lines[first : first + 6]])
            if not np.max(np.abs(matrix - matrix.T)) <= DIGITS * np.max(np.abs(matrix)):
                deck.fail(f"the {name} matrix of station {len(stations)} is not symmetric", lines[first])
            matrix = (matrix + matrix.T) / 2
            found.append(turned_matrix(matrix, FROM_IEC))
    deck.increasing(stations, lines[: 13 * count : 13], 1.0, "the stations")
    section = {name: scaled_rows(stations, length, np.array(found)) for name, found in matrices.items()}
    return {"section": section, **_damping(deck, asked)}


def _damping(deck: Deck, asked: Asked) -> dict[str, Any]:
    """Return Kelvin and Voigt's coefficient, where those of all six strains, mu1 to mu6 (s), are the same."""
    if not deck.has("damp_type") or deck.count("damp_type", 0) == 0:
        return {}
    mu = deck.row(deck.find("mu1 mu6") + 2, 6)
    if len(set(mu)) == 1 and mu[0] >= 0.0:
        return {"damping": {"kelvin_voigt": mu[0]}} if mu[0] > 0.0 else {}
    asked.leaves_out(deck, f"mu1 … mu6 = {', '.join(f'{each:g}' for each in mu)} s, which differ", "structure.damping")
    return {}


register(BladeFormat("openfast", "OpenFAST's main file (.fst)", _is_openfast, _openfast))
register(BladeFormat("elastodyn", "ElastoDyn's blade file, or its main file", _is_elastodyn, _elastodyn))
register(BladeFormat("beamdyn", "BeamDyn's blade, primary or driver's file", _is_beamdyn, _beamdyn))
