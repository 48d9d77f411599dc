"""The geometric stiffness ∫ σ⁰·D²Γ: what the forces of a loaded state do in further displacements."""

from __future__ import annotations

from typing import Any

import ufl

from rotfem.equations.model import Model
from rotfem.mechanics.theories import Theory
from rotfem.numerics import forms


def geometric_stiffness(
    model: Model, state: tuple[Any, Any], u: Any, w: Any, theory: Theory, along: Any | None = None
) -> Any:
    """Return ∫ σ⁰·D²Γ[u, w] at rest, a UFL form: of N⁰ alone, or of all stress resultants (`Model.prestresses`).

    Args:
        model: whose strains have the forces σ⁰.
        state: the function q of its displacements (m, rad), and what σ⁰ is of in its place.
        u: a displacement, or an argument of the form.
        w: another.
        theory: with the second-order strains Γ that σ⁰ works on.
        along: function of the unknowns that u and w are of, where these are not those of q; zero in σ⁰.
    """
    q, base = state
    others = () if along is None else (along,)
    of = q if along is None else along
    s, out = model.structure, 0
    second = model.strains(theory.prestress_measures(s.type))
    for first, higher in zip(model.mechanics.strains, second, strict=True):
        if model.prestresses(first):
            force = first.force(ufl.replace(first.value, {q: base}))
            force = forms.without(force, *others) if others else force
            curvature = ufl.derivative(ufl.derivative(higher.value, of, u), of, w)
            out += ufl.inner(force, forms.without(curvature, q, *others)) * higher.measure
    return out
