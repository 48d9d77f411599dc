"""What the clamp of a nonlinear theory does in its unit motions, and in small motions about an equilibrium."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from ufl.algorithms import expand_derivatives

from rotfem.equations.hub_damping import HubDamping
from rotfem.mechanics.sums import added
from rotfem.numerics import forms

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
