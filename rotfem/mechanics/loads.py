"""Applied loads as functions of time: what the forms' amplitude constants are set to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


class Load(Protocol):
    """A force or moment over time."""

    @property
    def kind(self) -> str:
        """What its direction does: "dead" keeps it in the frame, "follower" turns with the section."""

    @property
    def table(self) -> tuple[tuple[float, ...], ...] | None:
        """Rows (t, components…), linear between; None where it is no table."""

    @property
    def is_zero(self) -> bool:
        """Whether it is zero at all times."""

    @property
    def constant(self) -> bool:
        """Whether it does not change with time."""

    def at(self, t: float) -> Array:
        """Return its components at time t (s)."""


@dataclass(frozen=True)
class ConstantLoad:
    """A load that does not change with time.

    Attributes:
        value: components, N, N/m or N·m.
        kind: see `Load`.
    """

    value: tuple[float, ...]
    kind: Literal["dead", "follower"] = "dead"
    table: None = None
    constant: bool = True
    is_zero: bool = False

    def at(self, t: float) -> Array:
        """Return its components."""
        return np.array(self.value, dtype=np.float64)


class Applied(Protocol):
    """Gravity and the loads on a structure, None where there is none."""

    @property
    def gravity(self) -> tuple[float, ...]:
        """Acceleration of gravity, m/s², inertial axes."""

    @property
    def tip_force(self) -> Load | None:
        """Force at the tip, N."""

    @property
    def tip_moment(self) -> Load | None:
        """Moment at the tip, N·m."""

    @property
    def distributed(self) -> Load | None:
        """Force per length of a beam, N/m, or per area of a plate, N/m²."""


@dataclass(frozen=True)
class Loads:
    """Gravity and applied loads (see `Applied`); none by default."""

    gravity: tuple[float, ...] = (0.0, 0.0, 0.0)
    tip_force: Load | None = None
    tip_moment: Load | None = None
    distributed: Load | None = None
