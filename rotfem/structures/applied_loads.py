"""What is applied to a structure: forces and moments with their amplitudes in the forms."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from rotfem.mechanics.bodies import AppliedLoad, Kinematics
from rotfem.mechanics.loads import Load, PointLoads, named
from rotfem.mechanics.problem import Problem
from rotfem.structures.load_fields import Amplitude, Components, SpanField
from rotfem.structures.points import Points

Array = npt.NDArray[np.float64]


def _first(load: Load, n: int, t: float) -> Array:
    return load.at(t)[:n]


class LoadsOfStructure:
    """The loads of a structure (see `rotfem.structures.structure.Structure`).

    Attributes:
        load_constants: name of a load ↦ its amplitude, and what this is at time t (s).
    """

    #: Components of a force.
    dimension: ClassVar[int] = 3

    problem: Problem
    comm: Any
    mesh: Any
    V: fem.FunctionSpace
    k: Kinematics
    dx: Any
    tip: Any
    points: Points
    load_constants: dict[str, tuple[Amplitude, Callable[[float], Array]]]

    def position(self, q: Any) -> Any:
        """Return the axis or mid-surface r(q), frame components (m)."""
        raise NotImplementedError

    def turned(self, q: Any, v: Any) -> Any:
        """Return a vector that turns with the section, frame components; v is what it is at q = 0."""
        raise NotImplementedError

    def constant(self, value: npt.ArrayLike) -> fem.Constant:
        """Return a constant on the mesh: its value can change without a new compilation."""
        raise NotImplementedError

    def loads(self) -> list[AppliedLoad]:
        """Return the problem's non-zero loads."""
        raise NotImplementedError

    def forces(self) -> list[AppliedLoad]:
        """Return the problem's non-zero forces; dead ones keep their direction in the frame, followers turn."""
        loads, q = self.problem.loads, self.k.q
        given = [("tip_force", loads.tip_force, self.tip), ("distributed", loads.distributed, self.dx)]
        given += [(f"at.{i}.force", p.force, self.points.measure(p.x)) for i, p in enumerate(self.point_loads)]
        out = []
        for name, load, measure in given:
            if load is None or load.is_zero:
                continue
            f = self.amplitude(name, load, self.dimension)
            dead = load.kind == "dead"
            vector = ufl.as_vector([f[i] if i < self.dimension else 0 for i in range(3)])
            force = vector if dead else self.turned(q, vector)
            out.append(AppliedLoad(name, self.spread(name, force), self.position(q), measure, dead))
        return out

    @property
    def point_loads(self) -> tuple[PointLoads, ...]:
        """What works at points of the structure."""
        return getattr(self.problem.loads, "at", ())

    def moments(self) -> Iterator[tuple[str, Load, Any]]:
        """Yield name, load and measure of the problem's non-zero moments."""
        given = [("tip_moment", self.problem.loads.tip_moment, self.tip)]
        given += [(f"at.{i}.moment", p.moment, self.points.measure(p.x)) for i, p in enumerate(self.point_loads)]
        yield from ((name, load, measure) for name, load, measure in given if load is not None and not load.is_zero)

    def spread(self, name: str, load: Any) -> Any:
        """Return the density of a load on its measure: the load itself at a point and where it is a density already."""
        return load

    def amplitude(self, name: str, load: Load, size: int) -> Any:
        """Return the amplitude of a load in the forms, its first `size` components: a constant, or a field over it."""
        span = load.span
        if span is None:
            return self.add_load(name, size, partial(_first, load, size))
        if span.shapes is None:
            field, at = SpanField.of_place(self, span, size, load.constant)
        else:
            field, at = SpanField.of_shapes(self, tuple(span.shapes), size), load.at
        self.load_constants[name] = (field, at)
        return field.vector

    def add_load(self, name: str, size: int, at: Callable[[float], Array]) -> fem.Constant:
        """Return the amplitude constant (size,) of a load and remember at(t), its value at time t (s)."""
        constant = self.constant(np.zeros(size))
        self.load_constants[name] = (Components(constant), at)
        return constant

    def update_loads(self, turn: Array | None = None) -> None:
        """Make the fields of loads over the span of the amplitudes that have been set.

        Args:
            turn: matrix (3, 3) that turns those of dead loads, in a frame that does not turn with the hub.
        """
        loads = named(self.problem.loads)
        for name, (amplitude, _) in self.load_constants.items():
            amplitude.update(turn if loads[name].kind == "dead" else None)

    def cells_of(self, region: str) -> npt.NDArray[np.int32]:
        """Return the local cells of a region of the mesh; a structure without regions is not asked."""
        raise NotImplementedError
