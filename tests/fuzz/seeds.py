"""Valid scenes from which mutants are made: those of the repository, and small ones that are computed in no time."""

from __future__ import annotations

import copy
import tomllib
from pathlib import Path
from typing import Any

from tests.beams import STRUCTURE

ROOT = Path(__file__).resolve().parents[2]

Tables = dict[str, Any]

#: File ↦ tables of every scene of the tests and demos.
SCENES: dict[Path, Tables] = {
    path: tomllib.loads(path.read_text(encoding="utf-8"))
    for folder in ("tests/scenes", "demos")
    for path in sorted((ROOT / folder).glob("*.toml"))
}

_SECTION = STRUCTURE["section"]
_BEAM = {"type": "planar_beam", "length": 10.0, "hub_radius": 0.5, "tip_mass": 0.1, "tip_inertia": 0.01}
_BEAM |= {"section": _SECTION, "damping": {"kelvin_voigt": 1e-4, "rayleigh": [0.1, 1e-4]}}
_MESH = {"elements": 2, "degree": 2}
_TIME = {"end": 0.5, "step": 0.1}


def _beam(motion: Tables, theory: str, **more: Any) -> Tables:
    return {"structure": _BEAM, "motion": motion, "mesh": _MESH, "model": {"theory": theory}, **more}


_SPIN_UP = {"type": "spin_up", "speed": 4.0, "duration": 0.5, "base_acceleration": [[0.0, 0.0, 0.0], [1.0, 1.0, 2.0]]}
_TABLE = {"type": "table", "table": [[0.0, 1.0], [0.2, 2.0], [0.4, 1.0]], "interpolation": "linear"}
_TORQUE = {"type": "torque", "hub_inertia": 200.0, "pulses": [[0.0, 0.3, 50.0]], "hub_damping": 0.1, "speed": 1.0}
_LOADS = {"tip_force": {"value": [0.0, 5.0], "kind": "follower"}, "gravity": [0.0, -1.0, 0.0]}

#: Name ↦ a planar scene of 2 elements and few steps.
COMPUTED: dict[str, Tables] = {
    "steady": _beam({"type": "constant", "speed": 6.0}, "reissner"),
    "loaded": _beam({"type": "constant", "speed": 1.0}, "von_karman", loads=_LOADS, time=_TIME),
    "spin-up": _beam(_SPIN_UP, "consistent_linear", time=_TIME | {"scheme": "newmark"}),
    "adaptive": _beam(
        _TABLE, "consistent_linear", time={"end": 0.5, "tolerance": 1e-2, "max_step": 0.1, "min_step": 5e-3}
    ),
    "free hub": _beam(_TORQUE, "reissner", time=_TIME | {"spectral_radius": 0.8}),
    "release": _beam(
        {"type": "constant", "speed": 0.0}, "reissner", time=_TIME, initial={"tip_displacement": 0.5}, loads={}
    ),
    "inertial": _beam(_SPIN_UP, "reissner", time=_TIME)
    | {"model": {"theory": "reissner", "frame": "inertial"}, "structure": _BEAM | {"damping": {"kelvin_voigt": 1e-4}}},
}

#: What mutants are made of, by the name that a failing test shows.
SEEDS: dict[str, list[Tables]] = {"all": [*SCENES.values(), *COMPUTED.values()], "small": list(COMPUTED.values())}


def copied(tables: Tables) -> Tables:
    """Return a copy that may be changed."""
    return copy.deepcopy(tables)
