"""Cross-section shapes: area, second moments, torsion constant and shear correction from the dimensions.

Section axes: 2 is along the width, 3 along the height. For a planar beam the height lies in the plane of bending.
Shear corrections are those of G. R. Cowper, "The shear coefficient in Timoshenko's beam theory",
J. Appl. Mech. 33 (1966) 335-340, table 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotfem.scene.values import Array

# tanh(nπa/2b)/n⁵ falls so fast that the terms left out are below 1e-9 of the sum.
_ODD = np.arange(1, 60, 2, dtype=np.float64)


@dataclass(frozen=True)
class Geometry:
    """Properties of a cross-section, each an array over positions along the beam.

    Attributes:
        area: A (m²).
        second_moment2: ∫ z² dA about axis 2 (m⁴), z along the height.
        second_moment3: ∫ y² dA about axis 3 (m⁴), y along the width.
        torsion_constant: Saint-Venant's J (m⁴).
        shear_correction: Cowper's coefficient.
    """

    area: Array
    second_moment2: Array
    second_moment3: Array
    torsion_constant: Array
    shear_correction: Array


def rectangle(width: Array, height: Array, nu: Array) -> Geometry:
    """Returns the geometry of a solid rectangle, shear correction 10(1+ν)/(12+11ν).

    The torsion constant is Saint-Venant's series (Timoshenko & Goodier, Theory of Elasticity, §109)
    J = (a b³/3) [1 − (192/π⁵)(b/a) Σ_{n odd} tanh(nπa/2b)/n⁵] with a ≥ b.

    Args:
        width: Side along axis 2 (m).
        height: Side along axis 3 (m).
        nu: Poisson's ratio.
    """
    a, b = np.maximum(width, height), np.minimum(width, height)
    series = np.sum(np.tanh(_ODD * np.pi * (a / (2.0 * b))[..., None]) / _ODD**5, axis=-1)
    return Geometry(
        area=width * height,
        second_moment2=np.asarray(width * height**3 / 12.0, dtype=np.float64),
        second_moment3=np.asarray(height * width**3 / 12.0, dtype=np.float64),
        torsion_constant=a * b**3 / 3.0 * (1.0 - 192.0 / np.pi**5 * (b / a) * series),
        shear_correction=10.0 * (1.0 + nu) / (12.0 + 11.0 * nu),
    )


def circle(radius: Array, nu: Array) -> Geometry:
    """Returns the geometry of a solid circle of the given radius (m), shear correction 6(1+ν)/(7+6ν)."""
    return tube(radius, np.zeros_like(radius), nu)


def tube(outer_radius: Array, inner_radius: Array, nu: Array) -> Geometry:
    """Returns the geometry of a hollow circle.

    The shear correction is 6(1+ν)(1+m²)² / [(7+6ν)(1+m²)² + (20+12ν)m²] with m = inner/outer radius.

    Args:
        outer_radius: Outer radius (m).
        inner_radius: Inner radius (m).
        nu: Poisson's ratio.
    """
    second_moment = np.pi / 4.0 * (outer_radius**4 - inner_radius**4)
    m2 = (inner_radius / outer_radius) ** 2
    k = 6.0 * (1.0 + nu) * (1.0 + m2) ** 2 / ((7.0 + 6.0 * nu) * (1.0 + m2) ** 2 + (20.0 + 12.0 * nu) * m2)
    return Geometry(
        area=np.pi * (outer_radius**2 - inner_radius**2),
        second_moment2=second_moment,
        second_moment3=second_moment,
        torsion_constant=2.0 * second_moment,
        shear_correction=k,
    )
