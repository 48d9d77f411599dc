"""The dimensionless numbers that say what kind of problem a case is."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from rotfem.errors import ComputationError
from rotfem.numerics import forms
from rotfem.numerics.eigenproblem import Pencil
from rotfem.refinement.explain import Case, Explanation

Array = npt.NDArray[np.float64]

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
    "steps_per_period": "time steps per period of the last of modes.count modes",
}


def groups(of: Explanation) -> dict[str, float]:
    """Return name ↦ number, those that a case has; `MEANING` says what they are.

    Args:
        of: its changes, which were computed.
    """
    case, system = of.case, of.system
    structure, values = case.problem.structure, of.values
    # Neither a mesh file's plate nor any other structure need have a length of its own.
    length = float(getattr(structure, "length", None) or system.structure.length)
    at_rest = _frequencies_at_rest(of)
    first = float(at_rest[0]) if at_rest.size else 0.0
    speeds, rates = _turning(case, system)
    out = {"speed_ratio": float(np.abs(speeds).max()) / first} if first > 0.0 else {}
    radius = _radius(structure)
    if radius is not None and radius > 0.0:
        out["slenderness"] = length / radius
    if of.size > 0.0:
        out |= {"deflection": of.scale / length, "rotation": of.size}
    root = getattr(structure, "root_position", structure.hub_radius)
    out["hub_ratio"] = float(np.linalg.norm(root)) / length
    if first > 0.0:
        out["spin_rate_change"] = float(np.abs(rates).max()) / first**2
    if np.any(values[:1]) and not structure.damping.is_zero:
        out["damping"] = float(-values[0].real / abs(values[0]))
    if structure.has_tip_mass:
        out["tip_mass_ratio"] = _added_mass(system, "tip_mass")
    if case.steps is not None and case.steps.step is not None and (at_rest.size or len(values)):
        fastest = float(np.abs(values).max()) if len(values) else float(at_rest[-1])
        out["steps_per_period"] = 2 * np.pi / fastest / case.steps.step
    return out


def _frequencies_at_rest(of: Explanation) -> Array:
    """Return the frequencies (rad/s) of the resting structure, its hub held; none where they cannot be computed."""
    held = of.system.held
    held.set_time(0.0, of.problem.motion.at_speed(0.0))
    held.set_state(held.zeros())
    try:
        return np.sort(np.abs(Pencil(*held.mass_damping_stiffness()).solve(max(2, of.case.mode_count)).resolved))
    except ComputationError:
        return np.empty(0)


def _turning(case: Case, system: Any) -> tuple[Array, Array]:
    """Return Ω and dΩ/dt at some times of the motion; of a free hub those of the rigid structure."""
    motion, end = case.problem.motion, case.steps.end if case.steps is not None else 0.0
    times = np.linspace(0.0, max(end, motion.settled), 401)
    if motion.hub is None:
        return np.array([motion.speed(t) for t in times]), np.array([motion.rate(t) for t in times])
    speeds = motion.hub.rigid_speeds(np.asarray(times), system.row.rest_inertia())
    return speeds, np.gradient(speeds, times) if end else np.zeros(len(times))


def _radius(structure: Any) -> float | None:
    """Return √(EI/EA) at the clamp, the least of its bending stiffnesses (m); None where there is no such section."""
    section = getattr(structure, "section", None)
    if section is None:
        thickness = structure.thickness
        return float(thickness) / np.sqrt(12) if isinstance(thickness, int | float) else None
    at = section.at(np.zeros(1))
    bending = [at[name] for name in ("EI", "EI2", "EI3") if name in at]
    if "stiffness" in at:
        C = np.asarray(at["stiffness"]).reshape(-1, 6, 6)[0]
        return float(np.sqrt(min(C[4, 4], C[5, 5]) / C[0, 0]))
    return float(np.sqrt(min(float(b[0]) for b in bending) / float(at["EA"][0]))) if bending else None


def _added_mass(system: Any, effect: str) -> float:
    """Return the masses that an effect brings, as a share of the mass of the structure without them."""
    switch = system.structure.constant(1.0)
    bodies = [b for b in system.structure.bodies((effect,)) if b.is_position]
    mass = forms.form(sum((switch if b.effect == effect else 1.0) * b.density * b.measure for b in bodies), once=True)

    def total() -> float:
        return float(system.comm.allreduce(float(fem.assemble_scalar(mass))))

    whole = total()
    switch.value = 0.0
    return whole / total() - 1.0
