"""What every structure of a scene is asked, whatever its type."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rotfem.scene.values import Array, SceneModel

#: Places along a beam that a mean of its section is taken over.
PLACES = 33

#: Part of the length within which two places along a beam are one.
SAME_PLACE = 1e-7


class MeanBeam(NamedTuple):
    """The uniform beam that a structure is, roughly.

    Attributes:
        length: L (m).
        hub_radius: distance of the clamp from the axis of rotation (m).
        EA: axial stiffness (N).
        mass_per_length: kg/m, with the tip mass spread over the length.
        bending: family of modes ↦ bending stiffness EI (N·m²), and 1 across the plane of rotation, 0 in it.
    """

    length: float
    hub_radius: float
    EA: float
    mass_per_length: float
    bending: dict[str, tuple[float, float]]


def means(properties: Callable[[npt.ArrayLike], dict[str, Array]], length: float) -> dict[str, float]:
    """Return the means over a length (m) of section properties, a function of the places (m)."""
    return {name: float(np.mean(values)) for name, values in properties(np.linspace(0.0, length, PLACES)).items()}


def apart(places: Collection[float], length: float) -> tuple[float, ...]:
    """Return places along a beam (m) in order, but one of those that only round-off keeps apart, and no end."""
    out = [0.0]
    for x in sorted(places):
        if x - out[-1] > SAME_PLACE * length and length - x > SAME_PLACE * length:
            out.append(x)
    return tuple(out[1:])


class StructureTable(SceneModel):
    """The [structure] table."""

    @property
    def is_planar(self) -> bool:
        """Whether it moves in the plane (1, 2) of the frame only, and has rotations about axis 3 only."""
        return False

    @property
    def knots(self) -> tuple[float, ...]:
        """Places (m) along a beam, increasing, at which tables have rows or something stands."""
        return ()

    @property
    def nodes(self) -> tuple[float, ...]:
        """Those of them, increasing, that its mesh must have nodes at: masses, and kinks of its axis."""
        return ()

    @property
    def hinges(self) -> dict[int, Any]:
        """Axis, 1 to 3, ↦ name, stiffness and damping of the turn that the root may make about it."""
        return {}

    @property
    def pitches(self) -> bool:
        """Whether it has a pitch that changes with time."""
        return False

    @property
    def has_fibers(self) -> bool:
        """Whether its sections twist about an axis, beside which they have fibers that this stretches."""
        return False

    @property
    def mesh_file(self) -> str | None:
        """Absolute path of the file that its mesh is in, None if [mesh] has numbers of elements."""
        return None

    @property
    def release_limit(self) -> float | None:
        """Size (m) that a displacement of the tip must stay below to be released from; None if it cannot be."""
        return None

    def mean_beam(self) -> MeanBeam | None:
        """Return the uniform beam that it is, roughly; None if it is like none, or that is not known."""
        return None
