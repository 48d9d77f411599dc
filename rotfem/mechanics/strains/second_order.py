"""Second order: the exact strains expanded to second order, Simo & Vu-Quoc 1986 eq. (7), its kappa read as alpha'."""

from __future__ import annotations

from typing import Any

import ufl

from rotfem.mechanics.mindlin import PlateGradients


def planar_beam(q: Any) -> tuple[Any, Any, Any]:
    """Return (Gamma_1, Gamma_2, kappa) of q = (u_1, u_2, alpha): axial, shear (both 1) and bending (1/m) strain."""
    du1, du2, dalpha = (q[i].dx(0) for i in range(3))
    alpha = q[2]
    return du1 + alpha * du2 - alpha**2 / 2, du2 - alpha - alpha * du1, dalpha


def spatial_beam(du: Any, theta: Any, dtheta: Any, e: Any) -> tuple[Any, Any]:
    """Return (Gamma, K), vectors (3,): Γ = u' − θ×(e + u') + ½ θ×(θ×e) (1) and K = θ' − ½ θ×θ' (1/m).

    Args:
        du: u' in frame components, as the result is.
        theta: θ.
        dtheta: θ'.
        e: unit tangent of the undeformed axis.
    """
    Gamma = du - ufl.cross(theta, e + du) + 0.5 * ufl.cross(theta, ufl.cross(theta, e))
    return Gamma, dtheta - 0.5 * ufl.cross(theta, dtheta)


def plate(q: Any) -> tuple[Any, Any, Any]:
    """Return membrane strain (1), transverse shear (1) and curvature (1/m) of q = (u_1, u_2, u_3, alpha_1, alpha_2).

    Simo & Vu-Quoc 1986 eq. (26) with the products of in-plane gradients that it lacks, shapes (2, 2), (2,), (2, 2):
    e + ½ (u_ρ,γ u_ρ,β − e²) + ½ u_3,γ u_3,β − ½ γ_γ γ_β with e = u_(γ,β) and the linear shear γ_β = u_3,β − alpha_β,
    then γ_β − alpha_γ u_γ,β, then alpha_(γ,β).
    """
    p = PlateGradients(q)
    shear = p.dw - p.alpha
    return p.stretch - ufl.outer(shear, shear) / 2, shear - ufl.dot(p.alpha, p.du), ufl.sym(p.dalpha)
