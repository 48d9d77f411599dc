"""The mid-surface r and unit director t of a Mindlin plate, q = (u_1, u_2, u_3, alpha_1, alpha_2), as UFL expressions.

The plate lies in the plane (a_1, a_2); t = a_3 where it is undeformed. alpha_1 and alpha_2 turn the director one after
the other, t = R_2(−alpha_1) R_1(alpha_2) a_3, so that to second order t = a_3 − alpha_γ a_γ − ½ |alpha|² a_3. The two
angles meet a pole at alpha_2 = ±π/2; alpha_1 may go round. Where alpha_2 comes near it, both are counted from another
shape (see `rotfem.structures.reference_rotation`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import ufl
from ufl.algorithms import extract_coefficients
from ufl.constantvalue import Zero


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
