"""Geometrically exact: Reissner's strains, Simo & Vu-Quoc 1986 eq. (3)."""

from __future__ import annotations

from typing import Any

import ufl

from rotfem.mechanics.mindlin import PlateGradients, director, gradient
from rotfem.mechanics.rotations import Turn


def planar_beam(q: Any) -> tuple[Any, Any, Any]:
    """Return (Gamma_1, Gamma_2, kappa) of q = (u_1, u_2, alpha): axial, shear (both 1) and bending (1/m) strain."""
    du1, du2, dalpha = (q[i].dx(0) for i in range(3))
    c, s = ufl.cos(q[2]), ufl.sin(q[2])
    return (1 + du1) * c + du2 * s - 1, -(1 + du1) * s + du2 * c, dalpha


def spatial_beam(du: Any, theta: Any, dtheta: Any, e: Any) -> tuple[Any, Any]:
    """Return (Gamma, K), vectors (3,): Γ = Λᵀ(e + u') − e (1) and K = axial(Λᵀ Λ') (1/m), Simo 1985.

    Args:
        du: u' in frame components, as the result is.
        theta: θ.
        dtheta: θ'.
        e: unit tangent of the undeformed axis.
    """
    turn = Turn(theta)
    return turn.rotate_back(e + du) - e, turn.material_rate(dtheta)


def plate(q: Any, t: Any = None) -> tuple[Any, Any, Any]:
    """Return membrane strain (1), transverse shear (1) and curvature (1/m) of q = (u_1, u_2, u_3, alpha_1, alpha_2).

    ½ (r,γ·r,β − δ_γβ), r,β·t and −½ (r,γ·t,β + r,β·t,γ) with the unit director t, shapes (2, 2), (2,), (2, 2): Simo &
    Fox 1989, the fully nonlinear plate of Simo & Vu-Quoc 1986.

    Args:
        q: unknowns.
        t: the director, where it is not simply that of alpha.
    """
    p = PlateGradients(q)
    dr, t = p.dr, director(p.alpha) if t is None else t
    return (ufl.dot(dr.T, dr) - ufl.Identity(2)) / 2, ufl.dot(t, dr), -ufl.sym(ufl.dot(dr.T, gradient(t)))
