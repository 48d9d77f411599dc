"""Solutions with the stiffness of a square plate: by its factor, and by conjugate gradients with two grids.

    ./with-fenicsx python3 benchmarks/plate_without_factor.py [--cells 22 70 140] [--thickness 0.01 0.001]

The coarse grid has half the cells, whose stiffness is factorised by CHOLMOD. The smoother of the fine one is
Chebyshev's of degree 8 with the blocks of the nodes. A row says CPU seconds: of the factor, and of a solution with it;
of what two grids need once, and of a solution with them, to a residual of 1e-10. Then come iterations, the difference
of the two solutions, and the bytes for each unknown of both factors. The scene is that of `plate_scaling.py` at rest.
"""

from __future__ import annotations

import argparse
from time import process_time
from typing import Any

import numpy as np
import scipy.sparse
from petsc4py import PETSc
from plate_scaling import scene

from rotfem.commands.problem import Problem
from rotfem.equations.compiled import compile_system
from rotfem.numerics.linear import DirectSolver
from rotfem.refinement.coarser import interpolation
from rotfem.scene import as_scene

DEGREE, RESIDUAL = 8, 1e-10


def system_of(cells: int, thickness: float) -> Any:
    """Return the equations of the plate without its stress stiffness."""
    tables = scene(cells)
    tables["structure"]["thickness"], tables["model"]["theory"] = thickness, "linear"
    return compile_system(Problem.of(as_scene(tables)), moving=False)


def prolongation(coarse: Any, fine: Any) -> Any:
    """Return the matrix from unknowns of half the cells to those of all, clamped ones apart."""
    weights = interpolation(coarse.V, fine.V.tabulate_dof_coordinates())
    free = [np.ones(system.material.getSize()[0]) for system in (fine, coarse)]
    for x, system in zip(free, (fine, coarse), strict=True):
        x[system.clamped] = 0.0
    rows, columns = (scipy.sparse.diags_array(x) for x in free)
    P = scipy.sparse.csr_array(rows @ scipy.sparse.kron(weights, np.eye(fine.structure.size)) @ columns)
    P.eliminate_zeros()
    return PETSc.Mat().createAIJ(P.shape, csr=(P.indptr, P.indices, P.data))


def two_grids(K: Any, coarse: Any, P: Any) -> Any:
    """Return conjugate gradients for K with one V-cycle of two grids as preconditioner."""
    ksp = PETSc.KSP().create(K.comm)
    ksp.setOperators(K)
    ksp.setType(PETSc.KSP.Type.CG)
    ksp.setTolerances(rtol=RESIDUAL, max_it=500)
    pc = ksp.getPC()
    pc.setType(PETSc.PC.Type.MG)
    pc.setMGLevels(2)
    pc.setMGInterpolation(1, P)
    below, above = pc.getMGCoarseSolve(), pc.getMGSmoother(1)
    below.setOperators(coarse)
    below.setType(PETSc.KSP.Type.PREONLY)
    below.getPC().setType(PETSc.PC.Type.CHOLESKY)
    below.getPC().setFactorSolverType("cholmod")
    above.setType(PETSc.KSP.Type.CHEBYSHEV)
    above.setTolerances(max_it=DEGREE)
    above.getPC().setType(PETSc.PC.Type.PBJACOBI)
    ksp.setUp()
    return ksp


def bytes_of(solver: Any) -> float:
    """Return what a factor takes."""
    return float(solver.getPC().getFactorMatrix().getInfo()["memory"])


def timed(work: Any, *arguments: Any) -> tuple[Any, float]:
    """Return (what some work gives, its CPU seconds)."""
    started = process_time()
    out = work(*arguments)
    return out, process_time() - started


def row(cells: int, thickness: float) -> None:
    """Print the row of one size."""
    fine, coarse = system_of(cells, thickness), system_of((cells + 1) // 2, thickness)
    K, n = fine.material, fine.material.getSize()[0]
    y, b = K.createVecs()
    b.array[:] = np.random.default_rng(1).standard_normal(n)
    b.array[fine.clamped] = 0.0
    direct = DirectSolver(K, symmetric=True)
    _, factor = timed(direct.factorise)
    x, solution = timed(direct.solve, b)
    columns = np.random.default_rng(2).standard_normal((n, 12))
    _, block = timed(direct.solve_all, columns)
    whole = bytes_of(direct._ksp)
    ksp, once = timed(two_grids, K, coarse.material, prolongation(coarse, fine))
    ksp.solve(b, y)  # bounds of the smoother's eigenvalues are found in the first
    _, each = timed(ksp.solve, b, y)
    apart = np.linalg.norm(y.array - x) / np.linalg.norm(x)
    print(
        f"{n:>8} {thickness:>6} {factor:>7.2f} {solution:>7.3f} {block / 12:>9.3f} {once:>6.2f} {each:>7.3f} "
        f"{ksp.getIterationNumber():>5} {apart:>8.0e} {whole / n:>7.0f} "
        f"{bytes_of(ksp.getPC().getMGCoarseSolve()) / n:>7.0f}",
        flush=True,
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, nargs="+", default=[22, 70])
    parser.add_argument("--thickness", type=float, nargs="+", default=[0.01, 0.001])
    arguments = parser.parse_args()
    print("unknowns    t/a  factor   solve one of 12   once solution iter.    error  factor B  coarse B")
    for cells in arguments.cells:
        for thickness in arguments.thickness:
            row(cells, thickness)


if __name__ == "__main__":
    main()
