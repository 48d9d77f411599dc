"""The geometric stiffness of the stresses that each load causes in the linear structure, piece by piece.

What an effect adds to the strains is apart from the rest, so that it can be left out.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from ufl.algorithms.analysis import extract_constants

from rotfem.numerics.assembly import SAME
from rotfem.numerics.linear import DirectSolver

if TYPE_CHECKING:
    from rotfem.equations.pieces import Piece, Pieces

Array = npt.NDArray[np.float64]

#: Pieces of one load from which on it is seen first whether they make any geometric stiffness.
MANY = 8


def geometric_pieces(pieces: Pieces) -> list[tuple[Piece, Any, frozenset[str]]]:
    """Return (load piece, its geometric stiffness, which is not zero, the effect that adds it or none) of all.

    Args:
        pieces: of the loads and of the strains; its switches are all on before and after.
    """
    switches = pieces.model.switches
    form, compiled = pieces.known_form("G")
    there = set(extract_constants(form))
    adding = [name for name, switch in switches.items() if switch in there]
    loads, displaced = _stressing(pieces, compiled), list[tuple[Any, list[Array]]]()

    def stiffness(without: Collection[str]) -> list[Any]:
        material = pieces.material_without(without)
        if not any(known is material for known, _ in displaced):
            displaced.append((material, _displaced(pieces, material, loads)))
        for name in adding:
            switches[name].value = 0.0 if name in without else 1.0
        out = []
        for q in next(states for known, states in displaced if known is material):
            pieces.prestressed.x.array[:] = q
            out.append(pieces.assemble(compiled, "K"))
        return out

    plain = stiffness(adding)
    found = [(load, K, frozenset[str]()) for load, K in zip(loads, plain, strict=True)]
    for name in adding:
        for load, K, bare in zip(loads, stiffness([other for other in adding if other != name]), plain, strict=True):
            K.axpy(-1.0, bare, SAME)
            found.append((load, K, frozenset((name,))))
    for name in adding:
        switches[name].value = 1.0
    return [(load, K, added) for load, K, added in found if K.norm() > 0.0]


def _stressing(pieces: Pieces, compiled: Any) -> list[Piece]:
    """Return the load pieces but those of loads of many pieces that all make no geometric stiffness.

    A load over the nodes of a mesh has a piece for each. If a random sum of them makes none, then each of them does.
    """
    of: dict[str, list[Piece]] = {}
    for p in (p for p in pieces.all if p.kind == "f"):
        of.setdefault(p.key[0][0] if p.key else "", []).append(p)
    out, random, material = list[Any](), np.random.default_rng(1), pieces.material
    for group in of.values():
        if len(group) > MANY:
            mixed = group[0].operator.duplicate()
            mixed.zeroEntries()
            for p, factor in zip(group, random.uniform(0.5, 1.5, len(group)), strict=True):
                mixed.axpy(factor, p.operator)
            (pieces.prestressed.x.array[:],) = _displaced(pieces, material, [replace(group[0], operator=mixed)])
            if pieces.assemble(compiled, "K").norm() == 0.0:
                continue
        out += group
    return out


def _displaced(pieces: Pieces, material: Any, loads: list[Piece]) -> list[Array]:
    """Return what each load displaces the linear structure by, local dof arrays."""
    if not loads:
        return []
    q, out = pieces.prestressed, []
    solver = pieces.material_solver if material is pieces.material else DirectSolver(material, symmetric=True)
    solved = solver.solve_all(np.array([load.operator.array for load in loads]).T)
    for column in solved.T:
        q.x.array[: len(column)] = -column
        q.x.scatter_forward()
        out.append(q.x.array.copy())
    return out
