"""Cross-section shapes: area, second moments, torsion constant and shear correction from the dimensions.

Section axes: 2 is along the width, 3 along the height. For a planar beam the height lies in the plane of bending.
Shear corrections are those of G. R. Cowper, "The shear coefficient in Timoshenko's beam theory",
J. Appl. Mech. 33 (1966) 335-340, table 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from rotfem.registry import Registry, register
from rotfem.registry import shapes as registered
from rotfem.scene.values import Array

#: Keys of a section that has a shape, in addition to its dimensions.
MATERIAL_AND_SHAPE = ("E", "nu", "rho", "shape")

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
        centroid: (y, z) of the centroid (m), which mass and tension centre are; None where the section axes meet. The
            second moments are about axes through it.
        shear_center: (y, z) of the shear centre (m); None where the section axes meet.
    """

    area: Array
    second_moment2: Array
    second_moment3: Array
    torsion_constant: Array
    shear_correction: Array
    centroid: tuple[Array, Array] | None = None
    shear_center: tuple[Array, Array] | None = None


@dataclass(frozen=True)
class Shape:
    """A shape of cross-sections, which a section table names and gives the dimensions of.

    Attributes:
        name: what a scene calls it.
        dimensions: keys of its dimensions (m), each a number or a taper greater than 0.
        geometry: (nu, **dimensions) ↦ properties; ν and the dimensions are arrays over positions along the beam.
        alternatives: further complete sets of keys, any of which may be given instead of `dimensions`.
        check: dimensions ↦ what is allowed, by name of those that are not; called with their values at all knots.
        may_vanish: dimensions that may be 0.
    """

    registry: ClassVar[Registry[Shape]] = registered

    name: str
    dimensions: tuple[str, ...]
    geometry: Callable[..., Geometry]
    alternatives: tuple[tuple[str, ...], ...] = ()
    check: Callable[..., dict[str, str]] = lambda **dimensions: {}
    may_vanish: tuple[str, ...] = ()

    @property
    def choices(self) -> tuple[tuple[str, ...], ...]:
        """All complete sets of dimensions."""
        return self.dimensions, *self.alternatives


def rectangle(nu: Array, width: Array, height: Array) -> Geometry:
    """Return the geometry of a solid rectangle, shear correction 10(1+ν)/(12+11ν).

    The torsion constant is Saint-Venant's series (Timoshenko & Goodier, Theory of Elasticity, §109)
    J = (a b³/3) [1 − (192/π⁵)(b/a) Σ_{n odd} tanh(nπa/2b)/n⁵] with a ≥ b. The width is along axis 2.
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


def circle(nu: Array, radius: Array) -> Geometry:
    """Return the geometry of a solid circle of the given radius (m), shear correction 6(1+ν)/(7+6ν)."""
    return tube(nu, radius, np.zeros_like(radius))


def tube(nu: Array, outer_radius: Array, inner_radius: Array | None = None, wall: Array | float = 0.0) -> Geometry:
    """Return the geometry of a hollow circle.

    The shear correction is 6(1+ν)(1+m²)² / [(7+6ν)(1+m²)² + (20+12ν)m²] with m = inner/outer radius.
    There is a wall thickness (m) where there is no inner radius.
    """
    inner_radius = outer_radius - wall if inner_radius is None else inner_radius
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


def _hole_fits(outer_radius: Array, **hole: Array) -> dict[str, str]:
    """Return what is allowed of an inner radius or a wall thickness that leaves no hole, or no tube."""
    return {key: "must be less than outer_radius everywhere" for key, r in hole.items() if np.any(r >= outer_radius)}


for _shape in (
    Shape("rectangle", ("width", "height"), rectangle),
    Shape("circle", ("radius",), circle),
    Shape("tube", ("outer_radius", "inner_radius"), tube, (("outer_radius", "wall"),), _hole_fits, ("inner_radius",)),
):
    register(_shape)
