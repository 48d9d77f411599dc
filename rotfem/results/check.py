"""What a check returns: what a structure is before it is computed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rotfem.results.columns import ShortTable, number, numbers
from rotfem.results.files import csv_text
from rotfem.results.result import Array, Result, Variables, frame

if TYPE_CHECKING:
    import pandas


@dataclass(repr=False)
class CheckResult(Result):
    """Outcome of `rotfem check`. Vectors and tensors are in frame axes.

    Attributes:
        summary: `length` (m), `mass` (kg), `center_of_mass` (m, from the origin of the frame), `root` (position of the
            clamp, m), `first_moment_root` (kg·m), `inertia_root` and `inertia_center` (kg·m², 3×3, about the clamp and
            the centre of mass), `inertia_axis` (kg·m², about the axis of rotation), `elements`, warnings; JSON-able.
        columns: of a beam, properties along it over `x` (m).
        nodes: coordinates of the nodes by name (m).
        triangles: between the nodes, of a plate; None of a beam.
    """

    summary: dict[str, Any]
    columns: dict[str, Array]
    nodes: dict[str, Array]
    triangles: npt.NDArray[np.int64] | None = None

    @property
    def mass(self) -> float:
        """All mass, of the tip too, kg."""
        return float(self.summary["mass"])

    @property
    def center_of_mass(self) -> Array:
        """Centre of mass from the origin of the frame, m, shape (3,)."""
        return np.array(self.summary["center_of_mass"])

    @property
    def inertia(self) -> Array:
        """Inertia tensor about the clamp, kg·m², shape (3, 3)."""
        return np.array(self.summary["inertia_root"])

    def texts(self) -> dict[str, str]:
        """Return check.csv, of a beam."""
        return {"check.csv": csv_text(self.columns)} if self.columns else {}

    def drawn(self) -> dict[str, str]:
        """Return check.png."""
        return {"check.png": "results.plots_scene:check_figure"}

    def tables(self) -> list[ShortTable]:
        """Return length, mass and inertia about the axis of rotation, then vectors and tensors in frame axes."""
        of = self.summary
        scalars = [
            ("length (m)", number(of["length"], digits=9)),
            ("mass (kg)", number(of["mass"], digits=9)),
            ("moment of inertia about the axis of rotation (kg·m²)", number(of["inertia_axis"], digits=9)),
        ]
        vectors = [
            ("root, from the origin of the frame (m)", *numbers(of["root"])),
            ("centre of mass, from there too (m)", *numbers(of["center_of_mass"])),
            ("mass × its distance from the root (kg·m)", *numbers(of["first_moment_root"])),
        ]
        for where, name in (("root", "root"), ("center", "centre of mass")):
            tensor = np.array(of[f"inertia_{where}"])
            scale = float(np.max(np.abs(tensor)))
            vectors += [
                (f"inertia tensor about the {name} (kg·m²)" if i == 0 else "", *(number(x, scale) for x in row))
                for i, row in enumerate(tensor)
            ]
        return [ShortTable(("", ""), scalars), ShortTable(("axes of the frame", "1", "2", "3"), vectors)]

    def to_pandas(self) -> pandas.DataFrame:
        """Return the properties along a beam, indexed by `x`; of a plate the coordinates of its nodes."""
        columns = self.columns or self.nodes
        return frame(columns, next(iter(columns)))

    def arrays(self) -> tuple[Variables, Variables]:
        """Return the properties along a beam over `x`; of a plate the coordinates over `node`."""
        columns = self.columns or {"node": np.arange(len(next(iter(self.nodes.values()))), dtype=float), **self.nodes}
        name, *others = columns
        return {other: ((name,), columns[other]) for other in others}, {name: ((name,), columns[name])}
