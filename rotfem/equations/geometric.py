"""The geometric stiffness ∫ σ⁰·D²Γ, and the work of linear forces in second-order strains."""

from __future__ import annotations

from typing import Any

import ufl
from ufl.algorithms import expand_derivatives

from rotfem.equations.model import Model
from rotfem.mechanics.theories import Theory, richest
from rotfem.numerics import forms


def geometric_stiffness(model: Model, state: tuple[Any, Any], u: Any, w: Any, theory: Theory) -> Any:
    """Return ∫ σ⁰·D²Γ[u, w] at rest, a UFL form: of N⁰ alone, or of all stress resultants (`Model.prestresses`).

    It is 0 where no active component makes such forces.

    Args:
        model: whose strains have the forces σ⁰.
        state: the function q of its displacements (m, rad), and what σ⁰ is of in its place.
        u: a displacement, or an argument of the form.
        w: another.
        theory: with the second-order strains Γ that σ⁰ works on.
    """
    q, base = state
    s = model.structure
    out: Any = 0
    second = model.strains(theory.prestress_measures(s.type))
    for first, higher in zip(model.mechanics.strains, second, strict=True):
        if model.prestresses(first):
            force = first.force(ufl.replace(first.value, {q: base}))
            curvature = ufl.derivative(ufl.derivative(higher.value, q, u), q, w)
            out += ufl.inner(force, forms.without(curvature, q)) * higher.measure
    return 0 if isinstance(out, int) or expand_derivatives(out).empty() else out


def second_order_work(model: Model, displacements: tuple[Any, Any], test: Any) -> Any:
    """Return ∫ N(δq)·D²Γ[a, b] at rest, a UFL form, with all exact strains Γ and the forces N of a linear theory."""
    s, out = model.structure, 0
    q, exact = s.k.functions[0], {strain.name: strain.value for strain in model.strains(richest().measures(s.type))}
    for strain in model.mechanics.strains:
        force = strain.force(ufl.replace(strain.value, {q: test}))
        at_rest = forms.first_branches(exact[strain.name])  # at rest the other branches of its rotations divide by zero
        second = ufl.derivative(ufl.derivative(at_rest, q, displacements[0]), q, displacements[1])
        out += ufl.inner(force, forms.without(second, q)) * strain.measure
    return out
