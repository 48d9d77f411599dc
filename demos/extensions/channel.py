"""A section of a user's own whose shear centre is not its centroid: the channel, thin-walled.

The web stands along axis 3 at y = 0, flanges of the given width go from its ends along axis 2, all of one thickness.
The shear centre is at y = −3 b²/(6 b + h) (Timoshenko & Gere, Mechanics of Materials, 1972, section 8.10), the
centroid at b²/(2 b + h).
"""

import numpy as np

from rotfem import Geometry, Shape, register


def geometry(nu, web, flange, thickness):
    """Return the properties of thin walls along their middle lines."""
    h, b, t = web, flange, thickness
    area = t * (h + 2 * b)
    y = b**2 / (2 * b + h)
    return Geometry(
        area=area,
        second_moment2=t * h**3 / 12 + b * t * h**2 / 2,
        second_moment3=2 * t * b**3 / 3 - area * y**2,
        torsion_constant=(h + 2 * b) * t**3 / 3,
        shear_correction=h * t / area,
        centroid=(y, np.zeros_like(y)),
        shear_center=(-3 * b**2 / (6 * b + h), np.zeros_like(y)),
    )


register(Shape("channel", ("web", "flange", "thickness"), geometry))
