"""Geometrically exact: Reissner's strains, Simo & Vu-Quoc 1986 eq. (3)."""

from __future__ import annotations

from typing import Any

import ufl


def planar_beam(q: Any) -> tuple[Any, Any, Any]:
    """Return (Gamma_1, Gamma_2, kappa) of q = (u_1, u_2, alpha): axial, shear (both 1) and bending (1/m) strain."""
    du1, du2, dalpha = (q[i].dx(0) for i in range(3))
    c, s = ufl.cos(q[2]), ufl.sin(q[2])
    return (1 + du1) * c + du2 * s - 1, -(1 + du1) * s + du2 * c, dalpha
