"""What is made of cells and nodes alone, kept for programs that compute one structure many times.

A load, a stiffness or a motion is none of the mesh, so that runs of a study mostly share it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, Protocol, Self, TypeVar

from dolfinx import fem

#: How many are kept, and the most nodes of the cells: for larger ones matrices take longer by far.
KEPT, MOST = 4, 2000


class OfSpace(Protocol):
    """What is made of a space, and is good for another one whose cells and nodes are the same ones."""

    def of(self, V: fem.FunctionSpace) -> Self:
        """Return this of another space whose cells and nodes are the same ones, in the same order."""


T = TypeVar("T", bound=OfSpace)


class ByMesh(Generic[T]):
    """Makes something of a space, or gives that of before if there is one of the same cells and nodes.

    Args:
        make: makes it of a space.
    """

    def __init__(self, make: Callable[[fem.FunctionSpace], T]):
        self._make = make
        self._made: dict[Any, T] = {}

    def __call__(self, V: fem.FunctionSpace) -> T:
        """Return it for a space."""
        mesh = V.mesh
        geometry = mesh.geometry
        if mesh.comm.size > 1 or len(geometry.x) > MOST:
            return self._make(V)
        arrays = (geometry.x, geometry.dofmap, geometry.input_global_indices, V.dofmap.list)
        key = (V.ufl_element(), geometry.cmap.degree, *(x.tobytes() for x in arrays))
        found = self._made.pop(key, None) or self._make(V)
        self._made[key] = found
        while len(self._made) > KEPT:
            self._made.pop(next(iter(self._made)))
        return found.of(V)
