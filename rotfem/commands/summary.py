"""What the summaries of all commands have in common."""

from __future__ import annotations

from collections.abc import Mapping
from time import perf_counter
from typing import Any

from mpi4py import MPI

from rotfem.analysis.modal import ModalAnalysis
from rotfem.analysis.theory_error import TheoryError
from rotfem.commands.processes import what_is_shared
from rotfem.scene import Scene
from rotfem.version import versions


def summary(command: str, scene: Scene, comm: MPI.Comm, inner: MPI.Comm | None = None) -> dict[str, Any]:
    """Return what every summary has; `inner` are the processes that the system is discretised on, all if None."""
    out: dict[str, Any] = {"command": command, "status": "done", "name": scene.name, "versions": versions()}
    return {**out, **what_is_shared(command, comm, inner or comm), "scene": scene.digest()}


def timings(parts: Mapping[str, float], started: float, before: Mapping[str, float] | None = None) -> dict[str, float]:
    """Return the parts (s) of a computation, the rest of it since it started, and the total with what was before."""
    before = before or {}
    total = perf_counter() - started + sum(before.values())
    named = {**before, **parts}
    return {**named, "other": total - sum(named.values()), "total": total}


def modal_summary(
    command: str, analysis: ModalAnalysis, scene: Scene, started: float, theory: TheoryError | None
) -> dict[str, Any]:
    """Return what the summaries of modes and Campbell diagrams have in common, started at a `perf_counter()`."""
    space = analysis.system.V.dofmap
    return {
        **summary(command, scene, analysis.everyone, analysis.comm),
        "theory": analysis.problem.theory.name,
        **({} if analysis.fixed is None else {"frame": "fixed"}),
        "about": "undeformed" if analysis.system.linear else analysis.about,
        "effects": list(analysis.model.effects),
        "dofs": space.index_map.size_global * space.index_map_bs,
        "timings": timings(analysis.seconds, started),
        **({} if theory is None else {"theory_error": theory.summary()}),
    }
