"""Stress resultants with what damping adds to them, where a state is written into a system.

Kelvin–Voigt and the stiffness part of Rayleigh damping are stresses, η C Γ̇. Damping by mode is one of modes of the
structure at rest, and so carried by the stresses that it has when it is displaced by

    w = Σ_j (2 ζ_j/ω_j) φ_j (φ_jᵀ M v),    for K φ_j = ω_j² M φ_j makes K w = C v

(see `rotfem.equations.modal_damping`). The mass part of Rayleigh damping is no stress.
"""

from __future__ import annotations

from typing import Any

import ufl
from dolfinx import fem

from rotfem.numerics import forms


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
        m, out = self._system.model.mechanics, force
        if m.damping.stiffness is not None:
            out = out + m.damping.stiffness * m.k.rate(force)
        if self._displaced is not None:
            out = out + forms.without(ufl.derivative(force, m.k.q, self._displaced), m.k.q)
        return out

    def update(self) -> None:
        """Take the velocities of the state that is written into the system; all processes come here together."""
        if self._displaced is not None:
            w, part = self._displaced.x, self._system.by_mode
            owned = len(part.B)
            w.array[:owned] = part.displaced(self._system.v.x.array[:owned])
            w.scatter_forward()
