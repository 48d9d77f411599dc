"""Damping by mode: a ratio for each of the first modes at rest, as blade files give it.

With modes φ_j of unit mass, M φ_j ω_j² = K φ_j, of the structure at rest (see `rotfem.equations.modes_at_rest`), the
force of damping is C v with

    C = Σ_j 2 ζ_j ω_j (M φ_j)(M φ_j)ᵀ = B Bᵀ,

for which φ_jᵀ C φ_k is 2 ζ_j ω_j where j = k and zero elsewhere (Wilson & Penzien 1972), so that these modes are damped
with their ratios and no other mode at rest is. C is constant in the rotating frame: it is added to the equations of
every theory, at every speed. It is of few columns but dense, and is never written out (see `rotfem.numerics.low_rank`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.equations.modes_at_rest import ModesAtRest, family_products, modes_at_rest
from rotfem.errors import InputError
from rotfem.numerics.low_rank import LowRank

Array = npt.NDArray[np.float64]

#: The effect that it is part of.
EFFECT = "damping"

#: Key of a scene for messages.
KEY = "structure.damping.modal"

#: How many modes a single ratio is for.
FIRST = 10


class ByMode(LowRank):
    """C of damping by mode.

    Args:
        B: M φ_j √(2 ζ_j ω_j), owned rows, a column each.
        shapes: φ_j √(2 ζ_j ω_j) likewise.
        omega: ω_j, rad/s.
        like: see `LowRank`.
    """

    def __init__(self, B: Array, shapes: Array, omega: Array, like: Any):
        super().__init__(B, like)
        self.shapes, self.omega = shapes, omega

    def displaced(self, v: Array) -> Array:
        """Return the owned displacement at which the forces of the structure at rest are C v, of owned velocities."""
        return np.asarray(self.shapes @ (self.along(v) / self.omega**2))


def damping_by_mode(system: Any) -> ByMode | None:
    """Return what damping by mode adds to C of a system; None where there is none.

    Raises:
        InputError: there are not as many modes, or no such family, or the frame does not rotate.
        ComputationError: the modes at rest cannot be computed.
    """
    damping = system.model.problem.structure.damping
    if EFFECT not in system.model.effects or not damping.has_modal:
        return None
    ratios = damping.modal
    if system.model.fixed:
        raise InputError(KEY, ratios, 'needs model.frame = "rotating": modes at rest turn with the hub')
    modes, zeta = of_families(system, ratios) if isinstance(ratios, Mapping) else in_order(system, ratios)
    damped = np.flatnonzero(zeta)
    weights = np.sqrt(2 * zeta[damped] * modes.omega[damped])
    return ByMode(modes.massed[:, damped] * weights, modes.shapes[:, damped] * weights, modes.omega[damped], system.A)


def in_order(system: Any, ratios: float | tuple[float, ...]) -> tuple[ModesAtRest, Array]:
    """Return (modes, their ratios) in the order of frequency.

    Raises:
        InputError: there are fewer modes than ratios, of a model with all its effects.
    """
    several = isinstance(ratios, tuple)
    wanted = np.array(ratios if several else [ratios] * FIRST)
    modes = modes_at_rest(system, len(wanted))
    there = len(modes.omega)
    if several and there < len(wanted) and is_whole(system):
        raise InputError(KEY, ratios, f"has more ratios than there are modes on this mesh: {there}")
    return modes, wanted[:there]


def of_families(system: Any, ratios: Mapping[str, tuple[float, ...]]) -> tuple[ModesAtRest, Array]:
    """Return (modes, their ratios), each mode in the family that has most of its energy, in order of frequency there.

    Raises:
        InputError: there is no such family, or it has fewer modes than ratios, of a model with all its effects.
    """
    known = system.structure.families
    for name in ratios:
        if name not in known:
            why = f"a {system.structure.type} has no such family; allowed: {', '.join(known)}"
            raise InputError(f"{KEY}.{name}", list(ratios[name]), why)
    count = FIRST + sum(len(given) for given in ratios.values())
    while True:
        modes = modes_at_rest(system, count)
        energies = family_products(system, modes.shapes, modes.massed)
        leading = np.argmax([np.diag(energy) for energy in energies.values()], axis=0)
        of = {name: np.flatnonzero(leading == i) for i, name in enumerate(energies)}
        if all(len(of[name]) >= len(given) for name, given in ratios.items()):
            break
        if len(modes.omega) < count:
            if not is_whole(system):
                break
            name = next(name for name, given in ratios.items() if len(of[name]) < len(given))
            why = f"has more ratios than there are {name} modes on this mesh: {len(of[name])}"
            raise InputError(f"{KEY}.{name}", list(ratios[name]), why)
        count *= 2
    zeta = np.zeros(len(modes.omega))
    for name, given in ratios.items():
        found = of[name][: len(given)]
        zeta[found] = given[: len(found)]
    return modes, zeta


def is_whole(system: Any) -> bool:
    """Return whether a system has all effects there are; without rotary inertia there are no modes of torsion."""
    problem = system.model.problem
    return set(system.model.effects) == set(problem.replace(effects=None).effective_effects())
