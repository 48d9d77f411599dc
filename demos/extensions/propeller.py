"""A structure of a user's own: a design, propeller blades by their diameter, which stand for a spatial beam."""

from math import atan2, pi

from rotfem import StructureKind, register


def table(diameter, pitch, E, rho, nu=0.3, hub=0.15, chord=0.1, thickness=0.12):
    """Return the [structure] table of a blade of constant geometric pitch.

    Args:
        diameter: m.
        pitch: advance of a turn, m.
        E, rho, nu: material.
        hub, chord: radius of the hub and chord, parts of the radius.
        thickness: part of the chord.
    """
    radius = diameter / 2
    root, width = hub * radius, chord * radius
    places = [root + (radius - root) * i / 8 for i in range(9)]
    return {
        "type": "spatial_beam",
        "length": radius - root,
        "hub_radius": root,
        "pretwist": [[r - root, atan2(pitch, 2 * pi * r)] for r in places],
        "section": {
            "shape": "rectangle",
            "width": width,
            "height": thickness * width,
            "E": E,
            "nu": nu,
            "rho": rho,
        },
    }


register(StructureKind("propeller", table))
