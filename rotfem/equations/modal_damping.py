"""Damping by mode: a ratio for each of the first modes at rest, as blade files give it.

With modes φ_j of unit mass, M φ_j ω_j² = K φ_j, of the structure at rest, the force of damping is C v with

    C = Σ_j 2 ζ_j ω_j (M φ_j)(M φ_j)ᵀ = B Bᵀ,

so φ_jᵀ C φ_k is 2 ζ_j ω_j for j = k and zero else (Wilson & Penzien 1972): these modes have their ratios, all others at
rest are undamped. C is constant in the rotating frame and in the equations of every theory, at every speed. It is
dense, and kept as B (see `rotfem.numerics.projection`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.equations.model import Model
from rotfem.errors import InputError
from rotfem.numerics.eigenproblem import Pencil, separate
from rotfem.numerics.projection import LowRank, summed, times
from rotfem.numerics.ritz import MORE
from rotfem.structures.structure import Structure

Array = npt.NDArray[np.float64]

#: One for all of the first modes, one each for them, or for those of families.
Ratios = float | tuple[float, ...] | Mapping[str, tuple[float, ...]]

#: The effect that it is part of.
EFFECT = "damping"

#: Key of a scene for messages.
DAMPING_KEY = "structure.damping.modal"

#: How many modes a single ratio is for.
MODES_OF_ONE_RATIO = 10


def modes_at_rest(structure: Structure, matrices: tuple[Any, Any], count: int) -> tuple[Array, Array, Array]:
    """Return ω (rad/s), shapes φ of unit mass and M φ of the first modes that vibrate, as many as there are of them.

    Args:
        structure: at rest.
        matrices: its M and K.
        count: number of modes.
    """
    M, K = matrices
    most = massed(M)
    pencil = Pencil(M, M.duplicate(), K)
    pairs = pencil.solve(min(min(count, most) + MORE, most))
    separate(pencil, pairs, (pairs.right, pairs.left), lambda X, MX: by_family(structure, X, MX))
    first = np.flatnonzero(pairs.resolved != 0.0)[:count]  # others are motions that nothing holds
    shapes = pairs.right[:, first].real
    return np.abs(pairs.values[first]), shapes, times(M, shapes)


def massed(M: Any) -> int:
    """Return the number of unknowns with mass, which is that of finite eigenvalues."""
    return int(M.comm.tompi4py().allreduce(np.count_nonzero(M.getDiagonal().array)))  # M is positive semi-definite


def family_products(structure: Structure, X: Array, MX: Array) -> dict[str, Array]:
    """Return family ↦ x_i^H M x_j of the components that belong to it, over all ranks, (m, m)."""
    dofmap = structure.V.dofmap
    bs, owned = dofmap.index_map_bs, dofmap.index_map.size_local * dofmap.index_map_bs
    x, mx = (structure.oriented(Y[:owned].reshape(-1, bs, X.shape[1])) for Y in (X, MX))
    parts = {name: list(components) for name, (components, _) in structure.families.items()}
    return {
        name: np.asarray(summed(structure.comm, np.einsum("nci,ncj->ij", x[:, c].conj(), mx[:, c])))
        for name, c in parts.items()
    }


def by_family(structure: Structure, X: Array, MX: Array) -> Array:
    """Return x_i^H M A x_j, over all ranks, of the operator A that multiplies components by the number of a family."""
    return np.asarray(sum(i * part for i, part in enumerate(family_products(structure, X, MX).values())))


class ByMode(LowRank):
    """C of damping by mode.

    Args:
        B: M φ_j √(2 ζ_j ω_j), owned rows, a column each.
        shapes: φ_j √(2 ζ_j ω_j) likewise.
        omega: ω_j, rad/s.
        comm: see `LowRank`.
    """

    def __init__(self, B: Array, shapes: Array, omega: Array, comm: MPI.Comm):
        super().__init__(B, comm)
        self.shapes, self.omega = shapes, omega

    def displaced(self, v: Array) -> Array:
        """Return the owned displacement at which the forces of the structure at rest are C v, of owned velocities."""
        return np.asarray(self.shapes @ (self.along(v) / self.omega**2))


def damping_by_mode(model: Model, matrices: Callable[[], tuple[Any, Any]]) -> ByMode | None:
    """Return the part of C of damping by mode, of a function that returns (M, K) at rest; None without."""
    damping = model.problem.structure.damping
    if EFFECT not in model.effects or not damping.has_modal:
        return None
    ratios = damping.modal
    if model.fixed:
        raise InputError(DAMPING_KEY, ratios, 'needs model.frame = "rotating": modes at rest turn with the hub')
    omega, zeta, shapes, momenta = damped_modes(model, matrices(), ratios)
    weights = np.sqrt(2 * zeta * omega)
    return ByMode(momenta * weights, shapes * weights, omega, model.comm)


def damped_modes(model: Model, matrices: tuple[Any, Any], ratios: Ratios) -> tuple[Array, Array, Array, Array]:
    """Return ω, ratios ζ, φ and M φ of modes that have a ratio: in the order of frequency, or of each family in that.

    A mode is in the family that has most of its energy.
    """
    structure, several = model.structure, isinstance(ratios, Mapping | tuple)
    if isinstance(ratios, Mapping):
        named = {f"{name} ": given for name, given in ratios.items()}
        for name in ratios:
            if name not in structure.families:
                why = f"a {structure.type} has no such family; allowed: {', '.join(structure.families)}"
                raise InputError(f"{DAMPING_KEY}.{name}", list(ratios[name]), why)
    else:
        named = {"": ratios if isinstance(ratios, tuple) else (ratios,) * MODES_OF_ONE_RATIO}
    count = sum(map(len, named.values())) + (MODES_OF_ONE_RATIO if isinstance(ratios, Mapping) else 0)
    while True:
        omega, shapes, momenta = modes_at_rest(structure, matrices, count)
        energies = family_products(structure, shapes, momenta)
        leading = np.argmax([np.diag(energy) for energy in energies.values()], axis=0)
        of = {f"{name} ": np.flatnonzero(leading == i) for i, name in enumerate(energies)}
        of[""] = np.arange(len(leading))
        short = [name for name, given in named.items() if len(of[name]) < len(given)]
        if not short or (len(omega) < count and not (several and is_whole(model))):
            break
        if len(omega) < count:
            name = short[0]
            value = list(named[name]) if name else ratios
            why = f"has more ratios than there are {name}modes on this mesh: {len(of[name])}"
            raise InputError(f"{DAMPING_KEY}.{name}".rstrip(". "), value, why)
        count *= 2
    zeta = np.zeros(len(omega))
    for name, given in named.items():
        found = of[name][: len(given)]
        zeta[found] = given[: len(found)]
    damped = np.flatnonzero(zeta)
    return omega[damped], zeta[damped], shapes[:, damped], momenta[:, damped]


def is_whole(model: Model) -> bool:
    """Return whether a model has all effects of its problem; without rotary inertia there are no modes of torsion."""
    problem = model.problem
    return set(model.effects) == set(problem.replace(effects=None).effective_effects())
