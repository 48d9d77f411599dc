"""BeamDyn's files (OpenFAST): the blade file with 6×6 matrices, and the primary file with the reference line.

Matrices are about the reference axis in the order of x (flapwise), y (edgewise) and z (along the blade), displacements
before rotations. The primary file has key points with the initial twist, about −z, and names the blade file; a driver's
input file names the primary file; where it has the root and how it moves that is not read. BeamDyn's axes
of a section without twist are those whose x has no component along y (`BD_ComputeIniNodalCrv`), not ours, whose axis 2
has none along 3: where a blade has both sweep and prebend the twist makes up for it.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from rotfem.registry import register
from rotfem.scene.blades.axes import (
    FROM_IEC,
    iec_pretwist,
    is_positive,
    is_symmetric,
    rows_over,
    scaled_rows,
    symmetric,
    turned_matrix,
)
from rotfem.scene.blades.deck import Deck
from rotfem.scene.blades.formats import Asked, BladeFormat
from rotfem.scene.files import existing_file_beside
from rotfem.scene.reference_line import as_line, line_through
from rotfem.scene.values import Array

#: Versions of the blade file in its first line that are known.
VERSIONS = ("1.00",)

#: The same of the primary file, which need not say any.
PRIMARY_VERSIONS = ("1.00", "1.01")

#: Part of the length by which the first key point may miss the origin: files that programs write have round-off.
ORIGIN = 1e-9


def recognises(deck: Deck) -> bool:
    """Return whether the first line says so."""
    return "BEAMDYN" in deck.lines[0].upper() and "INPUT FILE" in deck.lines[0].upper()


def read(deck: Deck, asked: Asked) -> dict[str, Any]:
    """Return the section of a blade file, or line, pretwist and section of a primary file or of a driver's."""
    if "BLADE" in deck.lines[0].upper():
        length = asked.length(deck, "stations are parts of the arc length; BeamDyn's primary file has the line")
        return {"section": _section(deck, length)}
    if "DRIVER" in deck.lines[0].upper():
        line, name = deck.named("InputFile")
        return _primary(Deck(existing_file_beside(deck.path, name, line)))
    return _primary(deck)


def _section(deck: Deck, length: float) -> dict[str, Any]:
    """Return the tables of matrices of a blade file."""
    deck.check_version("BeamDyn", VERSIONS)
    count = deck.count("station_total", 2)
    line = deck.find("DISTRIBUTED PROPERTIES") + 1
    stations: list[float] = []
    matrices: dict[str, list[Array]] = {"stiffness": [], "mass": []}
    for _ in range(count):
        line = _next(deck, line, "the station")
        eta = deck.row(line, 1)[0]
        if eta <= stations[-1] if stations else eta != 0.0:
            deck.fail(f"stations must increase from 0 to 1; this one is {eta:g}", line, 1)
        stations.append(eta)
        line += 1
        for name, found in matrices.items():
            line = _next(deck, line, f"the matrix of {name}")
            matrix = np.array(deck.rows(line, 6, 6))
            if not is_symmetric(matrix):
                deck.fail(f"the {name} matrix of station {len(stations)} is not symmetric", line)
            if not is_positive(symmetric(matrix), definite=name == "stiffness"):
                deck.fail(f"the {name} matrix of station {len(stations)} is not positive definite", line)
            found.append(symmetric(turned_matrix(matrix, FROM_IEC)))
            line += 6
    if not np.isclose(stations[-1], 1.0, rtol=1e-6):
        deck.fail(f"stations must end at 1; the last of {count} is {stations[-1]:g}", line - 14, 1)
    return {name: scaled_rows(stations, length, np.array(found)) for name, found in matrices.items()}


def _next(deck: Deck, line: int, what: str) -> int:
    """Return the next line that is not empty."""
    while line <= len(deck.lines) and not deck.lines[line - 1].strip():
        line += 1
    if line > len(deck.lines):
        deck.fail(f"the file ends before {what}; station_total says that there is another")
    return line


def _primary(deck: Deck) -> dict[str, Any]:
    """Return line, length, pretwist and section of a primary file."""
    if re.search(r"BeamDyn\s+V\d", deck.lines[0], re.IGNORECASE):
        deck.check_version("BeamDyn", PRIMARY_VERSIONS, "primary")
    members, count = deck.count("member_total", 1), deck.count("kp_total", 3)
    if members != 1:
        line, _ = deck.named("member_total")
        deck.fail(f"has {members} members; only blades of one member are known, as a line of splines", line, 1)
    first = deck.find("kp_xr kp_yr kp_zr initial_twist") + 2
    points = np.array(deck.rows(first, count, 4))
    line = points[:, :3] @ FROM_IEC.T
    if np.linalg.norm(line[0]) > ORIGIN * np.linalg.norm(line[-1]):
        deck.fail("the first key point must be (0, 0, 0)", first)
    line -= line[0]
    through = line_through(as_line(line.tolist()))
    at = np.array([0.0, *through.knots, through.length])
    if len(at) != count:
        deck.fail("two key points are the same", first)
    at_line, name = deck.named("BldFile")
    blade = Deck(existing_file_beside(deck.path, name, at_line))
    pretwist = iec_pretwist(through.at(at)[1], np.radians(points[:, 3]))
    return {
        "line": line.tolist(),
        "pretwist": rows_over(at, pretwist),
        "section": _section(blade, through.length),
    }


register(
    BladeFormat(
        "beamdyn", "BeamDyn's blade file, its primary file with the line, or its driver's file", recognises, read
    )
)
