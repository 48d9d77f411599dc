"""What a work–precision study returns, and how it is written. No dolfinx in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rotfem.commands.cost.front import Row, describe, judged, recommend, setting_of
from rotfem.commands.cost.reference import Reference
from rotfem.commands.cost.report import cost_report
from rotfem.commands.cost.settings import Setting
from rotfem.commands.cost.tuned import write_tuned
from rotfem.errors import ComputationError
from rotfem.results import Result
from rotfem.results.files import json_text, rows_text
from rotfem.results.frames import Variable, column_of_rows, dataset, frame_of_rows
from rotfem.scene import Scene

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class CostPoint:
    """What one setting costs, and what it gives.

    Attributes:
        setting: theory, mesh, degree, scheme and step.
        time: of one run without its set-up, median, s.
        cost: CPU time of one run with its set-up, s: what settings are ranked by.
        error: relative, that of the theory included where it is known.
        pareto: whether no other setting is as fast and as exact, and better in one.
    """

    setting: Setting
    time: float
    cost: float
    error: float
    pareto: bool

    @classmethod
    def of(cls, row: Row) -> CostPoint | None:
        """Return the point of a row; None if its setting failed or there is nothing to judge it by."""
        error = judged(row)
        return (
            None
            if error is None
            else cls(setting_of(row), float(row["time"]), float(row["cost"]), error, bool(row["pareto"]))
        )

    def __str__(self) -> str:
        return f"{describe(self.setting.key())}: error {self.error:.1e}, {self.cost:.3g} s of CPU time"


@dataclass
class CostResult(Result):
    """Outcome of `rotfem cost`.

    Attributes:
        summary: scene, output, references with orders and uncertainties, model errors, recommendation; JSON-able.
        rows: one dictionary a setting: `theory`, `elements`, `degree`, `scheme`, `step` (s), `tolerance`, `status`,
            `error`, `model_error`, `total_error`, `uncertainty` (relative), `time`, `time_min`, `time_max`, `cpu_time`,
            `setup` (s; medians of `repeats`), `dofs`, `steps`, `iterations`, `pareto`, `reason`.
        scene: the scene studied.
        references: theory ↦ its converged output.
    """

    rows: list[Row]
    scene: Scene = field(repr=False)
    references: dict[str, Reference] = field(default_factory=dict, repr=False)

    @property
    def points(self) -> list[CostPoint]:
        """Time and error of every setting that could be computed and judged, in the order they were tried."""
        return [point for point in map(CostPoint.of, self.rows) if point is not None]

    @property
    def front(self) -> list[CostPoint]:
        """The points that no other one beats in both time and error, cheapest first."""
        return sorted((point for point in self.points if point.pareto), key=lambda point: point.cost)

    @property
    def recommended(self) -> CostPoint | None:
        """The cheapest setting within the accuracy that was asked for, uncertainty included; None if there is none."""
        row = self.summary["recommended"]
        return None if row is None else CostPoint.of(row)

    def recommend(self, accuracy: float) -> Row | None:
        """Return the cheapest row within a relative accuracy, uncertainty included; None if there is none."""
        return recommend(self.rows, accuracy, self.summary["uncertainty"] or 0.0)

    def write_tuned(self, path: str | Path, accuracy: float | None = None) -> Path:
        """Write the scene with the recommended setting; return its path.

        Args:
            path: TOML file to write.
            accuracy: relative; that of the study if None.

        Raises:
            ComputationError: no setting is that accurate.
            SceneError: the scene holds a Python function.
            OutputError: the file cannot be written.
        """
        wanted = self.summary["accuracy"] if accuracy is None else accuracy
        row = self.recommend(wanted)
        if row is None:
            ahead = self.summary.get("outlook") if wanted == self.summary["accuracy"] else None
            more = "smaller --steps" if ahead is None else f"a --budget of about {ahead['budget']:.0f}s"
            raise ComputationError(f"no setting tried is within {wanted:g}", advice=f"a larger --accuracy, or {more}")
        error = row["error"] if row["total_error"] is None else row["total_error"]
        remark = (
            f"{self.scene.name}, tuned to a relative accuracy of {wanted:g} of {self.summary['output']}: "
            f"{describe(row)}.\nMeasured: error {error:.1e}, known to {self.summary['uncertainty']:.0e}; "
            f"{row['cost']:.3g} s of CPU time with set-up."
        )
        return write_tuned(self.scene, setting_of(row), Path(path), remark)

    def report(self, folder: Path) -> list[str]:
        """Return the lines that the command prints."""
        return cost_report(self.summary, self.rows, folder)

    def _flat_rows(self) -> list[Row]:
        """Return the rows with numbers of elements as text where they are two."""
        return [{k: "x".join(map(str, v)) if isinstance(v, list) else v for k, v in row.items()} for row in self.rows]

    def files(self) -> dict[str, str]:
        """Return cost.csv, cost.json and summary.json."""
        keys = ("output", "references", "model_errors", "recommended", "recommendations")
        return {
            "cost.csv": rows_text(self._flat_rows()),
            "cost.json": json_text({**{k: self.summary[k] for k in keys}, "rows": self.rows}),
            "summary.json": json_text(self.summary),
        }

    def drawings(self) -> dict[str, Callable[[], Figure]]:
        """Return cost.png, and scaling.png where more than one size of a theory was computed."""
        from rotfem.commands.cost.plot import cost_figure
        from rotfem.commands.cost.plot_scaling import scaling_figure

        further = {"scaling.png": partial(scaling_figure, self)} if self.summary["scaling"] else {}
        return {"cost.png": partial(cost_figure, self), **further}

    def to_pandas(self) -> pandas.DataFrame:
        """Return one row a setting, as in cost.csv.

        Raises:
            ImportError: pandas is not installed.
        """
        return frame_of_rows(self._flat_rows())

    def to_xarray(self) -> xarray.Dataset:
        """Return the columns of cost.csv over `setting`, the number of the row from 0 on.

        Raises:
            ImportError: xarray is not installed.
        """
        rows = self._flat_rows()
        over: dict[str, Variable] = {name: (("setting",), column_of_rows(rows, name)) for name in rows[0]}
        coordinates: dict[str, Variable] = {"setting": (("setting",), np.arange(len(rows)))}
        return dataset(over, coordinates, self._attributes())
