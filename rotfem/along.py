"""Along a structure: which places (m) are one, and what sections of beams and points of plates have."""

from __future__ import annotations

from collections.abc import Iterable

#: Part of the length within which two places are one: of a shorter element the stiffness would be round-off to others.
ONE = 1e-7

#: Length of a jump in time, as a part of the largest time of its table.
JUMP = 1e-11

#: Type of a beam ↦ its stress resultants at a section (N, N·m), and the strains that they are conjugate to (1, 1/m).
FORCES = {"planar_beam": ("N", "Q", "M"), "spatial_beam": ("N", "Q2", "Q3", "T", "M2", "M3")}
STRAINS = {
    "planar_beam": ("gamma1", "gamma2", "kappa"),
    "spatial_beam": ("gamma1", "gamma2", "gamma3", "kappa1", "kappa2", "kappa3"),
}
#: Turn of a section about the bent axis, rad.
TWIST: dict[str, tuple[str, ...]] = {"planar_beam": (), "spatial_beam": ("twist",)}
#: The same of a plate: membrane forces and shear forces (N/m), moments (N), largest equivalent stress (Pa).
RESULTANTS = {"plate": ("n11", "n22", "n12", "q1", "q2", "m11", "m22", "m12", "von_mises")}


def apart(places: Iterable[float], length: float) -> tuple[float, ...]:
    """Return places along a line (m) in order, those apart that are its ends or one that is there already."""
    out = list[float]()
    for x in sorted(places):
        if min(x - (out[-1] if out else 0.0), length - x) > ONE * length:
            out.append(x)
    return tuple(out)
