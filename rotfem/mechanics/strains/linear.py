"""First order: linear Timoshenko strains, Simo & Vu-Quoc 1986 eq. (5)."""

from __future__ import annotations

from typing import Any

import ufl

from rotfem.mechanics.mindlin import PlateGradients


def planar_beam(q: Any) -> tuple[Any, Any, Any]:
    """Return (Gamma_1, Gamma_2, kappa) of q = (u_1, u_2, alpha): axial, shear (both 1) and bending (1/m) strain."""
    du1, du2, dalpha = (q[i].dx(0) for i in range(3))
    alpha = q[2]
    return du1, du2 - alpha, dalpha


def spatial_beam(du: Any, theta: Any, dtheta: Any, e: Any) -> tuple[Any, Any]:
    """Return (Gamma, K), vectors (3,): Γ = u' − θ×e (1) and K = θ' (1/m).

    Args:
        du: u' in frame components, as the result is.
        theta: θ.
        dtheta: θ'.
        e: unit tangent of the undeformed axis.
    """
    return du - ufl.cross(theta, e), dtheta


def plate(q: Any) -> tuple[Any, Any, Any]:
    """Return membrane strain (1), transverse shear (1) and curvature (1/m) of q = (u_1, u_2, u_3, alpha_1, alpha_2).

    Mindlin's: u_(γ,β), u_3,β − alpha_β, alpha_(γ,β), shapes (2, 2), (2,), (2, 2).
    """
    p = PlateGradients(q)
    return ufl.sym(p.du), p.dw - p.alpha, ufl.sym(p.dalpha)
