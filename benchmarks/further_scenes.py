"""Twenty-two scenes written after the mesh of beams was compared with a finer one; nothing was changed for one of them.

`SCENES` is name ↦ tables, for accuracy_scenes.py --set further: planar and spatial beams, plates, a plate of a mesh
file, free hubs, pitch, dampers, steady states, all schemes, fixed and adaptive steps.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from held_out_scenes import made

Tables = dict[str, Any]

OAR = {
    **{"type": "planar_beam", "length": 3.0, "hub_radius": 0.2},
    "section": {"E": 1.2e10, "nu": 0.3, "rho": 600.0, "shape": "circle", "radius": 0.025},
}
FEELER = {
    **{"type": "planar_beam", "length": 0.3},
    "section": {"E": 2.1e11, "nu": 0.3, "rho": 7850.0, "shape": "rectangle", "width": 0.02, "height": 0.001},
}
SPAR = {
    **{"type": "spatial_beam", "length": 8.0, "hub_radius": 0.4, "pretwist": [[0.0, 0.2], [8.0, 0.0]]},
    "section": {
        **{"EA": 5.0e7, "GA2": 1.0e7, "GA3": 8.0e6, "GJ": 2.0e4, "EI2": 3.0e4, "EI3": 3.0e5},
        **{"mass_per_length": 5.0, "rotary_inertia2": 3.0e-3, "rotary_inertia3": 3.0e-2},
    },
}
PANEL = {"type": "plate", "length": 0.8, "width": 0.3, "thickness": 0.006, "E": 7.0e10, "nu": 0.3, "rho": 2700.0}
STILL, TURNING = {"type": "constant", "speed": 0.0}, {"type": "constant", "speed": 5.0}
SPIN_UP = {"type": "spin_up", "speed": 8.0, "duration": 2.0}
HUB = {"type": "torque", "hub_inertia": 2.0, "pulses": [[0.0, 0.4, 8.0], [0.8, 1.2, -8.0]]}
DAMPED = {"rayleigh": [0.4, 1e-4]}


def _ramp(force: list[float], start: float, rise: float) -> list[list[float]]:
    """Return rows (t, force) of a load that rises and stays."""
    none = [0.0] * len(force)
    return [[0.0, *none], [start, *none], [start + rise, *force], [1e3, *force]]


def _scene(structure: Tables, motion: Tables, elements: Any, time: Tables | None, **more: Any) -> Tables:
    mesh = {} if elements is None else {"mesh": {"elements": elements, **more.pop("mesh", {})}}
    out = {"structure": structure, "motion": motion, **mesh, **more}
    return out if time is None else {"initial": {"state": "undeformed"}, **out, "time": time}


def _fixed(end: float, step: float, scheme: str = "generalised_alpha") -> Tables:
    return {"end": end, "step": step, "scheme": scheme}


def _adaptive(end: float, tolerance: float, scheme: str) -> Tables:
    return {"end": end, "tolerance": tolerance, "scheme": scheme, "output_step": end / 100}


PULL, FLAP = {"tip_force": _ramp([0.0, 30.0], 0.1, 0.3)}, {"tip_force": _ramp([0.0, 10.0, 80.0], 0.1, 0.3)}

SCENES: dict[str, Tables] = {
    "oar pulled": _scene(OAR, STILL, 4, _fixed(3.0, 0.01), loads=PULL),
    "oar pulled, newmark": _scene(OAR, TURNING, 3, _fixed(3.0, 0.01, "newmark"), loads=PULL),
    "oar pulled, esdirk4": _scene(OAR, STILL, 4, _fixed(3.0, 0.03, "esdirk4"), loads=PULL),
    "oar pulled, radau5": _scene(OAR, STILL, 4, _fixed(3.0, 0.03, "radau5"), loads=PULL),
    "oar spun up, to 1e-4": _scene(OAR, SPIN_UP, 4, _adaptive(3.0, 1e-4, "esdirk4")),
    "oar spun up, von Kármán": _scene(OAR, SPIN_UP, 4, _fixed(3.0, 0.01), model={"theory": "von_karman"}),
    "oar spun up, linear": _scene(OAR, SPIN_UP, 4, _fixed(3.0, 0.01), model={"theory": "consistent_linear"}),
    "oar on a free hub": _scene(OAR, HUB, 4, _fixed(2.0, 0.01)),
    "oar on a free hub, radau5 to 1e-3": _scene(OAR, HUB, 4, _adaptive(2.0, 1e-3, "radau5")),
    "oar damped, quadratic elements": _scene(
        {**OAR, "damping": DAMPED}, TURNING, 4, _fixed(3.0, 0.01), loads=PULL, mesh={"degree": 2}
    ),
    "feeler let go": _scene(FEELER, STILL, 4, _fixed(0.6, 0.001), initial={"tip_displacement": 0.05}),
    "feeler seen from outside": _scene(
        FEELER, {"type": "spin_up", "speed": 20.0, "duration": 0.4}, 3, _fixed(0.5, 0.001), model={"frame": "inertial"}
    ),
    "spar in flap": _scene(SPAR, TURNING, 4, _fixed(3.0, 0.02), loads=FLAP),
    "spar in flap, esdirk4 to 1e-3": _scene(SPAR, TURNING, 3, _adaptive(3.0, 1e-3, "esdirk4"), loads=FLAP),
    "spar damped, with a mass": _scene(
        {**SPAR, "damping": DAMPED, "masses": [{"x": 5.0, "mass": 10.0}]}, TURNING, 4, _fixed(3.0, 0.02), loads=FLAP
    ),
    "spar pitched": _scene(
        {**SPAR, "root": {"pitch": [[0.0, 0.0], [0.5, 0.0], [1.0, 0.2], [3.0, 0.2]]}}, TURNING, 4, _fixed(3.0, 0.02)
    ),
    "spar at rest under load": _scene(SPAR, TURNING, 2, None, loads={"tip_force": [0.0, 50.0, 200.0]}),
    "spar energy-conserving": _scene(SPAR, TURNING, 3, _fixed(3.0, 0.02, "energy_conserving"), loads=FLAP),
    "panel pushed": _scene(
        {**PANEL, "damping": DAMPED},
        STILL,
        [6, 2],
        _fixed(0.4, 0.004),
        loads={"tip_force": _ramp([0, 0, 3.0], 0.02, 0.05)},
    ),
    "panel spun up, linear": _scene(
        {**PANEL, "hub_radius": 0.1},
        {"type": "spin_up", "speed": 15.0, "duration": 0.4, "axis": [0, 1, 0]},
        [6, 2],
        _fixed(0.5, 0.002),
        model={"theory": "consistent_linear"},
    ),
    "panel to 1e-3": _scene(
        PANEL, STILL, [4, 2], _adaptive(0.3, 1e-3, "esdirk4"), loads={"tip_force": _ramp([0, 0, 3.0], 0.02, 0.05)}
    ),
    "panel of a mesh file": _scene(
        {
            **{"type": "plate", "mesh": made(Path(tempfile.gettempdir())), "thickness": 0.004},
            **{"E": 7.0e10, "nu": 0.33, "rho": 2700.0},
        },
        {"type": "spin_up", "speed": 20.0, "duration": 0.2, "axis": [0, 1, 0]},
        None,
        _fixed(0.3, 0.002),
        model={"theory": "consistent_linear"},
    ),
}
