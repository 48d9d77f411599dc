"""Names of what a beam has at a section and a plate at a point, which scenes, equations and results share."""

from __future__ import annotations

#: Type of a beam ↦ its stress resultants at a section (N, N·m), and the strains that they are conjugate to (1, 1/m).
FORCES = {"planar_beam": ("N", "Q", "M"), "spatial_beam": ("N", "Q2", "Q3", "T", "M2", "M3")}
STRAINS = {
    "planar_beam": ("gamma1", "gamma2", "kappa"),
    "spatial_beam": ("gamma1", "gamma2", "gamma3", "kappa1", "kappa2", "kappa3"),
}
#: The same of a plate: membrane forces and shear forces (N/m), moments (N), largest equivalent stress (Pa).
RESULTANTS = {"plate": ("n11", "n22", "n12", "q1", "q2", "m11", "m22", "m12", "von_mises")}
