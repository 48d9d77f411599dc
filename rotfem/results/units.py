"""The units in which speeds and frequencies are printed and drawn; files have SI units, those of modes these too."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from rotfem.units import quantity

SI = "rad/s"


@dataclass(frozen=True)
class ShownUnits:
    """Units of speeds and frequencies, as `[output]` of a scene names them.

    Attributes:
        speed: of the hub.
        frequency: of modes.
    """

    speed: str = SI
    frequency: str = SI

    @classmethod
    def of(cls, summary: Mapping[str, Any]) -> Self:
        """Return the units that the scene of a summary asks for."""
        scene = summary.get("scene", {})
        output = scene.get("output", {}) if isinstance(scene, Mapping) else {}
        return cls(output.get("speed", SI), output.get("frequency", SI))

    def speeds(self, values: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Return speeds (rad/s) of any shape in the unit of speeds."""
        return in_unit(values, self.speed)

    def frequencies(self, values: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Return frequencies (rad/s) of any shape in the unit of frequencies."""
        return in_unit(values, self.frequency)

    def rows(self, rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """Return rows of modes with columns more, such as `speed_rpm`, where another unit than SI is asked for."""
        named = {"speed": self.speed, "frequency": self.frequency}
        wanted = [(f"{n}_{unit.lower().replace('/', '_')}", n, unit) for n, unit in named.items() if unit != SI]
        return [
            dict(row) | {c: float(in_unit(row[n], unit)) for c, n, unit in wanted if n in row and c not in row}
            for row in rows
        ]


def in_unit(values: npt.ArrayLike, unit: str) -> npt.NDArray[np.float64]:
    """Return angular speeds or frequencies (rad/s) of any shape in another unit."""
    found = np.asarray(values, dtype=np.float64)
    return found if unit == SI else np.divide(found, quantity(f"1 {unit}", SI), dtype=np.float64)
