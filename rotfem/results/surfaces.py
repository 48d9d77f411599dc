"""Surfaces that modes move: the mid-surface of a plate, and a beam as wide and as thick as its sections.

A point of a section follows its centre and turns with it: u + θ × r, r from the centre to the point.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

#: A section is drawn as the rectangle of its radii of gyration: half its width is √3 of one.
HALF_WIDTH = np.sqrt(3.0)

#: Least half width of the broader side of a section, part of the length, so that one sees it turn.
LEAST = 0.012


@dataclass(frozen=True)
class Surface:
    """A surface and what moves it.

    Attributes:
        points: where its points are in the frame, (k, 3), m.
        triangles: numbers of points, (m, 3).
        nodes: for each point the node of a mode shape that carries it, (k,).
        arms: from there to the point, (k, 3), m.
        length: of the structure, by which rotations of shapes are multiplied, m.
    """

    points: Array
    triangles: npt.NDArray[np.int64]
    nodes: npt.NDArray[np.int64]
    arms: Array
    length: float

    @classmethod
    def of_plate(cls, places: Array, triangles: npt.NDArray[np.int64], length: float) -> Surface:
        """Return the mid-surface through nodes at places (n, 3), m."""
        return cls(places, triangles, np.arange(len(places)), np.zeros_like(places), length)

    @classmethod
    def of_beam(cls, places: Array, sides: tuple[Array, Array], length: float) -> Surface:
        """Return the four sides and both ends of a beam with rectangular sections.

        Places are those of the nodes on the axis; sides half the widths and half the heights as vectors, (n, 3), m.
        """
        n, (a, b) = len(places), sides
        sizes = [np.linalg.norm(side, axis=1) for side in sides]
        grown = np.maximum(1.0, LEAST * length / np.maximum(*sizes))[:, None]
        arms = np.stack([a + b, a - b, -a - b, -a + b], axis=1) * grown[:, None]
        ring = 4 * np.arange(n - 1)[:, None] + np.arange(4)
        following = 4 * np.arange(n - 1)[:, None] + (np.arange(4) + 1) % 4
        walls = [np.stack(t, axis=-1) for t in ((ring, following, ring + 4), (following, following + 4, ring + 4))]
        ends = np.array([[0, 2, 1], [0, 3, 2]])
        triangles = np.concatenate([*(wall.reshape(-1, 3) for wall in walls), ends, 4 * (n - 1) + ends[:, ::-1]])
        nodes = np.repeat(np.arange(n), 4)
        return cls((places[:, None] + arms).reshape(-1, 3), triangles, nodes, arms.reshape(-1, 3), length)

    def moved(self, shape: Mapping[str, Array]) -> Array:
        """Return the complex displacements (k, 3) of the points in a mode (columns of `ModesResult.shapes`)."""
        zero = np.zeros(len(shape["x"]))

        def vector(names: tuple[str, str, str]) -> Array:
            parts = [shape.get(n, zero) + 1j * shape.get(f"{n}_imag", zero) for n in names]
            return np.column_stack(parts)[self.nodes]

        turns = vector(("theta1", "theta2", "theta3" if "theta3" in shape else "alpha")) / self.length
        return np.asarray(vector(("u1", "u2", "u3")) + np.cross(turns, self.arms))

    def frames(self, shapes: Mapping[str, Mapping[str, Array]], first: int) -> Iterator[tuple[float, dict[str, Array]]]:
        """Yield (number of the mode, its real and imaginary displacements), for files; `first` is that of the first."""
        for number, shape in enumerate(shapes.values(), start=first):
            z = self.moved(shape)
            yield float(number), {"displacement": z.real, "displacement_imag": z.imag}
