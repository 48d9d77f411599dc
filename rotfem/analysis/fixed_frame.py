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
import numpy.typing as npt
from petsc4py import PETSc

from rotfem.equations.system import System
from rotfem.errors import InputError
from rotfem.numerics.projection import sparse_part

Array = npt.NDArray[np.float64]

SUPPORTS_KEY = "structure.supports"

#: Part of a matrix by which it may fail to commute with J: round-off of its assembly.
ROUND_OFF = 1e-9


def has_anisotropic_supports(problem: Any) -> bool:
    """Return whether a problem's structure has supports that differ by direction."""
    return any(np.any(s.anisotropic) for s in getattr(problem.structure, "supports", ()))


def check_rotating(problem: Any, what: str) -> None:
    """Refuse what is computed in the rotating frame, where coefficients would change with time."""
    if has_anisotropic_supports(problem):
        why = (
            "differ by direction, so that coefficients change with time in the rotating frame, in which "
            f"{what} is computed; modes and campbell take them"
        )
        raise InputError(SUPPORTS_KEY, None, why)


class FixedFrame:
    """The change to the fixed frame of the equations of a shaft.

    Args:
        system: compiled equations of the shaft in the rotating frame.
    """

    def __init__(self, system: System):
        self.V, self.supports = system.V, system.model.problem.structure.supports
        names, axis = list(system.structure.unknowns), np.asarray(system.motion.axis, dtype=float)
        if system.hub is not None:
            raise InputError(SUPPORTS_KEY, None, "that differ by direction need a shaft whose speed is given")
        turn = np.zeros((len(names), len(names)))
        for kind in ("u", "theta"):
            i, j = (names.index(f"{kind}{k}") for k in (2, 3))
            turn[i, j], turn[j, i] = -axis[0], axis[0]
        x = self.V.tabulate_dof_coordinates()[: self.V.dofmap.index_map.size_local, 0]
        self._J = self._matrix(np.broadcast_to(turn, (len(x), *turn.shape)))
        added, across = np.zeros((2, len(x), *turn.shape)), np.ix_(*2 * [[names.index("u2"), names.index("u3")]])
        for support in self.supports:
            for node in np.flatnonzero(np.abs(x - support.x) <= ROUND_OFF * system.structure.length):
                for blocks, values in zip(added, support.anisotropic, strict=True):
                    blocks[node][across] += values
        self._added = [self._matrix(blocks) for blocks in added]  # K_s and C_s

    def _matrix(self, blocks: Array) -> Any:
        """Return the matrix with a block (n, n) for each owned node on its diagonal."""
        first, last = self.V.dofmap.index_map.local_range
        rows = np.arange(last - first + 1, dtype=PETSc.IntType)
        size = (len(blocks) * blocks.shape[1], None)
        csr = rows, first + rows[:-1], np.array(blocks)
        return PETSc.Mat().createBAIJ((size, size), blocks.shape[1], csr=csr, comm=self.V.mesh.comm).convert("aij")

    def __call__(self, matrices: tuple[Any, Any, Any], speed: float) -> tuple[Any, Any, Any]:
        """Return M, C and K in the fixed frame of those in the rotating one, at a speed (rad/s)."""
        M, C, K = matrices
        if sparse_part(C) is not C:
            raise InputError(
                "structure.damping.modal", None, f"is not taken with {SUPPORTS_KEY} that differ by direction"
            )
        MJ, CJ = M.matMult(self._J), C.matMult(self._J)
        for A, AJ in ((M, MJ), (C, CJ), (K, K.matMult(self._J))):
            difference = self._J.matMult(A)
            difference.axpy(-1.0, AJ)
            if difference.norm() > ROUND_OFF * max(AJ.norm(), np.finfo(float).tiny):
                why = "that differ by direction need a shaft that does not: with its masses, root and loads"
                raise InputError(SUPPORTS_KEY, None, why)
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
