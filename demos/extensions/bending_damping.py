"""A damping model of a user's own: Kelvin–Voigt damping of bending alone, M = EI (κ + η κ̇), η in s.

A mode that bends at the frequency ω has the damping ratio ηω/2, one that stretches has none.
"""

import ufl

from rotfem import DampingModel, register


def work(m, delta, eta):
    """∫ EI η κ̇ δκ."""
    return sum(
        ufl.inner(eta * s.force(m.k.rate(s.value)), m.k.variation(s.value)) * s.measure
        for s in m.strains
        if s.name.startswith("bending")
    )


register(DampingModel("bending_damping", work, "η of bending (s)"))
