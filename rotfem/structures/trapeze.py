"""The trapeze effect of a section: fibers beside the axis of twist are stretched by it, so tension resists it.

A fiber at (y, z) from the axis of twist becomes a helix under a rate of twist K₁, longer by ½ K₁² (y² + z²) (Wagner
1929; Biot 1939). The mean of that over the section, weighed by E, adds

    ½ r² K₁² + k⁰ (r² − J/A) K₁,        r² = ∫E (y² + z²) dA / ∫E dA,

to the axial strain, so that an axial force N makes the torsional stiffness GJ + N r². The second part is that of a beam
with the pretwist k⁰ = dφ/dX, whose fibers are helices at rest, ½ r² [(k⁰ + K₁)² − k⁰²], less what the warping of the
section takes of them (Krenk, Int. J. Solids Struct. 19 (1983) 67): nothing is left of it in a circle, where pretwist
means nothing, all of it in a thin strip. The axis of twist is that of the shear centers. What twist makes of the
strains over the section beside their mean, a stiffness of fourth order in the width, is left out.
"""

from __future__ import annotations

from typing import Any

from rotfem.mechanics.bodies import Gain


def stretch_by_twist(radius_squared: Any, twist: Any, pretwist: Any, warping: Any = 0) -> Gain:
    """Return what twist adds to the mean axial strain of a section (1).

    Args:
        radius_squared: r² (m²).
        twist: K₁ (1/m).
        pretwist: k⁰ (1/m); the number 0 without.
        warping: J/A (m²).
    """
    first = 0 if isinstance(pretwist, int) else pretwist * (radius_squared - warping) * twist
    return Gain(first, radius_squared * twist**2 / 2)


def radius_of(C: Any) -> Any:
    """Return r² (m²) of a section stiffness (6, 6), r from its shear center.

    Of the moments about the tension center and the distance of both centers.

    Args:
        C: symmetric, strains in the order (Γ₁, Γ₂, Γ₃, K₁, K₂, K₃); entries are expressions or arrays, or the number 0.
    """
    EA = C[0][0]
    shares = [0 if isinstance(c, int) else c / EA for c in C[0]]
    bending = C[4][4] / EA - shares[4] ** 2 + C[5][5] / EA - shares[5] ** 2
    y, z = -shares[5], shares[4]
    if not (isinstance(C[1][3], int) and isinstance(C[2][3], int)):  # the shear strains of a twist without shear force
        shear = C[1][1] * C[2][2] - C[1][2] ** 2
        z = z + (C[1][3] * C[2][2] - C[2][3] * C[1][2]) / shear
        y = y - (C[2][3] * C[1][1] - C[1][3] * C[1][2]) / shear
    return bending + y**2 + z**2
