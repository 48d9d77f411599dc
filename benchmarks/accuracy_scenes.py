"""Scenes of different character, and what their runs say of their error against the error they have.

    ./with-fenicsx python benchmarks/accuracy_scenes.py [--cache FOLDER] [--set known|held_out|…|fresh] [NAME …]

prints, for every scene, estimated and true error of steps, mesh and in all, and the median and the worst of their
ratios. The truth is computed once and kept in the folder: of the steps from eight times as many, of the mesh from
twice the elements (of a mesh file from one degree more) in these steps, in all from both together with the exact
theory. `SCENES` is for others too: name ↦ tables. The scenes of held_out_scenes.py, later_scenes.py and fresh_scenes.py
are of other kinds. The price of an estimate is the CPU time it adds, over that of the run without: the median of so
many pairs, turn by turn.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import tempfile
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import numpy.typing as npt
from fresh_scenes import SCENES as FRESH
from held_out_scenes import SCENES as HELD_OUT
from later_scenes import FURTHER, LAST, UNSEEN
from scipy.interpolate import CubicSpline

import rotfem
from rotfem.mechanics.theories import richest

Array = npt.NDArray[np.float64]
Tables = dict[str, Any]

#: Kane, Ryan & Banerjee (1987) as in Simo & Vu-Quoc (1986).
KRB = {"EA": 2.8e7, "GA": 1.0e7, "EI": 1.4e4, "mass_per_length": 1.2, "rotary_inertia": 6.0e-4}
#: A small propeller blade, and the arm of Yigit, Scott & Ulsoy (1988).
PROPELLER = {"EA": 6.3e6, "GA": 2.0e6, "EI": 4.7, "mass_per_length": 0.243, "rotary_inertia": 1.8e-7}
ARM = {"EA": 5.0e5, "GA": 1.6e5, "EI": 5.5, "mass_per_length": 0.0858, "rotary_inertia": 9.4e-7}
#: A blade that is softer in flap than in lag.
BLADE = {
    **{"EA": 2.0e7, "GA2": 6.0e6, "GA3": 6.0e6, "GJ": 8.0e3, "EI2": 1.0e4, "EI3": 4.0e4},
    **{"mass_per_length": 1.5, "rotary_inertia2": 7.5e-4, "rotary_inertia3": 3.0e-3},
}
PLATE = {"type": "plate", "length": 1.0, "width": 0.5, "thickness": 0.01, "E": 70e9, "nu": 0.3, "rho": 2700.0}


def _beam(length: float, section: Tables, **more: Any) -> Tables:
    return {"type": "planar_beam", "length": length, "section": section, **more}


def _blade(**more: Any) -> Tables:
    return {"type": "spatial_beam", "length": 10.0, "section": BLADE, "pretwist": [[0.0, 0.3], [10.0, 0.0]], **more}


def _constant(speed: float) -> Tables:
    return {"type": "constant", "speed": speed}


def _table(*rows: tuple[float, float]) -> Tables:
    return {"type": "table", "table": [list(row) for row in rows]}


def _gust() -> list[list[float]]:
    """Return rows (t, 0, f) of a gusty load along a blade, N/m, irregular but always the same."""
    t = np.arange(0.0, 100.5, 2.0)
    return [[float(s), 0.0, float(round(np.sin(0.7 * s) + 0.6 * np.sin(1.9 * s + 1.0), 3))] for s in t]


MESH = {"elements": 8}

SCENES: dict[str, Tables] = {
    "propeller, tabulated speed": {
        "structure": _beam(0.5, PROPELLER, hub_radius=0.05),
        "motion": _table((0.0, 0.0), (0.1, 80.0), (0.2, 120.0), (0.35, 250.0), (0.6, 250.0)),
        "mesh": MESH,
        "time": {"end": 0.6, "step": 0.004},
    },
    "resonance once a turn": {
        "structure": _beam(10.0, KRB),
        "motion": _constant(4.1),
        "loads": {"gravity": [0.0, -0.2]},
        "mesh": MESH,
        "time": {"end": 15.0, "step": 0.05},
    },
    "moment pulse": {
        "structure": _beam(10.0, KRB),
        "motion": _constant(0.0),
        "loads": {"tip_moment": [[0.0, 0.0], [0.05, 150.0], [0.1, 0.0]]},
        "mesh": MESH,
        "time": {"end": 4.0, "step": 0.05},
    },
    "pulse on a free hub": {
        "structure": _beam(0.5, ARM, hub_radius=0.05),
        "motion": {"type": "torque", "hub_inertia": 2.0e-3, "pulses": [[0.0, 0.02, 0.5], [0.1, 0.12, -0.5]]},
        "mesh": MESH,
        "time": {"end": 0.4, "step": 0.002},
    },
    "spin-up to a hundred in two periods": {
        "structure": _beam(10.0, KRB),
        "motion": {"type": "spin_up", "speed": 108.0, "duration": 3.9},
        "mesh": {"elements": 16},
        "time": {"end": 5.0, "step": 0.01},
    },
    "spin-up, linear": {
        "structure": _beam(10.0, KRB),
        "motion": {"type": "spin_up", "speed": 6.0, "duration": 15.0},
        "model": {"theory": "consistent_linear"},
        "mesh": MESH,
        "time": {"end": 20.0, "step": 0.02},
    },
    "plate, spin-up": {
        "structure": {**PLATE, "hub_radius": 0.3},
        "motion": {"type": "spin_up", "speed": 40.0, "duration": 0.5, "axis": [0, 1, 0]},
        "model": {"theory": "consistent_linear"},
        "mesh": {"elements": [5, 3]},
        "time": {"end": 0.8, "step": 0.008},
    },
    "gusts on a long blade": {
        "structure": _beam(10.0, KRB, hub_radius=1.0),
        "motion": _constant(2.0),
        "loads": {"distributed": _gust()},
        "model": {"theory": "consistent_linear"},
        "mesh": MESH,
        "time": {"end": 100.0, "step": 0.05},
    },
    "tip released": {
        "structure": _beam(10.0, KRB),
        "motion": _constant(0.0),
        "initial": {"tip_displacement": 3.0},
        "mesh": MESH,
        "time": {"end": 6.0, "step": 0.02},
    },
    "steady blade under load": {
        "structure": _blade(hub_radius=0.5, precone=0.05),
        "motion": _constant(5.0),
        "loads": {"tip_force": [0.0, 20.0, 60.0]},
        "mesh": {"elements": 2, "degree": 2},
    },
    "sudden stop": {
        "structure": _beam(10.0, KRB),
        "motion": _table((0.0, 2.0), (2.0, 2.0), (2.2, 0.0), (8.0, 0.0)),
        "mesh": MESH,
        "time": {"end": 8.0, "step": 0.05},
    },
    "follower force": {
        "structure": _beam(10.0, KRB),
        "motion": _constant(1.0),
        "loads": {"tip_force": {"table": [[0, 0, 0], [4.0, 0, 150.0]], "kind": "follower"}},
        "mesh": MESH,
        "time": {"end": 8.0, "step": 0.04},
    },
    "blade on a shaken base": {
        "structure": _blade(hub_radius=0.5),
        "motion": {
            **_constant(4.0),
            "base_acceleration": [[0, 0, 0, 0], [0.5, 0, 0, 4.0], [1.5, 1.0, 0, -4.0], [2.0, 0, 0, 0]],
        },
        "mesh": {"elements": 6},
        "time": {"end": 6.0, "step": 0.03},
    },
    "torque on a damped arm": {
        "structure": _beam(0.5, ARM, hub_radius=0.05, damping={"kelvin_voigt": 2e-4, "rayleigh": [1.0, 0.0]}),
        "motion": {"type": "torque", "hub_inertia": 2.0e-3, "hub_damping": 1e-3, "pulses": [[0.0, 0.1, 0.2]]},
        "mesh": MESH,
        "time": {"end": 0.5, "step": 0.001},
    },
    "torque reversed in each step": {
        "structure": _beam(0.5, ARM, hub_radius=0.05),
        "motion": {
            **{"type": "torque", "hub_inertia": 2.0e-3},
            "pulses": [[round(0.005 * i, 3), round(0.005 * (i + 1), 3), 0.3 * (-1) ** i] for i in range(20)],
        },
        "mesh": MESH,
        "time": {"end": 0.2, "step": 0.005},
    },
    "spin-down": {
        "structure": _beam(10.0, KRB, tip_mass=2.0, damping={"rayleigh": [0.1, 0.0]}),
        "motion": _table((0.0, 5.0), (1.0, 5.0), (9.0, 0.5), (12.0, 0.5)),
        "mesh": {"elements": 3},
        "time": {"end": 12.0, "step": 0.04},
    },
    "step load, adaptive": {
        "structure": _beam(10.0, KRB, damping={"kelvin_voigt": 1e-3}),
        "motion": _constant(3.0),
        "loads": {"tip_force": [[0, 0, 0], [0.5, 0, 0], [0.6, 0, 20.0], [6.0, 0, 20.0]]},
        "mesh": {"elements": 2, "degree": 2},
        "time": {"end": 6.0, "tolerance": 1e-3},
    },
}
for _tables in SCENES.values():  # what their recorded errors are about
    _tables.setdefault("initial", {}).setdefault("state", "undeformed")


def finer(tables: Tables, steps: int = 1, mesh: int = 1, theory: str | None = None) -> Tables:
    """Return a scene with so many steps for each, so many elements for each along every edge, or another theory."""
    out = dict(tables)
    if "time" in tables and steps > 1:
        time = dict(tables["time"])
        if "step" in time:
            time["step"] /= steps
        else:
            time["tolerance"] /= steps**2
        out["time"] = time
    if mesh > 1 and "mesh" in tables["structure"]:
        out["mesh"] = {**tables.get("mesh", {}), "degree": tables.get("mesh", {}).get("degree", 2) + mesh - 1}
    elif mesh > 1:
        number = tables["mesh"]["elements"]
        refined = [mesh * n for n in number] if isinstance(number, list) else mesh * number
        out["mesh"] = {**tables["mesh"], "elements": refined}
    if theory is not None:
        out["model"] = {**tables.get("model", {}), "theory": theory}
    return out


#: Sets of scenes by their names.
SETS = {"known": SCENES, "held_out": HELD_OUT, "unseen": UNSEEN, "further": FURTHER, "last": LAST, "fresh": FRESH}

#: Pairs of runs with and without an estimate.
PAIRS = 3


class Truth:
    """Tips of runs, kept in a folder.

    Args:
        folder: where.
    """

    def __init__(self, folder: Path):
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    def __call__(self, tables: Tables) -> tuple[Array, Array]:
        """Return times (n,), s, and displacements of the tip (n, d), m."""
        text = json.dumps({**tables, "version": rotfem.__version__}, sort_keys=True)
        file = self.folder / f"{hashlib.sha256(text.encode()).hexdigest()[:24]}.npz"
        if not file.exists():
            t, tip = tips(rotfem.run({**tables, "output": {"error": False}}, hint=None))
            np.savez(file, t=t, tip=tip)
        kept = np.load(file)
        return kept["t"], kept["tip"]


def tips(run: Any) -> tuple[Array, Array]:
    """Return times and displacements of the tip of a run."""
    return run.t, np.column_stack([values for name, values in run.tip.items() if name.startswith("u")])


def difference(one: tuple[Array, Array], other: tuple[Array, Array]) -> float:
    """Return the largest difference of two tips at the times of the first, relative to its largest displacement."""
    (t, tip), (s, reference) = one, other
    at = CubicSpline(s, reference)(t) if len(s) > 1 else reference
    return float(np.linalg.norm(tip - at, axis=1).max() / np.linalg.norm(tip, axis=1).max())


def judged(tables: Tables, truth: Truth) -> dict[str, Any]:
    """Return `estimated` and `true` errors of steps, mesh and in all, the price, and CPU seconds of the run without."""
    bare, price = {**tables, "output": {"error": False}}, []
    rotfem.run(tables, hint=None)  # compiles
    for _ in range(PAIRS):
        times = [process_time()]
        for each in (bare, tables):
            run = rotfem.run(each, hint=None)
            times.append(process_time())
        without, with_it = np.diff(times)
        price.append(with_it / without - 1.0)
    own, error = tips(run), run.summary["error"]
    exact = richest().name
    short = truth(finer(tables, steps=8)) if "time" in tables else own  # adaptive ones differ from mesh to mesh
    true = {
        "time": difference(own, short),
        "space": difference(short, truth(finer(tables, steps=8, mesh=2))),
        "total": difference(own, truth(finer(tables, steps=8, mesh=2, theory=exact))),
    }
    seconds = float(without)
    return {
        "estimated": {n: error[n] for n in true},
        "true": true,
        "price": float(np.median(price)),
        "seconds": seconds,
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cache", type=Path, default=Path(tempfile.gettempdir()) / "rotfem-accuracy")
    parser.add_argument("--set", choices=SETS, default="known")
    parser.add_argument("names", nargs="*", metavar="NAME")
    arguments = parser.parse_args()
    scenes = SETS[arguments.set]
    truth, ratios = Truth(arguments.cache), dict[str, list[float]]()
    print(
        f"{'estimated / true':<38}" + "".join(f"{name:>27}" for name in ("time", "space", "total")) + "  price   CPU s"
    )
    for name in arguments.names or scenes:
        found = judged(scenes[name], truth)
        cells = ""
        for share, true in found["true"].items():
            estimated = found["estimated"][share]
            ratio = estimated / true if true > 1e-7 and estimated is not None else float("nan")
            ratios.setdefault(share, []).append(ratio)
            shown = "unknown" if estimated is None else f"{estimated:.1e}"
            cells += f"{shown:>9} /{true:8.1e} ={ratio:6.2f}"
        print(f"{name:<38}{cells}  {found['price']:5.2f} {found['seconds']:7.2f}", flush=True)
        ratios.setdefault("price", []).append(found["price"])
    for share, values in ratios.items():
        known = np.array([value for value in values if np.isfinite(value)])
        if known.size:
            print(f"{share}: median {np.median(known):.2f}, lowest {known.min():.2f}, highest {known.max():.2f}")


if __name__ == "__main__":
    main()
