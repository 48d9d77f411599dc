"""Strain measures of the theories, one function for an order and a structure type (see `mechanics.theories`).

Of a planar beam, q = (u_1, u_2, alpha), a function returns (Gamma_1, Gamma_2, kappa): axial and shear (both 1) and
bending (1/m) strain. Of a spatial beam it returns (Gamma, K), vectors (3,) in frame components, 1 and 1/m, of u', θ, θ'
and the unit tangent e of the undeformed axis. Of a plate, q = (u_1, u_2, u_3, alpha_1, alpha_2), it returns membrane
strain (1), transverse shear (1) and curvature (1/m), shapes (2, 2), (2,) and (2, 2).
"""

from __future__ import annotations

from typing import Any

import ufl

from rotfem.mechanics.mindlin import PlateGradients, director, gradient
from rotfem.mechanics.rotations import Turn


def _slopes(q: Any) -> tuple[Any, Any, Any, Any]:
    """Return u_1', u_2', alpha' and alpha of a planar beam."""
    return q[0].dx(0), q[1].dx(0), q[2].dx(0), q[2]


# --- first order: linear Timoshenko strains ---------------------------------------------------------------------------


def linear_planar_beam(q: Any) -> tuple[Any, Any, Any]:
    """Return Simo & Vu-Quoc 1986 eq. (5)."""
    du1, du2, dalpha, alpha = _slopes(q)
    return du1, du2 - alpha, dalpha


def linear_spatial_beam(du: Any, theta: Any, dtheta: Any, e: Any) -> tuple[Any, Any]:
    """Return Γ = u' − θ×e and K = θ'."""
    return du - ufl.cross(theta, e), dtheta


def linear_plate(q: Any) -> tuple[Any, Any, Any]:
    """Return Mindlin's u_(γ,β), u_3,β − alpha_β and alpha_(γ,β)."""
    p = PlateGradients(q)
    return ufl.sym(p.du), p.dw - p.alpha, ufl.sym(p.dalpha)


# --- second order: the exact strains expanded to second order ---------------------------------------------------------


def second_order_planar_beam(q: Any) -> tuple[Any, Any, Any]:
    """Return Simo & Vu-Quoc 1986 eq. (7), its kappa read as alpha'."""
    du1, du2, dalpha, alpha = _slopes(q)
    return du1 + alpha * du2 - alpha**2 / 2, du2 - alpha - alpha * du1, dalpha


def second_order_spatial_beam(du: Any, theta: Any, dtheta: Any, e: Any) -> tuple[Any, Any]:
    """Return Γ = u' − θ×(e + u') + ½ θ×(θ×e) and K = θ' − ½ θ×θ'."""
    Gamma = du - ufl.cross(theta, e + du) + 0.5 * ufl.cross(theta, ufl.cross(theta, e))
    return Gamma, dtheta - 0.5 * ufl.cross(theta, dtheta)


def second_order_plate(q: Any) -> tuple[Any, Any, Any]:
    """Return Simo & Vu-Quoc 1986 eq. (26) with the products of in-plane gradients that it lacks.

    e + ½ (u_ρ,γ u_ρ,β − e²) + ½ u_3,γ u_3,β − ½ γ_γ γ_β with e = u_(γ,β) and the linear shear γ_β = u_3,β − alpha_β,
    then γ_β − alpha_γ u_γ,β, then alpha_(γ,β).
    """
    p = PlateGradients(q)
    shear = p.dw - p.alpha
    return p.stretch - ufl.outer(shear, shear) / 2, shear - ufl.dot(p.alpha, p.du), ufl.sym(p.dalpha)


# --- von Kármán type: stretch of the axis, which Kane, Ryan & Banerjee take as a coordinate, linear shear and bending -


def von_karman_planar_beam(q: Any) -> tuple[Any, Any, Any]:
    """Return Simo & Vu-Quoc 1986 eqs. (15), (19)."""
    du1, du2, dalpha, alpha = _slopes(q)
    return ufl.sqrt((1 + du1) ** 2 + du2**2) - 1, du2 - alpha, dalpha


def von_karman_spatial_beam(du: Any, theta: Any, dtheta: Any, e: Any) -> tuple[Any, Any]:
    """Return Γ·e = |e + u'| − 1, else Γ of first order, and K = θ'."""
    stretch = ufl.sqrt(ufl.dot(e + du, e + du))
    return du - ufl.cross(theta, e) + (stretch - 1 - ufl.dot(e, du)) * e, dtheta


def von_karman_plate(q: Any) -> tuple[Any, Any, Any]:
    """Return Simo & Vu-Quoc 1986 eq. (27) with the products of in-plane gradients that it lacks.

    e + ½ (u_ρ,γ u_ρ,β − e²) + ½ u_3,γ u_3,β with e = u_(γ,β), then as in the linear theory.
    """
    p = PlateGradients(q)
    return p.stretch, p.dw - p.alpha, ufl.sym(p.dalpha)


# --- geometrically exact: Reissner's strains --------------------------------------------------------------------------


def reissner_planar_beam(q: Any) -> tuple[Any, Any, Any]:
    """Return Simo & Vu-Quoc 1986 eq. (3)."""
    du1, du2, dalpha, alpha = _slopes(q)
    c, s = ufl.cos(alpha), ufl.sin(alpha)
    return (1 + du1) * c + du2 * s - 1, -(1 + du1) * s + du2 * c, dalpha


def reissner_spatial_beam(du: Any, theta: Any, dtheta: Any, e: Any) -> tuple[Any, Any]:
    """Return Γ = Λᵀ(e + u') − e and K = axial(Λᵀ Λ'), Simo 1985."""
    turn = Turn(theta)
    return turn.rotate_back(e + du) - e, turn.material_rate(dtheta)


def reissner_plate(q: Any, t: Any = None) -> tuple[Any, Any, Any]:
    """Return ½ (r,γ·r,β − δ_γβ), r,β·t and −½ (r,γ·t,β + r,β·t,γ) with the unit director t.

    Simo & Fox 1989, the fully nonlinear plate of Simo & Vu-Quoc 1986.

    Args:
        q: unknowns.
        t: the director, where it is not simply that of alpha.
    """
    p = PlateGradients(q)
    dr, t = p.dr, director(p.alpha) if t is None else t
    return (ufl.dot(dr.T, dr) - ufl.Identity(2)) / 2, ufl.dot(t, dr), -ufl.sym(ufl.dot(dr.T, gradient(t)))
