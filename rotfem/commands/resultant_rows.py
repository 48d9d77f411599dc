"""Stress resultants of a plate while a run goes on: the last ones, those of its fields, and the largest stress."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.commands.finite import check_finite
from rotfem.equations.plate_resultants import PlateResultants
from rotfem.structures.paraview import Snapshots

Array = npt.NDArray[np.float64]

#: What the equivalent stress is called.
STRESS = "von_mises"


class ResultantRows:
    """Takes the states of the rows of a history.

    Args:
        system: equations of motion of a plate, the hub held.
        names: of the resultants that are wanted.

    Attributes:
        frames: values (nodes, names) at the times of the fields' snapshots, which the recorder adds.
        last: at the last row.
        largest: largest equivalent stress (Pa) so far, where, and when: value, x, y (m), t (s).
    """

    def __init__(self, system: Any, names: tuple[str, ...]):
        self.names, self._system = names, system
        self._resultants = PlateResultants(system)
        self._columns = [self._resultants.names.index(name) for name in names]
        self._stress = self._resultants.names.index(STRESS)
        self.frames = Snapshots()
        self.last: Array | None = None
        self.largest: tuple[float, ...] = ()

    def __call__(self, t: float) -> float:
        """Keep the values at the state that is written into the system; return the largest equivalent stress, Pa.

        Raises:
            ComputationError: a number is not finite.
        """
        values = self._resultants()
        worst = int(np.argmax(values[:, self._stress]))
        stress = float(values[worst, self._stress])
        check_finite([("the equivalent stress", float(values.sum()))], t)
        if not self.largest or stress > self.largest[0]:
            coordinates = self._system.structure.nodes(self._system.zeros())[0]
            self.largest = (stress, float(coordinates["x"][worst]), float(coordinates["y"][worst]), t)
        self.last = values[:, self._columns]
        return stress

    def columns(self) -> dict[str, Array]:
        """Return the positions of the nodes (m), and the resultants of the last row; empty of no row."""
        if self.last is None:
            return {}
        coordinates = self._system.structure.nodes(self._system.zeros())[0]
        return {**coordinates, **dict(zip(self.names, self.last.T, strict=True))}

    def summary(self) -> dict[str, float]:
        """Return the largest equivalent stress (Pa), where (m) and when (s)."""
        return dict(zip((STRESS, "x", "y", "t"), self.largest, strict=False))

    def kept_arrays(self) -> dict[str, Any]:
        """Return what a checkpoint has of it."""
        kept = self.frames.kept
        frames = {"t": [t for t, _ in kept], "values": np.array([x for _, x in kept])}
        more = {name: value for name, value in vars(self.frames).items() if name != "kept"}
        return {"frames": frames, "more": more, "last": self.last, "largest": list(self.largest)}

    def put_back(self, known: dict[str, Any], rows: int) -> None:
        """Take what a checkpoint has, where the history has so many rows.

        Raises:
            ValueError: it is not what there is after so many.
        """
        frames, last = known["frames"], known["last"]
        kept = [(float(t), x) for t, x in zip(frames["t"], frames["values"], strict=True)]
        if any(x.shape != last.shape for _, x in kept) or len(known["largest"]) != 4:  # value, x, y, t
            raise ValueError("resultants")
        self.frames.put_back({**known["more"], "kept": kept}, rows)
        self.last, self.largest = last, tuple(known["largest"])
