"""The dimensionless numbers that say what kind of problem a scene is."""

from __future__ import annotations

from typing import Any

import numpy as np
from dolfinx import fem

from rotfem.equations.switched import SwitchedSystem
from rotfem.numerics import forms
from rotfem.scene import Scene, TorqueMotion
from rotfem.selection.coarse_model import Trial
from rotfem.selection.distance import Outputs

#: What each number is, in words and symbols.
MEANING = {
    "speed_ratio": "Ω/ω₁, largest speed to first frequency at rest",
    "slenderness": "L/r, length to radius of gyration of the section at the clamp",
    "deflection": "largest tip displacement/L",
    "rotation": "largest displacement/L or rotation in rad",
    "hub_ratio": "R/L, hub radius to length",
    "spin_rate_change": "largest |dΩ/dt|/ω₁²",
    "damping": "ζ, damping ratio of the first mode",
    "tip_mass_ratio": "tip (or other added) mass/mass of the structure",
    "steps_per_period": "steps in a period of the fastest wanted mode",
}

#: Times at which a motion is looked at.
SAMPLES = 400


def groups(scene: Scene, trial: Trial, own: Outputs) -> dict[str, float]:
    """Return name ↦ number, those that the scene has; `MEANING` says what they are.

    Args:
        scene: the scene as the user gave it.
        trial: the same, to be tried out.
        own: what its model gives.
    """
    switched = trial.system("consistent_linear")
    structure = scene.structure
    # Neither a mesh file's plate nor any other structure need have a length of its own.
    length = float(getattr(structure, "length", None) or switched.model.structure.length)
    known = bool(trial.at_rest.size)
    out = {"speed_ratio": _largest(scene, switched, "speed") / float(trial.at_rest[0])} if known else {}
    radius = _radius(structure)
    if radius is not None and radius > 0.0:
        out["slenderness"] = length / radius
    if own.tip.size:
        out["deflection"] = float(np.linalg.norm(own.tip, axis=1).max()) / length
        out["rotation"] = own.size
    hub = getattr(structure, "hub_offset", None)
    out["hub_ratio"] = float(np.linalg.norm(hub) if hub is not None else structure.hub_radius) / length
    if known:
        out["spin_rate_change"] = _largest(scene, switched, "rate") / float(trial.at_rest[0]) ** 2
    if len(own.values) and not structure.damping.is_zero:
        out["damping"] = float(-own.values[0].real / abs(own.values[0]))
    if structure.has_tip_mass:
        out["tip_mass_ratio"] = _mass(switched, "tip_mass") / _mass(switched) - 1.0
    if scene.time is not None and scene.time.step is not None and (known or len(own.values)):
        fastest = float(np.abs(own.values).max()) if len(own.values) else float(trial.at_rest[-1])
        out["steps_per_period"] = 2 * np.pi / fastest / scene.time.step
    return out


def _largest(scene: Scene, switched: SwitchedSystem, what: str) -> float:
    """Return the largest |Ω| or |dΩ/dt| of the motion; of a free hub that of the rigid structure."""
    motion, end = scene.motion, scene.time.end if scene.time is not None else 0.0
    times = np.linspace(0.0, max(end, getattr(motion, "duration", 0.0)), SAMPLES + 1)
    if isinstance(motion, TorqueMotion) and switched.hub is not None:
        hub = switched.hub
        switched.leave_out(())
        inertia = hub.diagonal(0.0, 1.0)
        rates = np.array([hub.torque.at(t) for t in times]) / inertia
        if what == "rate":
            return float(np.abs(rates).max())
        steps = np.diff(times, prepend=0.0)
        return float(np.abs(motion.speed + np.cumsum(rates * steps)).max())
    function = getattr(switched.prescribed, what)
    return float(max(abs(function(t)) for t in times))


def _radius(structure: Any) -> float | None:
    """Return √(EI/EA) at the clamp, the least of its bending stiffnesses (m); None where there is no such section."""
    if structure.type == "plate":
        thickness = structure.thickness
        return float(thickness) / np.sqrt(12) if isinstance(thickness, int | float) else None
    at = structure.section.at(np.zeros(1))
    bending = [at[name] for name in ("EI", "EI2", "EI3") if name in at]
    if "stiffness" in at:
        C = np.asarray(at["stiffness"]).reshape(-1, 6, 6)[0]
        return float(np.sqrt(min(C[4, 4], C[5, 5]) / C[0, 0]))
    return float(np.sqrt(min(float(b[0]) for b in bending) / float(at["EA"][0]))) if bending else None


def _mass(switched: SwitchedSystem, *effects: str) -> float:
    """Return the mass of the structure, with the masses of an effect or without, kg."""
    bodies = [b for b in switched.model.structure.bodies(effects) if b.is_position]
    local = sum(float(fem.assemble_scalar(forms.form(b.density * b.measure))) for b in bodies)
    return float(switched.model.comm.allreduce(local))
