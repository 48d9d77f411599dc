"""The beam that most tests are about: Kane, Ryan & Banerjee (1987) as in Simo & Vu-Quoc (1986), 6 rad/s in 15 s."""

from __future__ import annotations

import tomllib
from typing import Any

#: Its section as a scene file has it.
SECTION = """\
[structure.section]
EA = 2.8e7
GA = 1.0e7
EI = 1.4e4
mass_per_length = 1.2
rotary_inertia = 6.0e-4
"""

#: The table of the beam as a scene file has it, its section included.
BEAM_TABLE = f"""\
[structure]
type = "planar_beam"
length = 10.0
{SECTION}"""

#: The same of a plate that is spun up, for what is tried with both.
PLATE_TABLES = """\
[structure]
type = "plate"
length = 1.0
width = 0.5
thickness = 0.02
E = 7e10
nu = 0.3
rho = 2700.0
[motion]
type = "spin_up"
speed = 60.0
duration = 2.0
"""

STRUCTURE: dict[str, Any] = {"type": "planar_beam", "length": 10.0, **tomllib.loads(SECTION)["structure"]}
SPIN_UP: dict[str, Any] = {
    "structure": STRUCTURE,
    "motion": {"type": "spin_up", "speed": 6.0, "duration": 15.0},
    "mesh": {"elements": 10, "degree": 3},
}

#: A thick beam in a few unknowns, for tests of commands about modes.
MODAL_SCENE = """\
[structure]
type = "planar_beam"
length = 1.0
hub_radius = 0.5
section = { EA = 400.0, GA = 130.0, EI = 1.0, mass_per_length = 1.0, rotary_inertia = 0.0025 }
[motion]
type = "constant"
speed = 3.0
[model]
theory = "consistent_linear"
[mesh]
elements = 4
[modes]
count = 3
"""
