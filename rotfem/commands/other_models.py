"""Which model a run advises to take in the place of its own."""

from __future__ import annotations

from rotfem.errors import ComputationError
from rotfem.mechanics.theories import Theory, richest, theories


def diverged(theory: Theory, time: float, critical: float | None, since: float | None) -> ComputationError:
    """Return the error of a linear solution that has diverged.

    Args:
        theory: its theory.
        time: when (s).
        critical: speed at which its stiffness is singular, rad/s; None if there is none.
        since: from when on (s) the speed was above that; None if it never was.
    """
    why = "the motion is unstable or its load too large for a linear theory"
    if since is not None:
        why = f"its stiffness is not definite above {critical:.6g} rad/s, passed at t = {since:.4g} s"
        if not theory.prestress:
            why += ": first-order strains keep the softening by the centrifugal force but not the stiffening"
    return ComputationError(
        f"the {theory.name} solution diverged (a displacement exceeds the length, or a rotation 1 rad; {why})",
        time=time,
        advice=better_theories(theory),
    )


def better_theories(theory: Theory) -> str:
    """Return which theories to use in the place of a linear one that diverged."""
    exact = richest().name
    if theory.prestress:
        return f'use model.theory = "{exact}", which holds for any deflection'
    stiffened = next(t.name for t in theories() if t.linear and t.prestress)
    return f'use model.theory = "{stiffened}" for small or "{exact}" for any deflection'
