"""Equations of motion whose effects can be switched off and on without a new compilation.

To try out a model without one of its effects, its term is multiplied by a constant that is 1 or 0 (in the linear
theories: its affine pieces are weighed so). A model that is only tried out need not be quick; one that has been chosen
is compiled without what it leaves out.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import Any

import numpy as np
import ufl
from mpi4py import MPI

from rotfem.equations.affine import AffineSystem
from rotfem.equations.hub import Hub
from rotfem.equations.model import Model
from rotfem.equations.system import System, compile_system
from rotfem.mechanics.accelerations import ACCELERATIONS, damping, load_work, virtual_work
from rotfem.mechanics.bodies import Body
from rotfem.scene import Scene, TorqueMotion

#: Effects that bring bodies of their own, which feel all others.
BODY_EFFECTS = ("rotary_inertia", "tip_mass")


class SwitchedModel(Model):
    """All effects a scene has data for, each with a switch.

    Args:
        scene: validated scene; a list in model.effects does not matter here.
        comm: MPI communicator.
    """

    def __init__(self, scene: Scene, comm: MPI.Comm = MPI.COMM_WORLD):
        super().__init__(scene, comm, scene.replace({"model.effects": "auto"}).effective_effects())

    def _terms(self) -> dict[str, Any]:
        k, s = self.structure.k, self.structure
        self.switches = {name: s.constant(1.0) for name in self.effects}
        groups = self._groups()
        self.bodies = [body for name, bodies in groups.items() for body in self._switched(name, bodies)]
        terms = {"internal": sum(ufl.derivative(s.energy, k.q, k.dq) for s in self.strains)}

        def add(name: str, group: str, work: Any) -> None:
            if not isinstance(work, int):
                terms[name + group] = self._switch(name) * work

        for group, all_bodies in groups.items():
            # Linear theories weigh their pieces, so no switch is wanted in the forms.
            bodies = all_bodies if self.theory.linear else self._switched(group, all_bodies)
            for name in ("inertia", *self.effects):
                if name in ACCELERATIONS:
                    add(name, group, virtual_work(name, bodies, k, self.frame))
            if "damping" in self.effects:
                strains = [] if group else self.strains
                add("damping", group, damping(strains, bodies, k, s.damping()))
        if self.applied:
            terms["loads"] = load_work(self.applied, k)
        return terms

    def _groups(self) -> dict[str, list[Body]]:
        """Return bodies by the effect that brings them: "" those always there, "@tip_mass", …"""
        always = self.structure.bodies(())
        groups = {"": always}
        for name in BODY_EFFECTS:
            if name in self.effects:
                groups[f"@{name}"] = self.structure.bodies((name,))[len(always) :]
        return groups

    def _switched(self, group: str, bodies: list[Body]) -> list[Body]:
        factor = self.switches.get(group.removeprefix("@"), 1)
        return [replace(body, density=factor * body.density) for body in bodies]

    def _switch(self, name: str) -> Any:
        return 1 if self.theory.linear else self.switches.get(name, 1)

    def energies(self) -> dict[str, Any]:
        """Return nothing: nobody asks for energies here."""
        return {}


class SwitchedSystem:
    """A compiled system of all effects, some of them off.

    Args:
        scene: validated scene in the rotating frame.
        comm: MPI communicator.

    Attributes:
        system: equations of motion.
        hub: the hub's equation where it is free.
        effects: all effects that can be switched.
    """

    def __init__(self, scene: Scene, comm: MPI.Comm = MPI.COMM_WORLD):
        self.scene = scene
        self.model = SwitchedModel(scene, comm)
        self.system: System = compile_system(self.model)
        self.prescribed = self.system.motion
        motion = scene.motion
        self.effects = self.model.effects
        self.hub = Hub(self.system, motion, True) if isinstance(motion, TorqueMotion) else None

    def leave_out(self, effects: Collection[str]) -> None:
        """Switch these effects off, all others on, and put a free hub back to its start."""
        for name, constant in self.model.switches.items():
            constant.value = 0.0 if name in effects else 1.0
        if isinstance(self.system, AffineSystem):
            self.system.leave_out(effects)
        if self.hub is not None:
            self.hub.coupled = "hub_coupling" in self.effects and "hub_coupling" not in effects
            self.hub.values[:] = np.array([0.0, self.hub.data.speed, 0.0])
