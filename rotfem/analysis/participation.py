"""Modal masses, and how much of the structure's mass moves along each direction in a mode.

With the kinetic energy ½ vᵀM v of the whole structure, that of the clamped unknowns included, a mode x of largest entry
1 has the modal mass x^H M x, and of a motion r_i of all points along direction i it has the effective mass

    |r_iᵀ M x|² / x^H M x;

those of all modes that a structure at rest has add up to its mass r_iᵀ M r_i (Clough & Penzien 1993, section 26-4).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.modal import ModalAnalysis, Spinning
from rotfem.equations.functionals import Functionals
from rotfem.mechanics.work import kinetic_parts

Array = npt.NDArray[Any]


def participation(analysis: ModalAnalysis, spinning: Spinning) -> tuple[list[dict[str, float]], dict[str, float]]:
    """Return modal and effective masses of every mode, and the mass that there is.

    Args:
        analysis: compiled problem.
        spinning: equilibrium and eigenpairs at one speed.

    Returns:
        Rows of `modal_mass` (kg, where the largest entry of the shape is a displacement, kg·m² where it is a rotation)
        and `effective_mass_1`, … (kg) along the directions of the frame in which the structure moves; and the mass
        (kg) by the same names of directions.
    """
    system = analysis.system.held
    energy = Functionals({"T2": kinetic_parts(system.model.mechanics)["T2"]()}, system.structure.mesh)
    owned = system.V.dofmap.index_map.size_local * system.V.dofmap.index_map_bs

    def twice(v: Array) -> float:
        system.v.x.array[:owned] = v
        system.v.x.scatter_forward()
        return 2.0 * energy()["T2"]

    names = list(system.structure.unknowns)
    along = {i + 1: np.zeros(owned) for i in range(3) if f"u{i + 1}" in names}
    for i, r in along.items():
        r[names.index(f"u{i}") :: len(names)] = 1.0
    system.set_state(spinning.q[: len(system.q.x.array)])
    whole = {i: twice(r) for i, r in along.items()}
    rows = []
    for x in analysis.right(spinning).T:
        shape = x[:owned] / largest(analysis, x[:owned])
        pieces = [(part, twice(part)) for part in (shape.real, shape.imag)]
        mass = sum(size for _, size in pieces)
        row = {"modal_mass": mass}
        for i, r in along.items():
            momenta = [0.5 * (twice(part + r) - size - whole[i]) for part, size in pieces]
            row[f"effective_mass_{i}"] = (momenta[0] ** 2 + momenta[1] ** 2) / mass
        rows.append(row)
    system.set_state(spinning.q[: len(system.q.x.array)])
    return rows, {f"effective_mass_{i}": mass for i, mass in whole.items()}


def largest(analysis: ModalAnalysis, x: Array) -> complex:
    """Return the entry of largest size of owned unknowns, over all ranks."""
    here = complex(x[np.argmax(np.abs(x))]) if x.size else 0.0j
    found: complex = max(analysis.comm.allgather(here), key=abs)
    return found
