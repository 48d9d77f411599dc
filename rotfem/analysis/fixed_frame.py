"""Modes of a shaft on supports that differ by direction, in the frame that does not spin.

In the spinning frame the coefficients of such supports change with twice its angle. M, C and K of a shaft that is the
same in all directions about its axis e commute with J u = e×u of displacements and rotations. With u = e^{−JΩt} y the
displacements y in the fixed frame have constant coefficients,

    M ÿ + (C − 2Ω M J + C_s) ẏ + (K − Ω C J + Ω² M J² + K_s) y = 0,

C_s and K_s what the supports have beyond their isotropic parts (Genta 2005, sections 2.4 and 4.3).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from petsc4py import PETSc

from rotfem.errors import InputError
from rotfem.numerics.projection import sparse_part

KEY = "structure.supports"

#: Part of a matrix by which it may fail to commute with J: round-off of its assembly.
ROUND_OFF = 1e-9


def has_anisotropic_supports(problem: Any) -> bool:
    """Return whether a problem's structure has supports that differ by direction."""
    return any(np.any(s.anisotropic) for s in getattr(problem.structure, "supports", ()))


def check_rotating(problem: Any, what: str) -> None:
    """Refuse what is computed in the rotating frame, where coefficients would change with time.

    Raises:
        InputError: a support differs by direction.
    """
    if has_anisotropic_supports(problem):
        why = (
            "differ by direction, so that coefficients change with time in the rotating frame, in which "
            f"{what} is computed; modes and campbell take them"
        )
        raise InputError(KEY, None, why)


class FixedFrame:
    """The change to the fixed frame of the equations of a shaft.

    Args:
        system: compiled equations of the shaft in the rotating frame.
    """

    def __init__(self, system: Any):
        self.V, self.supports = system.V, system.model.problem.structure.supports
        names, axis = list(system.structure.unknowns), np.asarray(system.motion.axis, dtype=float)
        self._places = {name: i for i, name in enumerate(names)}
        self._block, self._map = len(names), self.V.dofmap.index_map
        entries = []
        for kind in ("u", "theta"):
            second, third = (self._places[f"{kind}{i}"] for i in (2, 3))
            entries += [(second, third, -axis[0]), (third, second, axis[0])]
        first, last = self._map.local_range
        self._J = self._matrix(system, [(node, *entry) for node in range(first, last) for entry in entries])
        if system.hub is not None:
            raise InputError(KEY, None, "that differ by direction need a shaft whose speed is given")
        self._added = [self._of_supports(system, i) for i in range(2)]

    def _matrix(self, system: Any, entries: list[tuple[int, int, int, float]]) -> Any:
        """Return the matrix of entries (node, row, column, value), rows and columns counted within a node."""
        owned = self._map.size_local * self._block
        A = PETSc.Mat().createAIJ(((owned, None), (owned, None)), comm=system.comm)
        A.setUp()
        for node, i, j, value in entries:
            A.setValue(node * self._block + i, node * self._block + j, value, addv=PETSc.InsertMode.ADD_VALUES)
        A.assemble()
        return A

    def _of_supports(self, system: Any, which: int) -> Any:
        """Return K_s (0) or C_s (1)."""
        x, size = self.V.tabulate_dof_coordinates()[: self._map.size_local, 0], system.structure.length
        places, entries = (self._places["u2"], self._places["u3"]), []
        for support in self.supports:
            for node in np.flatnonzero(np.abs(x - support.x) <= ROUND_OFF * size) + self._map.local_range[0]:
                values = np.asarray(support.anisotropic[which])
                entries += [(int(node), places[i], places[j], values[i, j]) for i in (0, 1) for j in (0, 1)]
        return self._matrix(system, entries)

    def __call__(self, matrices: tuple[Any, Any, Any], speed: float) -> tuple[Any, Any, Any]:
        """Return M, C and K in the fixed frame of those in the rotating one, at a speed (rad/s).

        Raises:
            InputError: the shaft is not the same in all directions, or has a damping that is given by mode.
        """
        M, C, K = matrices
        if sparse_part(C) is not C:
            raise InputError("structure.damping.modal", None, f"is not taken with {KEY} that differ by direction")
        MJ, CJ = M.matMult(self._J), C.matMult(self._J)
        for A, AJ in ((M, MJ), (C, CJ), (K, K.matMult(self._J))):
            difference = self._J.matMult(A)
            difference.axpy(-1.0, AJ)
            if difference.norm() > ROUND_OFF * max(AJ.norm(), np.finfo(float).tiny):
                why = "that differ by direction need a shaft that does not: with its masses, root and loads"
                raise InputError(KEY, None, why)
        C_fixed, K_fixed = C.copy(), K.copy()
        for A, factor, B in (
            (C_fixed, -2.0 * speed, MJ),
            (C_fixed, 1.0, self._added[1]),
            (K_fixed, -speed, CJ),
            (K_fixed, speed**2, MJ.matMult(self._J)),
            (K_fixed, 1.0, self._added[0]),
        ):
            A.axpy(factor, B)
        return M, C_fixed, K_fixed
