"""Strain measures of the theories, one function for an order and a structure type (see `mechanics.theories`).

Of a planar beam, q = (u_1, u_2, alpha), a function returns (Gamma_1, Gamma_2, kappa): axial and shear (both 1) and
bending (1/m) strain. Of a spatial beam it returns (Gamma, K), vectors (3,) in frame components, 1 and 1/m, of u', θ, θ'
and the unit tangent e of the undeformed axis. Of a plate, q = (u_1, u_2, u_3, alpha_1, alpha_2), it returns membrane
strain (1), transverse shear (1) and curvature (1/m), shapes (2, 2), (2,) and (2, 2).

A plate lies in the plane (a_1, a_2); its unit director is t = a_3 where it is undeformed. alpha_1 and alpha_2 turn the
director one after the other, t = R_2(−alpha_1) R_1(alpha_2) a_3, so that to second order t = a_3 − alpha_γ a_γ −
½ |alpha|² a_3. The two angles meet a pole at alpha_2 = ±π/2; alpha_1 may go round. Where alpha_2 comes near it, both
are counted from another shape (see `rotfem.structures.reference_rotation`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import ufl
from ufl.algorithms import extract_coefficients
from ufl.constantvalue import Zero

from rotfem.mechanics.rotations import Turn


def _slopes(q: Any) -> tuple[Any, Any, Any, Any]:
    """Return u_1', u_2', alpha' and alpha of a planar beam."""
    return q[0].dx(0), q[1].dx(0), q[2].dx(0), q[2]


# --- mid-surface r and director t of a plate --------------------------------------------------------------------------


@dataclass(frozen=True)
class PlateGradients:
    """Gradients along the mid-surface.

    Attributes:
        q: the five unknowns.
    """

    q: Any

    @property
    def du(self) -> Any:
        """u_γ,β, shape (2, 2)."""
        return ufl.as_matrix([[along(self.q[i], j) for j in range(2)] for i in range(2)])

    @property
    def dw(self) -> Any:
        """u_3,β, shape (2,)."""
        return ufl.as_vector([along(self.q[2], j) for j in range(2)])

    @property
    def alpha(self) -> Any:
        """alpha_β, shape (2,)."""
        return ufl.as_vector([self.q[3], self.q[4]])

    @property
    def dalpha(self) -> Any:
        """alpha_γ,β, shape (2, 2)."""
        return ufl.as_matrix([[along(self.q[3 + i], j) for j in range(2)] for i in range(2)])

    @property
    def stretch(self) -> Any:
        """Strain of the mid-surface to second order, e + ½ (u_ρ,γ u_ρ,β − e²) + ½ u_3,γ u_3,β, shape (2, 2).

        In its plane it is the stretch U − 1 = (FᵀF)^½ − 1 to that order, with e = u_(γ,β): a turn ω adds ½ ω², as it
        does to the axial strain of a beam, but the stretch of a line is its first-order strain alone.
        """
        du, dw, e = self.du, self.dw, ufl.sym(self.du)
        return e + (ufl.dot(du.T, du) - ufl.dot(e, e)) / 2 + ufl.outer(dw, dw) / 2

    @property
    def dr(self) -> Any:
        """r_i,β, shape (3, 2)."""
        du, dw = self.du, self.dw
        return ufl.as_matrix([[1 + du[0, 0], du[0, 1]], [du[1, 0], 1 + du[1, 1]], [dw[0], dw[1]]])


def along(component: Any, j: int) -> Any:
    """Return ∂/∂x_j of one of the unknowns, 0 of one that is left out."""
    return 0 if isinstance(component, Zero) else component.dx(j)


def gradient(t: Any) -> Any:
    """Return t_i,β of a director, shape (3, 2), 0 of one that stands still."""
    return ufl.grad(t) if extract_coefficients(t) else ufl.zero(3, 2)


def triad(alpha: Any) -> tuple[Any, Any, Any]:
    """Return (t_1, t_2, t): a_1, a_2, a_3 turned by R_2(−alpha_1) R_1(alpha_2)."""
    c1, s1, c2, s2 = ufl.cos(alpha[0]), ufl.sin(alpha[0]), ufl.cos(alpha[1]), ufl.sin(alpha[1])
    return (ufl.as_vector((c1, 0, s1)), ufl.as_vector((-s1 * s2, c2, c1 * s2)), ufl.as_vector((-s1 * c2, -s2, c1 * c2)))


def director(alpha: Any, exact: bool = True) -> Any:
    """Return t, shape (3,); not exact: to second order in alpha, which is what a linear theory needs of it."""
    if exact:
        return triad(alpha)[2]
    return ufl.as_vector((-alpha[0], -alpha[1], 1 - ufl.dot(alpha, alpha) / 2))


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
    """
    p = PlateGradients(q)
    dr, t = p.dr, director(p.alpha) if t is None else t
    return (ufl.dot(dr.T, dr) - ufl.Identity(2)) / 2, ufl.dot(t, dr), -ufl.sym(ufl.dot(dr.T, gradient(t)))
