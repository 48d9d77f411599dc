"""A section of a user's own: the ellipse.

Shear correction of G. R. Cowper, J. Appl. Mech. 33 (1966) 335–340, table 1, for shear along axis 3.
"""

from math import pi

from rotfem import Geometry, Shape, register


def geometry(nu, semi_axis_2, semi_axis_3):
    """Return the properties of an ellipse with semi-axes b along axis 2 and a along axis 3, the plane of bending."""
    b, a = semi_axis_2, semi_axis_3
    numerator = 12 * (1 + nu) * a**2 * (3 * a**2 + b**2)
    return Geometry(
        area=pi * a * b,
        second_moment2=pi * a**3 * b / 4,
        second_moment3=pi * a * b**3 / 4,
        torsion_constant=pi * a**3 * b**3 / (a**2 + b**2),
        shear_correction=numerator / ((40 + 37 * nu) * a**4 + (16 + 10 * nu) * a**2 * b**2 + nu * b**4),
    )


register(Shape("ellipse", ("semi_axis_2", "semi_axis_3"), geometry))
