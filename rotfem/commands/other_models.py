"""Which model a run advises to take in the place of its own."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.mechanics.theories import Theory, richest, theories

Array = npt.NDArray[np.float64]

#: Displacement over L in the plane of a plate from which a run says what its strains leave out there.
NOTICED = 1e-3


def better_theories(theory: Theory) -> str:
    """Return which theories to use in the place of a linear one that diverged."""
    exact = richest().name
    if theory.prestress:
        return f'use model.theory = "{exact}", which holds for any deflection'
    stiffened = next(t.name for t in theories() if t.linear and t.prestress)
    return f'use model.theory = "{stiffened}" for small or "{exact}" for any deflection'


def lacking(system: Any, history: dict[str, Array]) -> str:
    """Return what is to be said where a structure moves in a way that its theory's strains do not stiffen by the spin.

    Args:
        system: equations of motion.
        history: columns of a run.
    """
    structure, theory = system.structure, system.model.theory
    spins = np.any(history.get("psi_dot", np.zeros(1)) != 0.0)
    if not structure.unstiffened or theory.exact or not spins or "centrifugal" not in system.model.effects:
        return ""
    size = float(np.max(np.abs(history["tip_u2"]), initial=0.0)) / structure.length
    if size <= NOTICED:
        return ""
    return (
        f"the tip moves by up to {size:.2g} L in the plane: the strains of {theory.name} for this structure "
        f'leave out the stiffening of such motions by the spin; model.theory = "{richest().name}" has it'
    )
