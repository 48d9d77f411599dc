"""How a form changes with the speed of the frame: the column of a free hub's angle in the tangent."""

from __future__ import annotations

from typing import Any

import ufl
from ufl.algorithms import expand_derivatives
from ufl.algorithms.analysis import extract_constants

from rotfem.mechanics.sums import added


class BySpin:
    """c_v ∂/∂Omega + c_m ∂/∂Omega' of a form, the speed along the axis of the motion varied.

    Args:
        model: the constants of the frame.
        form: UFL form; only its integrals with the speed or its rate are differentiated.

    Attributes:
        ufl: the derivative, a UFL form; None if the speed is not in the form.
    """

    def __init__(self, model: Any, form: Any):
        self._factors = [model.structure.constant(0.0) for _ in range(2)]
        parts, expanded = [], expand_derivatives(form)
        for name, factor in zip(("w", "dw"), self._factors, strict=True):
            constant = model.frame.constants.get(name)
            if constant is None:
                continue
            within = [part for part in expanded.integrals() if constant in extract_constants(part.integrand())]
            s = ufl.variable(model.structure.constant(0.0))
            axis = model.motion.axis[-constant.value.size :]
            shifted = ufl.as_vector([constant[i] + s * float(e) for i, e in enumerate(axis)])
            derivative = expand_derivatives(ufl.diff(ufl.replace(ufl.Form(within), {constant: shifted}), s))
            if not derivative.empty():
                parts.append(factor * derivative)
        self.ufl = added(parts) if parts else None

    def set(self, c_v: float, c_m: float) -> None:
        """Set the factors."""
        for constant, value in zip(self._factors, (c_v, c_m), strict=True):
            constant.value = value
