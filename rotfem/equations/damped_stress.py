"""Stress resultants with what damping adds to them, where a state is written into a system.

Kelvin–Voigt and the stiffness part of Rayleigh damping are stresses, η C Γ̇. Damping by mode is one of modes of the
structure at rest, and so carried by the stresses that it has when it is displaced by

    w = Σ_j (2 ζ_j/ω_j) φ_j (φ_jᵀ M v),    for K φ_j = ω_j² M φ_j makes K w = C v

(see `rotfem.equations.modal_damping`). The mass part of Rayleigh damping is no stress.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from rotfem.numerics import forms

Array = npt.NDArray[np.float64]


class DampedStress:
    """Adds to stress resultants what damping makes of them.

    Args:
        system: equations of motion of a structure, the hub held.
    """

    def __init__(self, system: Any):
        self._system = system
        self._displaced = None if system.by_mode is None else fem.Function(system.V)

    def of(self, force: Any) -> Any:
        """Return a resultant, a UFL expression of the unknowns, with damping."""
        return sum(self._parts(force, self._system.v), start=force)

    def change(self, force: Any, dq: Any, dv: Any) -> Any:
        """Return what small q and v about a state at rest, two functions, add to a resultant with damping."""
        return sum(self._parts(force, dv), start=ufl.derivative(force, self._system.q, dq))

    def _parts(self, force: Any, v: Any) -> list[Any]:
        """Return what damping adds to a resultant at velocities v, a function, and those of `update`."""
        viscosity, q, out = self._system.model.mechanics.damping.stiffness, self._system.q, list[Any]()
        if viscosity is not None:
            out.append(viscosity * ufl.derivative(force, q, v))
        if self._displaced is not None:
            at_rest = forms.first_branches(force)  # at rest the other branches of its rotations divide by zero
            out.append(forms.without(ufl.derivative(at_rest, q, self._displaced), q))
        return out

    def update(self, v: Array) -> None:
        """Take the velocities of the owned unknowns; all processes come here together."""
        if self._displaced is not None:
            w, part = self._displaced.x, self._system.by_mode
            w.array[: len(part.B)] = part.displaced(v[: len(part.B)])
            w.scatter_forward()
