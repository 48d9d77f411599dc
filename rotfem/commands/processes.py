"""How several processes share one command, and what all summaries have in common.

A large system shares its mesh, of a small one each process has a copy. With a copy on every process nothing is
communicated within a solution, and all have the whole result. The frequencies of a response are then shared out; all
else is computed by each.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from time import perf_counter
from typing import Any, TypeVar

from mpi4py import MPI

from rotfem.analysis.modal import ModalAnalysis
from rotfem.errors import ComputationError, InputError
from rotfem.mechanics.problem import Problem
from rotfem.registry import resolved, structures
from rotfem.scene import Scene
from rotfem.version import versions

Item = TypeVar("Item")
Found = TypeVar("Found")

#: Unknowns for each process from which a mesh is shared. Below 5000 two processes lose, as PETSc's own LU is quicker
#: than MUMPS; they gain 1.3 on modes of a plate of 99 405 (docs/scaling.md). A copy takes 17 kB for each unknown.
SHARED_FROM = 10_000


def communicator(problem: Problem, comm: MPI.Comm) -> MPI.Comm:
    """Return what a problem is discretised on: all processes where it is large, else each one by itself."""
    given = os.environ.get("ROTFEM_SHARED_FROM")
    try:
        least = float(given or SHARED_FROM)
    except ValueError:
        raise InputError("ROTFEM_SHARED_FROM", given, "must be a number of unknowns") from None
    return comm if comm.size == 1 or unknowns(problem) >= least * comm.size else MPI.COMM_SELF


def unknowns(problem: Problem) -> float:
    """Return about how many unknowns a problem has; infinite where only its mesh file knows."""
    structure, mesh = problem.structure, problem.mesh
    if structure.mesh_file is not None:
        return math.inf
    cells = mesh.elements if isinstance(mesh.elements, Sequence) else [mesh.elements]
    kind: Any = resolved(structures[structure.type].discretised)
    return float(len(kind.components) * math.prod(n * mesh.degree + 1 for n in cells))


def shared_out(items: Sequence[Item], work: Callable[[Item], Found], comm: MPI.Comm) -> list[Found]:
    """Return what some work makes of every item, on all ranks; each rank does neighbouring items in their order."""
    first, last = (len(items) * rank // comm.size for rank in (comm.rank, comm.rank + 1))
    done: list[Found] = []
    problem = None
    try:
        done += map(work, items[first:last])
    except (ComputationError, InputError) as error:
        problem = error
    parts = comm.allgather((done, problem))
    for _, found in parts:
        if found is not None:
            raise found
    return [found for part, _ in parts for found in part]


# --- what the summaries of all commands have in common ----------------------------------------------------------------


def summary(command: str, scene: Scene, comm: MPI.Comm, inner: MPI.Comm | None = None) -> dict[str, Any]:
    """Return what every summary has; `inner` are the processes that the system is discretised on, all if None.

    On several processes `shared` is "mesh", "frequencies" or "nothing".
    """
    out: dict[str, Any] = {"command": command, "status": "done", "name": scene.name, "versions": versions()}
    out["ranks"] = comm.size
    if comm.size > 1:
        copies = "frequencies" if command == "response" else "nothing"
        out["shared"] = "mesh" if (inner or comm).size > 1 else copies
    return {**out, "scene": scene.digest()}


def timings(parts: Mapping[str, float], started: float, before: Mapping[str, float] | None = None) -> dict[str, float]:
    """Return the parts (s) of a computation, the rest of it since it started, and the total with what was before."""
    before = before or {}
    total = perf_counter() - started + sum(before.values())
    named = {**before, **parts}
    return {**named, "other": total - sum(named.values()), "total": total}


def modal_summary(command: str, analysis: ModalAnalysis, scene: Scene, started: float) -> dict[str, Any]:
    """Return what the summaries of modes and Campbell diagrams have in common, started at a `perf_counter()`."""
    space = analysis.system.V.dofmap
    return {
        **summary(command, scene, analysis.everyone, analysis.comm),
        "theory": analysis.problem.theory.name,
        "frame": "fixed" if analysis.fixed else "rotating",
        "about": "undeformed" if analysis.system.linear else analysis.about,
        "effects": list(analysis.model.effects),
        "dofs": space.index_map.size_global * space.index_map_bs,
        "timings": timings(analysis.seconds, started),
    }
