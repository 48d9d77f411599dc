"""The motion at one instant, as a script sees it."""

from __future__ import annotations

from typing import Any

import numpy as np

from rotfem.analysis.dense_output import write_state
from rotfem.analysis.schemes import Array, State
from rotfem.analysis.stability import Stability, stability_of
from rotfem.errors import InputError


class Moment:
    """The motion at one instant, as a script sees it.

    Args:
        system: the equations of motion.
        state: unknowns and rates.

    Attributes:
        t: time, s.
    """

    def __init__(self, system: Any, state: State):
        self.system, self.state, self.t = system, state, state.t

    def __repr__(self) -> str:
        return f"<Moment at t = {self.t:.6g} s>"

    @property
    def tip(self) -> dict[str, float]:
        """The unknowns at the tip, relative to the turning frame: u1, u2, … (m), alpha, … (rad)."""
        self.system.count_rotations_from(self.state.reference)
        values = self.system.tip(self.state.q, self.t)
        return dict(zip(self.system.structure.components, map(float, values), strict=True))

    @property
    def angle(self) -> float:
        """Angle psi of the frame, rad."""
        return float(self._set().motion.angle(self.t))

    @property
    def speed(self) -> float:
        """Speed of the frame, rad/s."""
        return float(self._set().motion.speed(self.t))

    def energies(self) -> dict[str, float]:
        """Return kinetic and strain energy and the Jacobi integral, J."""
        return dict(self._set().energies())

    def stability(self) -> Stability:
        """Return what becomes of small disturbances of an equilibrium (see `rotfem.analysis.stability`)."""
        return stability_of(self.system, self.state.q, self.speed)

    def hub(self) -> dict[str, float]:
        """Return what the history has of a free hub: `torque`, `hub_kinetic`, …; empty where none is free.

        Torque (N·m) and kinetic energy of the hub (J), angular momentum of hub and structure, angular impulse of all
        forces from outside (N·m·s) and work of torque and brake (J) since t = 0.
        """
        return hub_values(self._set(), self.state)

    def root(self) -> dict[str, float]:
        """Return force f1, f2, f3 (N) and moment m1, m2, m3 (N·m) of the hub on the structure, in axes of the frame.

        The moment is about the root: the clamped end, or the middle of a plate's clamped edges, not the axis of spin.
        """
        return dict(self._set().root_reaction())

    def outputs(self) -> dict[str, float]:
        """Return the output functionals of the problem."""
        return dict(self._set().outputs())

    def shape(self) -> dict[str, Array]:
        """Return the deflected structure: position of the nodes (m) and their displacements and rotations."""
        return dict(self._set().shape())

    def _set(self) -> Any:
        """Write the state into the system."""
        self.system.count_rotations_from(self.state.reference)
        self.system.set_time(self.t)
        write_state(self.system, self.state)
        return self.system


def hub_values(system: Any, state: State) -> dict[str, float]:
    """Return the values of a free hub at a state that is written into the system (see `Moment.hub`)."""
    if system.hub is None:
        return {}
    work, impulse = (0.0, 0.0) if state.given is None else map(float, state.given[:2])
    own = {"torque": system.row.torque(state.t, after=True), "hub_kinetic": system.row.kinetic()}
    return {**own, "angular_momentum": system.row.angular_momentum(), "impulse": impulse, "work": work}


def first_shape(system: Any, start: Array | Moment | None) -> Array | None:
    """Return the shape that a motion starts from (local dof array), and let the system count its rotations as it does.

    Args:
        system: equations of the motion.
        start: a shape with rotations counted from the undeformed structure, or a moment of this system or another one.

    Raises:
        InputError: it is a shape of another mesh.
    """
    if start is None:
        return None
    held, reference = system.held, None
    q = np.asarray(start.state.q if isinstance(start, Moment) else start)
    if isinstance(start, Moment):
        source, reference = start.system.held, start.state.reference
        q = q[: len(source.zeros())]
        if reference is not None and held.structure.turns is None:
            source.count_rotations_from(reference)
            q, reference = source.structure.total(q), None
    if q.shape != held.zeros().shape:
        allowed = f"must have the {len(held.zeros())} unknowns of this structure and mesh on this process"
        raise InputError("start", f"{q.size} unknowns", allowed)
    held.count_rotations_from(reference)
    return q
