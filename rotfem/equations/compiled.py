"""A problem's equations, compiled."""

from __future__ import annotations

from typing import Any

from mpi4py import MPI

from rotfem.equations.affine import AffineSystem
from rotfem.equations.bordered import BorderedSystem
from rotfem.equations.model import Model
from rotfem.equations.nonlinear import NonlinearSystem
from rotfem.mechanics.problem import Problem
from rotfem.mechanics.time_signals import View, viewed
from rotfem.structures.structure import check_memory


def compile_system(problem: Problem, comm: MPI.Comm = MPI.COMM_WORLD, moving: bool = True, parted: bool = False) -> Any:
    """Return the system of a problem: affine for a linear theory, bordered where the hub is free.

    A system that is not `moving`, of steady states and modes, needs fewer forms; `parted` shares forms between the
    nonlinear theories (see `NonlinearSystem`).
    """
    view = View()
    seen, signals = viewed(problem.pushed(), view) if moving else (problem, [])
    model = Model(seen, comm)
    system: Any
    if problem.theory.linear and moving:  # its pieces are held apart, 12 kB for each unknown of a plate
        V, file = model.structure.V, getattr(problem.structure, "mesh", None)
        key, value = ("mesh.elements", problem.mesh.elements) if file is None else ("structure.mesh", str(file))
        nodes, components, dimension = V.dofmap.index_map.size_global, V.dofmap.index_map_bs, V.mesh.topology.dim
        check_memory(key, value, nodes, components, dimension, comm, times=2.0)
    if problem.theory.linear:
        system = AffineSystem(model, moving, parted)
        if not parted:
            system.check_terms()
    else:
        system = NonlinearSystem(model, moving, parted)
    system.view, system.signals = view, tuple(signals)
    return system if model.hub is None else BorderedSystem(system, once=parted and model.structure.planar)


def with_all_unknowns(system: Any) -> Any:
    """Return a system; if it has inactive components that with all of them, at rest, as stability depends on all."""
    problem = system.model.problem
    return compile_system(problem.replace(inactive=()), system.comm, moving=False) if problem.inactive else system
