"""Stresses of their own at the integration points, for the geometric part of Newton's tangent.

In a slender structure the stress of a state on Newton's way, C Γ(q), is nothing like the one it is on its way to: a
correction that turns sections also stretches the axis, by half the square of the turn, and EA makes a large force of
that, of any sign, which goes with the next correction. With the stresses as unknowns beside q (mixed integration point
Newton: Magisano, Leonetti & Garcea, Int. J. Numer. Meth. Eng. 112 (2017) 1237) a correction d from q_k gives them as

    σ_{k+1} = C (Γ(q_k) + DΓ(q_k)[d]),        q_{k+1} = q_k + d,

linear in d as q is. Eliminated point by point they leave the residual as it is, and of the tangent only change the part
that has the stress in it: ∫ σ_{k+1}·D²Γ in the place of ∫ C Γ(q_{k+1})·D²Γ. Where d is small both are the same, so the
solution is, and the quadratic convergence; the iterations are far fewer, and the steps that converge far longer.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from rotfem.mechanics.work import Mechanics

Array = npt.NDArray[np.float64]


class PointStresses:
    """The stresses that the last correction gave, and what they change in K.

    Args:
        mechanics: strains, and the unknowns they are of.
        V: space of the unknowns.
    """

    def __init__(self, mechanics: Mechanics, V: fem.FunctionSpace):
        self.mechanics = mechanics
        self._q, self._v, *_ = mechanics.k.functions
        self._before, self._step = fem.Function(V), fem.Function(V)
        self._now, self._p, self._d = (x.x.array for x in (self._q, self._before, self._step))

    def come_from(self, before: Array) -> None:
        """Say which q (local dof array) a correction led from to the one that is set."""
        self._p[:] = before
        np.subtract(self._now, self._p, out=self._d)

    def change(self, trial: Any, c_v: Any = None) -> Any:
        """Return ∫ (σ − C Γ(q))·D²Γ[trial, δq], a UFL form: what is to be added to K.

        A viscous stress C η Γ̇ = C η DΓ(q)[v] is taken the same way, with DΓ(q_k)[v_{k+1}] + D²Γ(q_k)[v_k, d].

        Args:
            trial: direction of the derivative.
            c_v: ∂v/∂q of the step, a constant (1/s); None of a system at rest, where nothing is viscous.
        """
        k, out, viscosity = self.mechanics.k, 0, self.mechanics.damping.stiffness
        for s in self.mechanics.strains:
            before = ufl.replace(s.value, {self._q: self._before})
            stressed = before + ufl.derivative(before, self._before, self._step) - s.value
            if viscosity is not None and c_v is not None:
                rate, moved = (ufl.derivative(before, self._before, x) for x in (self._v, self._step))
                # v_k = v_{k+1} − c_v d
                rate += ufl.derivative(rate, self._before, self._step) - c_v * ufl.derivative(
                    moved, self._before, self._step
                )
                stressed += viscosity * (rate - k.rate(s.value))
            bent = ufl.derivative(k.variation(s.value), self._q, trial)
            out += ufl.inner(s.force(stressed), bent) * s.measure
        return out
