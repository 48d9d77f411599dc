"""The geometric stiffness ∫ σ⁰·D²Γ: what the forces of a loaded state do in further displacements.

And what the stiff strains have of third order in displacements, which the forces of a linear structure work on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
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


def second_order_work(model: Model, displacements: Sequence[Any], test: Any) -> Any:
    """Return ∫ N(δq)·D²Γ[a, b] at rest, a UFL form, with all exact strains Γ and the forces N of a linear theory.

    Args:
        model: of a linear theory.
        displacements: a and b, functions of the unknowns.
        test: δq.
    """
    return _work_of(model, test, lambda strain, at: _along(strain, at, *displacements))


def third_order_work(model: Model, displacements: Sequence[Any], test: Any) -> Any:
    """Return ∫ N(δq)·(D³Γ[a, b, c] + D²Γ[d, e]) at rest, a UFL form, with all exact strains Γ.

    Args:
        model: of a linear theory, whose forces N are.
        displacements: a, b, c, d and e, functions of the unknowns.
        test: δq.
    """
    first, second = displacements[:3], displacements[3:]
    return _work_of(model, test, lambda strain, at: _along(strain, at, *first) + _along(strain, at, *second))


def fourth_order_work(model: Model, displacements: Sequence[Any], test: Any) -> Any:
    """Return ∫ N(δq)·Γ₄, a UFL form: what is of fourth order in x of the exact strains Γ[x + y + z] at rest.

    Args:
        model: of a linear theory, whose forces N are.
        displacements: x, and y and z that are of second and third order in it, functions of the unknowns.
        test: δq.
    """
    x, y, z = displacements

    def fourth(strain: Any, at: Any) -> Any:
        mixed = _along(strain, at, x, x, y) / 2 + _along(strain, at, y, y) / 2 + _along(strain, at, x, z)
        return _along(strain, at, x, x, x, x) / 24 + mixed

    return _work_of(model, test, fourth)


def _along(strain: Any, q: Any, *directions: Any) -> Any:
    for direction in directions:
        strain = ufl.derivative(strain, q, direction)
    return strain


def _work_of(model: Model, test: Any, change: Callable[[Any, Any], Any]) -> Any:
    """Return the work of the forces of δq in a change at rest of all exact strains, (Γ, q) ↦ change."""
    s, out = model.structure, 0
    q, exact = s.k.functions[0], {strain.name: strain.value for strain in model.strains(richest().measures(s.type))}
    for strain in model.mechanics.strains:
        force = strain.force(ufl.replace(strain.value, {q: test}))
        at_rest = forms.first_branches(exact[strain.name])
        out += ufl.inner(force, forms.without(change(at_rest, q), q)) * strain.measure
    return out
