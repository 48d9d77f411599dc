"""Slips and numbers out of all proportion: refused in one line, or computed right; no traceback, nothing for ever."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.beams import STRUCTURE
from tests.hard.case import Case

SECTION = STRUCTURE["section"]
TIME = {"end": 1.0, "step": 0.01}


def beam(motion: dict[str, Any] | None = None, section: dict[str, Any] = SECTION, **more: Any) -> dict[str, Any]:
    """Return the scene of a planar beam of few elements."""
    structure = {"type": "planar_beam", "length": 10.0, "section": section, **more.pop("structure", {})}
    return {
        "structure": structure,
        "motion": motion or {"type": "constant", "speed": 6.0},
        "mesh": {"elements": 4, "degree": 2},
        **more,
    }


def plate(mesh: str) -> dict[str, Any]:
    """Return the scene of a plate on a mesh file."""
    structure = {"type": "plate", "mesh": mesh, "thickness": 0.02, "E": 7e10, "nu": 0.3, "rho": 2700.0}
    return {"structure": structure, "motion": {"type": "constant", "speed": 6.0}}


def refused(name: str, scene: dict[str, Any], words: str, **more: Any) -> Case:
    return Case("bad input", name, scene, expected="refused", words=words, seconds=more.pop("seconds", 30.0), **more)


def table(file: str) -> dict[str, Any]:
    return beam({"type": "table", "table": file}, time=TIME)


def tiny(length: float) -> dict[str, Any]:
    """Return the scene of a slender cantilever at rest, of any length: EA L²/EI = 10⁶."""
    EI = 1.0
    section = {"EA": 1e6 * EI / length**2, "GA": 1e6 * EI / length**2, "EI": EI, "mass_per_length": 1.0}
    return beam({"type": "constant", "speed": 0.0}, section, structure={"length": length}, modes={"count": 1})


def finite(result: Any) -> float:
    """Return the share of the numbers in a result that are finite."""
    numbers = [value for row in result.rows for value in row.values() if isinstance(value, float)]
    return float(np.mean(np.isfinite(numbers)))


OVERDAMPED = beam(
    section=SECTION | {"rotary_inertia": 6e-13},
    structure={"tip_mass": 0.1, "tip_inertia": 0.01, "damping": {"kelvin_voigt": 1e-4}},
)
SCRIPT = 'SystemCall "touch ran.txt";\n'
HEAD = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"

CASES = [
    refused("1e9 elements", beam(mesh={"elements": 10**9}), r"mesh\.elements.*unknowns.*GB", command="modes"),
    refused("end = 1e300", beam(time={"end": 1e300, "step": 0.01}), r"time\.end = 1e\+300"),
    refused("1e5 modes", beam(modes={"count": 10**5}), r"modes\.count = 100000", command="modes"),
    refused("EA = 1e300", beam(section=SECTION | {"EA": 1e300}), r"structure\.section\.EA = 1e\+300"),
    refused(
        "an O for a 0 in the first row",
        table("a.csv"),
        "line 1 must be 2 finite numbers",
        files={"a.csv": "0,O\n1,5\n2,6\n"},
    ),
    refused("another file as a table", table("/etc/passwd"), r"^(?!.*root:).*line 2 must be 1 finite number\b"),
    refused("a device as a table", table("/dev/zero"), "is no regular file"),
    refused("a script as a mesh", plate("a.msh"), "is no mesh of gmsh", command="modes", files={"a.msh": SCRIPT}),
    refused(
        "a mesh of 1e9 nodes that are not there",
        plate("a.msh"),
        "gmsh",
        command="modes",
        files={"a.msh": HEAD + "$Nodes\n1000000000\n1 0 0 0\n$EndNodes\n"},
    ),
    Case(
        "bad input",
        "a hub of 1e90 m",
        beam(structure={"hub_radius": 1e90}),
        expected="failed",
        words="no steady state",
        seconds=60.0,
    ),
    Case(
        "bad input",
        "heavily damped short waves over speed",
        OVERDAMPED,
        command="campbell",
        options={"speeds": "0:6:3"},
        value=finite,
        reference=1.0,
        source="every number of every branch is finite",
    ),
    *(
        Case(
            "bad input",
            f"a beam of {length:g} m",
            tiny(length),
            command="modes",
            value=lambda result, length=length: result.frequencies[0] * length**2,
            reference=3.516015269,
            tolerance=1e-3,
            source="β² of the clamped-free Euler–Bernoulli beam, β = 1.875104; shear lowers it by 2e-5",
        )
        for length in (1e-17, 1e15)
    ),
]
