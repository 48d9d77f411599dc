"""Second order: the exact strains expanded to second order, Simo & Vu-Quoc 1986 eq. (7), its kappa read as alpha'."""

from __future__ import annotations

from typing import Any


def planar_beam(q: Any) -> tuple[Any, Any, Any]:
    """Return (Gamma_1, Gamma_2, kappa) of q = (u_1, u_2, alpha): axial, shear (both 1) and bending (1/m) strain."""
    du1, du2, dalpha = (q[i].dx(0) for i in range(3))
    alpha = q[2]
    return du1 + alpha * du2 - alpha**2 / 2, du2 - alpha - alpha * du1, dalpha
