"""Which processes share a mesh, and how they share out what there is many of."""

from __future__ import annotations

from typing import Any

import pytest
from mpi4py import MPI

import rotfem
from rotfem.commands.processes import SHARED_FROM, communicator, shared_out, unknowns
from rotfem.scene import as_scene
from tests.beams import STRUCTURE

BEAM: dict[str, Any] = {
    "structure": STRUCTURE,
    "motion": {"type": "constant", "speed": 1.0},
    "mesh": {"elements": 4, "degree": 3},
}


class Ranks:
    """A communicator of several ranks, of which this is one; what the others send is given."""

    def __init__(self, rank: int, size: int, others: list[Any] | None = None):
        self.rank, self.size, self.others = rank, size, others or []

    def allgather(self, value: Any) -> list[Any]:
        return [*self.others[: self.rank], value, *self.others[self.rank :]]


def problem(elements: int) -> rotfem.Problem:
    return rotfem.Problem.of(as_scene(BEAM).replace({"mesh.elements": elements}))


def test_unknowns_are_those_of_the_compiled_system() -> None:
    for elements in (1, 4):
        V = problem(elements).system(moving=False, comm=MPI.COMM_SELF).V
        assert unknowns(problem(elements)) == V.dofmap.index_map.size_global * V.dofmap.index_map_bs


def test_a_mesh_is_shared_from_so_many_unknowns_for_each_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROTFEM_SHARED_FROM", raising=False)
    two: Any = Ranks(0, 2)
    assert communicator(problem(4), two) is MPI.COMM_SELF
    large = 2 * SHARED_FROM // 9 + 1
    assert communicator(problem(large), two) is two
    assert communicator(problem(large), Ranks(0, 3)) is MPI.COMM_SELF  # type: ignore[arg-type]
    monkeypatch.setenv("ROTFEM_SHARED_FROM", "0")
    assert communicator(problem(4), two) is two


@pytest.mark.parametrize(("number", "size"), [(7, 3), (2, 3), (0, 2), (5, 1)])
def test_every_item_is_done_by_one_rank(number: int, size: int) -> None:
    parts: list[list[int]] = []
    for rank in range(size):
        comm: Any = Ranks(rank, size, [([], None)] * (size - 1))
        parts.append(shared_out(range(number), lambda i: i, comm))
    assert [i for part in parts for i in part] == list(range(number))
    assert max(map(len, parts)) - min(map(len, parts)) <= 1
