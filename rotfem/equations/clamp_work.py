"""What the clamp of a nonlinear theory does in its unit motions, and in small motions about an equilibrium.

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
import ufl
from ufl.algorithms import expand_derivatives

from rotfem.equations.modal_damping import EFFECT
from rotfem.mechanics import work
from rotfem.mechanics.sums import added
from rotfem.mechanics.work import Variation
from rotfem.numerics import forms
from rotfem.numerics.projection import times


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


Array = npt.NDArray[np.float64]


class ClampWork:
    """The forces that hold the clamped unknowns, in the unit motions of `rotfem.structures.root_reaction`.

    Args:
        system: equations of motion of the structure.
    """

    def __init__(self, system: Any):
        self._system, weights = system, system.root.weights
        fixed = np.zeros((len(weights), 1), dtype=bool)
        fixed[system.clamped] = True
        self._motions: Array = weights[system.clamped]
        self._held, self._turns = np.where(fixed, weights, 0.0), np.where(fixed, 0.0, weights)  # those of hinges
        self._damping = HubDamping(system)

    def __call__(self, residual: Array) -> Array:
        """Return the part of this process in their work at the state set, (motions,), of F with its clamped rows."""
        system = self._system
        held = np.asarray(residual[system.clamped] @ self._motions) - self._damping()
        if not self._springs:
            return held
        forces = system.sum_of(self._springs)[: len(self._turns)]
        return np.asarray(held - forces @ self._turns)  # against the turns of hinges the root is held

    @cached_property
    def _springs(self) -> list[Any]:
        """The work of springs and dampers of the root, compiled; empty where it has none that unknowns move."""
        terms = self._terms
        return [forms.form(added(terms), once=True)] if terms else []

    @property
    def _terms(self) -> list[Any]:
        model = self._system.model
        terms = [term for name, term in model.terms.items() if model.acting[name].at_root]
        return [term for term in terms if not expand_derivatives(term).empty()]  # of turns that are left out

    def tangents(self) -> tuple[Array, Array, Array]:
        """Return the derivatives of these forces to q, v and a about an equilibrium, (unknowns, motions) each."""
        system = self._system
        wholes = {kind: system.whole(kind) for kind in "KCM"}
        K, C, M = (rows_times(wholes[kind], self._held) for kind in "KCM")
        if self._springs:
            du, terms = ufl.TrialFunction(system.V), added(self._terms)
            for part, x in ((K, system.q), (C, system.v)):
                slope = forms.form(ufl.derivative(terms, x, du), once=True)
                part -= rows_times(system.whole_of([slope]), self._turns)
        return K, C - self._damping.tangent(wholes["M"]), M


def rows_times(A: Any, columns: Array) -> Array:
    """Return Aᵀ times owned columns (n, m) of a PETSc matrix, owned rows; zero of None."""
    out: Array = np.zeros_like(columns)
    if A is not None:
        x, y = A.createVecs()
        for product, column in zip(out.T, columns.T, strict=True):
            x.array[:] = column
            A.multTranspose(x, y)
            product[:] = y.array
    return out
