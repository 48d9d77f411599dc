"""Structures: what is meshed, which spaces hold it, what carries mass and strain."""

from __future__ import annotations

from typing import Any

from mpi4py import MPI

from rotfem.mechanics.problem import Problem
from rotfem.registry import resolved, structures


def build(problem: Problem, comm: MPI.Comm = MPI.COMM_WORLD) -> Any:
    """Return the discretised structure of a problem."""
    return resolved(structures[problem.structure.type].discretised)(problem, comm)
