"""The same problem on half the cells, or where these are fixed on finer ones.

Strains of elements of degree k converge with order k, displacements with k + 1 and frequencies with 2k where all is
smooth (Strang & Fix 1973, sections 3.4 and 6.3). Of corners and thin layers at clamps that does not hold: the order
counted on is that of strains, of linear elements that of displacements, 2.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from rotfem.equations.compiled import compile_system
from rotfem.errors import InputError
from rotfem.mechanics.problem import Problem
from rotfem.refinement.estimate import error_of

#: Order of linear elements, and counted on of all others at least.
LEAST = 2


@dataclass(frozen=True)
class OtherMesh:
    """A problem on another mesh.

    Attributes:
        system: of the problem there.
        ratio: of its cell sizes to the own ones; below 1 it is the finer of the two.
        order: of convergence that is counted on.
    """

    system: Any
    ratio: float
    order: int

    def error(self, difference: float) -> float:
        """Return the error of an answer on the own mesh by its difference to that on the other one, both relative."""
        if self.ratio > 1.0:
            return error_of(difference, self.order, self.ratio)
        return difference + error_of(difference, self.order, 1.0 / self.ratio)


def on_other_mesh(problem: Problem, system: Any, moving: bool = True, finer: bool = False) -> OtherMesh | None:
    """Return a problem on half the cells or a finer mesh, without what its own system leaves out.

    Where the nodes that a section, a mass or a load asks for fix the cells they are halved in length, and those of a
    mesh file have one degree more. None where there is no other mesh at all.

    Args:
        problem: what is computed.
        system: the problem's system on its own mesh.
        moving: whether the other one will be stepped in time.
        finer: whether only a finer mesh will do.
    """
    problem = problem.replace(outputs={})
    nodes = system.V.dofmap.index_map.size_global
    cells = system.structure.mesh.topology.index_map(system.structure.mesh.topology.dim).size_global
    for mesh, ratio in _meshes(problem, cells):
        if finer and ratio > 1.0:
            continue
        try:
            other = compile_system(problem.replace(mesh=mesh), system.comm, moving, system.held.parted)
            if system.held.left_out:
                other.leave_out(system.held.left_out)
        except InputError:
            continue
        if other.V.dofmap.index_map.size_global != nodes:
            return OtherMesh(other, ratio, max(LEAST, system.V.element.basix_element.degree))
    return None


def _meshes(problem: Problem, cells: int) -> Iterator[tuple[Any, float]]:
    """Yield meshes, and the ratios of their cell sizes to those of a problem; of an odd number, half is less than 2."""
    mesh = problem.mesh
    if getattr(problem.structure, "mesh_file", None) is not None:  # a structure of a user need not say it
        yield mesh.model_copy(update={"degree": mesh.degree + 1}), 0.5
        return
    n = mesh.elements
    if isinstance(n, tuple):
        half = tuple((k + 1) // 2 for k in n)
        ratios = [k / h for k, h in zip(n, half, strict=True) if h < k]
        yield mesh.model_copy(update={"elements": half}), min(ratios, default=1.0)
        yield mesh.model_copy(update={"elements": tuple(2 * k for k in n)}), 0.5
    else:
        number = (cells + 1) // 2
        yield mesh.model_copy(update={"elements": number}), cells / number
        yield mesh.model_copy(update={"elements": 2 * cells}), 0.5
