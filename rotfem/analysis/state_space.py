"""Modal state-space model of the spinning structure: tip force and moment in, tip motion out.

With q = Σ_j x_j η_j over pairs λ_j, η̇_j = λ_j η_j + y_j^H B u / n_j, n_j = y_j^H (2λ_j M + C) x_j. A conjugate pair
gives two real states (Re η, Im η); what the left-out modes answer statically goes into D.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.io import mmwrite
from scipy.linalg import block_diag
from scipy.sparse import csr_array, save_npz

from rotfem.analysis.modal import ModalAnalysis, Spinning
from rotfem.equations.modal_damping import DAMPING_KEY
from rotfem.errors import ComputationError, InputError, SceneError
from rotfem.numerics.linear import DirectSolver
from rotfem.numerics.projection import PlusLowRank, sparse_part
from rotfem.results.files import writing

Array = npt.NDArray[Any]

#: Unknowns up to which a C without zeros is written, 100 MB of text.
LARGEST_FULL = 2000


@dataclass(frozen=True)
class StateSpace:
    """ż = A z + B u, y = C z + D u, as scipy.signal takes it.

    Attributes:
        A, B, C, D: real matrices.
        inputs: names of u, "tip_force_1" (N), …, "tip_moment" (N·m), components in the rotating frame.
        outputs: names of y, "tip_u1" (m), …, deviations from the equilibrium.
        speed: Ω of the equilibrium, rad/s.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    speed: float

    def system(self) -> tuple[Array, Array, Array, Array]:
        """Return (A, B, C, D)."""
        return self.A, self.B, self.C, self.D

    def write(self, path: Path) -> Path:
        """Write all of it as an .npz file."""
        arrays: dict[str, Any] = {name: np.array(value) for name, value in vars(self).items()}
        with writing(path):
            np.savez(path, **arrays)
        return path


def state_space(analysis: ModalAnalysis, spinning: Spinning, count: int) -> StateSpace:
    """Return the model of the first `count` modes (and the static answer of all others)."""
    serial(analysis, "the state-space model")
    structure = analysis.structure
    if np.any(spinning.pairs.bounds[:count] >= 1.0):
        what = "there is no static answer to a force: a mode has the frequency zero to round-off"
        raise ComputationError(what, advice="a spring at a hinge that nothing holds")
    pairs, n = spinning.pairs.select(np.arange(min(count, len(spinning.pairs.values)))), np.diag(spinning.own)
    tip = structure.tip_values.columns(len(spinning.q))[:, : len(structure.components)]
    blocks, rows, columns = [], [], []
    for j, lam in enumerate(pairs.values):
        gain, shape = tip.T @ pairs.left[:, j].conj() / n[j], tip.T @ pairs.right[:, j]
        if lam.imag > 0.0:
            blocks.append(np.array([[lam.real, -lam.imag], [lam.imag, lam.real]]))
            rows += [gain.real, gain.imag]
            columns += [2 * shape.real, -2 * shape.imag]
        else:
            blocks.append(np.array([[lam.real]]))
            rows.append(gain.real)
            columns.append(shape.real)
            if spinning.pencil.conservative:  # with it comes −λ, as P(−λ) is P(λ)ᵀ
                blocks.append(np.array([[-lam.real]]))
                rows.append(-(tip.T @ pairs.right[:, j] / n[j]).real)
                columns.append((tip.T @ pairs.left[:, j]).real)
    A = block_diag(*blocks)
    B, C = np.array(rows), np.array(columns).T
    flexibility = tip.T @ DirectSolver(spinning.pencil.K).solve_all(tip)  # static answer to unit forces and moment
    D = flexibility + C @ np.linalg.solve(A, B)
    outputs = tuple(f"tip_{name}" for name in structure.components)
    return StateSpace(A, B, C, D, structure.tip_inputs, outputs, spinning.speed)


def write_matrices(analysis: ModalAnalysis, spinning: Spinning, folder: Path) -> list[Path]:
    """Write M, C, K of the free unknowns as Matrix Market and npz, and what each unknown is; return paths."""
    serial(analysis, "the export of matrices")
    structure = analysis.structure
    free = np.setdiff1d(np.arange(len(spinning.q)), analysis.system.clamped)
    paths = [folder / f"{name}.{kind}" for name in "MCK" for kind in ("mtx", "npz")]
    if sparse_part(spinning.pencil.C) is not spinning.pencil.C and len(free) > LARGEST_FULL:
        why = f"C is full with damping by mode; written for up to {LARGEST_FULL} free unknowns, here are {len(free)}"
        raise InputError(DAMPING_KEY, analysis.problem.structure.damping.modal, why)
    with writing(folder):
        for name in "MCK":
            A = getattr(spinning.pencil, name)
            sparse = sparse_part(A)
            indptr, indices, data = sparse.getValuesCSR()
            matrix = csr_array((data, indices, indptr), shape=sparse.getSize())[free][:, free]
            matrix.eliminate_zeros()
            if isinstance(A, PlusLowRank):
                matrix = csr_array(matrix.toarray() + A.added(np.eye(len(spinning.q))[:, free])[free])
            mmwrite(folder / f"{name}.mtx", matrix, symmetry="general", precision=17)
            save_npz(folder / f"{name}.npz", matrix)
        names = structure.unknowns
        x = structure.V.tabulate_dof_coordinates()
        lines = ["row,x1,x2,x3,component"]
        for row, dof in enumerate(free):
            where = ",".join(repr(float(c)) for c in x[dof // len(names)])
            lines.append(f"{row},{where},{names[dof % len(names)]}")
        (folder / "unknowns.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return [*paths, folder / "unknowns.csv"]


def serial(analysis: ModalAnalysis, what: str) -> None:
    """Refuse to gather a distributed system, and a free hub, whose angle is no unknown of the mesh."""
    analysis.needs_fixed_hub(what)
    if analysis.comm.size > 1:
        raise SceneError("command line", "mpirun -n", analysis.comm.size, f"{what} needs one process")
