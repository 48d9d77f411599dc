"""Loads over the span as fields of the forms, each made of amplitudes that change with time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from rotfem.mechanics.span import Shapes, Span

Array = npt.NDArray[np.float64]

#: Degree of the fields of shapes, which are linear between stations that are nodes of the mesh.
LINEAR = 1


def blocked(n: int) -> tuple[int, ...]:
    """Return the shape of fields with n components; that of one is a scalar field."""
    return (n,) if n > 1 else ()


class Amplitude(ABC):
    """What the size of a load in the forms is set by.

    Attributes:
        spread: whether it is that of shapes over the span, not of the components of a vector.
        follows_nodes: whether its values are those of a function of place at the nodes of the mesh, not of the load.
    """

    spread: ClassVar[bool] = False
    follows_nodes: bool = False

    @property
    @abstractmethod
    def value(self) -> Any:
        """The amplitudes, the same on every process; what is written there holds after `update`."""

    def turned(self, value: Array, turn: Array) -> Array:
        """Return amplitudes of what is turned by a matrix (3, 3)."""
        return value

    @abstractmethod
    def update(self, turn: Array | None = None) -> None:
        """Take over what was written; vectors over the span are turned by a matrix (3, 3) if that is given."""


class Components(Amplitude):
    """The components of a vector that is the same everywhere: a constant of the forms."""

    def __init__(self, constant: fem.Constant):
        self._constant = constant

    @property
    def value(self) -> Any:
        """The components."""
        return self._constant.value

    def turned(self, value: Array, turn: Array) -> Array:
        """Return the components of the turned vector; one alone is about the axis of the turn."""
        n = value.size
        return np.asarray(turn[:n, :n] @ value) if n > 1 else value

    def update(self, turn: Array | None = None) -> None:
        """Do nothing: what is written to a constant holds."""


class SpanField(Amplitude):
    """A field f(x) = Σ_k a_k s_k(x) whose amplitudes are set as the value of a constant is.

    Attributes:
        function: the field, blocked by the components.
    """

    spread = True

    def __init__(self, function: fem.Function, basis: Array | None, places: npt.NDArray[np.int64] | None, size: int):
        self.function, self.follows_nodes = function, basis is None
        self._basis, self._places = basis, places
        self._value: Array = np.zeros(size)

    @property
    def value(self) -> Any:
        """The amplitudes a_k."""
        return self._value

    @classmethod
    def of_shapes(cls, structure: Any, shapes: tuple[Shapes, ...], n: int) -> SpanField:
        """Return the field of shapes with n components, as many amplitudes as shapes."""
        mesh = structure.mesh
        f = fem.Function(fem.functionspace(mesh, ("DG", LINEAR, blocked(n))))
        cells = f.function_space.dofmap.list
        x = f.function_space.tabulate_dof_coordinates()[:, 0]
        middles = np.empty(len(x))
        middles[cells] = x[cells].mean(axis=1)[:, None]
        parts = []
        for some in shapes:
            values = some.along(x, middles)[:, :, :n]
            if some.region:
                there = np.zeros(len(x), dtype=bool)
                there[cells[structure.cells_of(some.region)].ravel()] = True
                values = np.where(there[:, None], values, 0.0)
            parts.append(values.reshape(len(values), -1))
        basis = np.concatenate(parts)
        return cls(f, basis, None, len(basis))

    @classmethod
    def of_place(cls, structure: Any, span: Span, n: int, constant: bool) -> tuple[SpanField, Callable[[float], Array]]:
        """Return (the field through the nodes of the structure, time (s) ↦ its amplitudes) of a function of place.

        One that is constant is asked once, and has the single amplitude 1.
        """
        mesh, comm = structure.mesh, structure.comm
        degree = structure.V.element.basix_element.degree
        f = fem.Function(fem.functionspace(mesh, ("Lagrange", degree, blocked(n))))
        index, x = f.function_space.dofmap.index_map, f.function_space.tabulate_dof_coordinates()
        points = np.concatenate(comm.allgather(x[: index.size_local]))
        places = index.local_to_global(np.arange(len(x), dtype=np.int32))
        at, size = span.over(points), len(points)

        def amplitudes(t: float) -> Array:
            return np.ravel(at(t).reshape(size, -1)[:, :n])

        if constant:
            field = cls(f, amplitudes(0.0).reshape(-1, n)[places].reshape(1, -1), None, 1)
            field.follows_nodes = True
            return field, lambda t: np.ones(1)
        return cls(f, None, places, size * n), amplitudes

    @property
    def vector(self) -> Any:
        """The field as a vector of the forms."""
        return self.function if self.function.ufl_shape else ufl.as_vector([self.function])

    def update(self, turn: Array | None = None) -> None:
        """Make the field of the amplitudes; its vectors turned by a matrix (3, 3) if that is given."""
        n, a = self.function.function_space.dofmap.bs, self._value
        dofs = a @ self._basis if self._basis is not None else a.reshape(-1, n)[self._places].ravel()
        if turn is not None:
            dofs = (dofs.reshape(-1, n) @ turn[:n, :n].T).ravel()
        self.function.x.array[:] = dofs
