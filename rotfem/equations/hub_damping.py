"""Damping that no stress of the structure carries, but its hub: by mode, and in proportion to the mass.

These are forces on all points of the structure that brake their motion relative to the hub, C v = B Bᵀ v and a0 M v. So
they act between the two, as springs of the root do. What the hub exerts on the structure, in balance with its inertia
and loads alone, is then what holds the clamp less the work of these forces when all of the structure goes along in a
unit motion of the clamp:

    f_i = F(δq of the clamp) − (C v)·R_i(q),

R_i the rigid motion of the displaced structure (`rotfem.structures.root_reaction`). Of a free hub that is its own
equation, in which forces between it and its structure have no part.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.equations.modal_damping import EFFECT
from rotfem.mechanics import work
from rotfem.mechanics.work import Variation
from rotfem.numerics import forms
from rotfem.numerics.projection import times

Array = npt.NDArray[np.float64]


class HubDamping:
    """What these forces of a nonlinear theory make of rigid motions.

    Args:
        system: equations of motion of the structure, in a rotating frame if there is such damping.
    """

    def __init__(self, system: Any):
        self._system = system

    @cached_property
    def _by_mass(self) -> list[Any]:
        """The work of a0 M v, compiled; empty without."""
        model = self._system.model
        m = model.mechanics
        if EFFECT not in model.effects or m.damping.mass is None:
            return []
        alone = replace(m, damping=replace(m.damping, stiffness=None))
        return [forms.form(model.switches[EFFECT] * work.damping(alone, Variation(m.k)), once=True)]

    def tangent(self, M: Any) -> Array | float:
        """Return what small velocities about a state at rest add to it, (owned unknowns, motions); 0 of none.

        Args:
            M: mass matrix at the state, with the rows of the clamp.
        """
        system, by_mode = self._system, self._system.by_mode
        mass = system.model.mechanics.damping.mass if EFFECT in system.model.effects else None
        if mass is None and by_mode is None:
            return 0.0
        rigid = system.root.carried(system.q.x.array)
        out: Array = np.zeros_like(rigid)
        if mass is not None:
            out += float(mass.value) * times(M, rigid)
        if by_mode is not None:
            out += by_mode.times(rigid)
        return out

    def __call__(self) -> Array | float:
        """Return the part of this process in their work in the unit motions at the state set, (motions,); 0 of none."""
        system, by_mode = self._system, self._system.by_mode
        if not self._by_mass and by_mode is None:
            return 0.0
        q, v = system.q.x.array, system.v.x.array
        owned = len(system.root.weights)
        force: Array = np.zeros(owned)
        if self._by_mass:
            force += system.sum_of(self._by_mass)[:owned]
        if by_mode is not None:
            force += by_mode.times(v[:owned])
        return np.asarray(force @ system.root.carried(q))
