"""Von Kármán type: stretch of the axis, linear shear and bending, Simo & Vu-Quoc 1986 eqs. (15), (19).

The axial strain is the elongation that Kane, Ryan & Banerjee take as a coordinate.
"""

from __future__ import annotations

from typing import Any

import ufl

from rotfem.mechanics.mindlin import PlateGradients


def planar_beam(q: Any) -> tuple[Any, Any, Any]:
    """Return (Gamma_1, Gamma_2, kappa) of q = (u_1, u_2, alpha): axial, shear (both 1) and bending (1/m) strain."""
    du1, du2, dalpha = (q[i].dx(0) for i in range(3))
    alpha = q[2]
    return ufl.sqrt((1 + du1) ** 2 + du2**2) - 1, du2 - alpha, dalpha


def spatial_beam(du: Any, theta: Any, dtheta: Any, e: Any) -> tuple[Any, Any]:
    """Return (Gamma, K), vectors (3,): Γ·e = |e + u'| − 1, else of first order (1), and K = θ' (1/m).

    Args:
        du: u' in frame components, as the result is.
        theta: θ.
        dtheta: θ'.
        e: unit tangent of the undeformed axis.
    """
    stretch = ufl.sqrt(ufl.dot(e + du, e + du))
    return du - ufl.cross(theta, e) + (stretch - 1 - ufl.dot(e, du)) * e, dtheta


def plate(q: Any) -> tuple[Any, Any, Any]:
    """Return membrane strain (1), transverse shear (1) and curvature (1/m) of q = (u_1, u_2, u_3, alpha_1, alpha_2).

    Simo & Vu-Quoc 1986 eq. (27) with the products of in-plane gradients that it lacks, shapes (2, 2), (2,), (2, 2):
    e + ½ (u_ρ,γ u_ρ,β − e²) + ½ u_3,γ u_3,β with e = u_(γ,β), then as in the linear theory.
    """
    p = PlateGradients(q)
    return p.stretch, p.dw - p.alpha, ufl.sym(p.dalpha)
