"""What an explanation returns: how much every effect and every theory changes the outputs of a scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from rotfem.results.files import json_text
from rotfem.results.frames import Variable, column_of_rows, dataset, frame_of_rows
from rotfem.results.result import Result
from rotfem.results.tables import ShortTable, per_cent

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure

Row = dict[str, Any]


@dataclass(repr=False)
class ExplainResult(Result):
    """Outcome of `rotfem explain`.

    Attributes:
        summary: scene, dimensionless groups, changes, warnings, timings; JSON-able.
        rows: one dictionary an effect, a theory, and steps and mesh: `kind`, `name`, `included`, `why`, `estimate`
            (output ↦ relative change; None where it is unknown, below `summary["resolution"]` round-off), `worst`,
            `verdict`; `bounds`,
            outputs whose change is only known to be below the estimate; with a check `truth` (output ↦ relative change
            of the full models).
    """

    rows: list[Row]

    @property
    def effects(self) -> dict[str, Row]:
        """Effect ↦ its row: what the outputs change by without it, or with it where the model does not have it."""
        return {row["name"]: row for row in self.rows if row["kind"] == "effect"}

    @property
    def theories(self) -> dict[str, Row]:
        """Theory ↦ its row: what the outputs change by with it in the place of the scene's own."""
        return {row["name"]: row for row in self.rows if row["kind"] == "theory"}

    @property
    def verdicts(self) -> dict[str, str]:
        """Effect or theory ↦ "negligible", "noticeable", "large" or "unknown": how much it changes the outputs."""
        return {row["name"]: row["verdict"] for row in self.rows}

    @property
    def outputs(self) -> list[str]:
        """Names of the outputs whose changes were estimated."""
        return list(self.summary["outputs"])

    def files(self) -> dict[str, str]:
        """Return explain.json and summary.json."""
        explained = {name: self.summary[name] for name in ("groups", "outputs", "resolution")} | {"rows": self.rows}
        return {"explain.json": json_text(explained), "summary.json": json_text(self.summary)}

    def drawings(self) -> dict[str, Callable[[], Figure]]:
        """Return explain.png."""
        from rotfem.results.plots_scene import explain_figure

        return {"explain.png": partial(explain_figure, self)}

    def tables(self) -> list[ShortTable]:
        """Return the dimensionless groups, then how much every effect, theory and discretisation changes the outputs.

        With a check each row is followed by one of the changes as the full models give them.
        """
        outputs = self.outputs
        groups = [(self.summary["meaning"][name], f"{value:.4g}") for name, value in self.summary["groups"].items()]
        rows = []
        for row in self.rows:
            before = {True: "without ", False: "with "}[row["included"]] if row["kind"] == "effect" else ""
            what = before + row["name"] + (" theory" if row["kind"] == "theory" else "")
            cells = [self._change(row, name) for name in outputs]
            rows.append((what, *cells, f"{row['verdict']}: {row['why']}"))
            if "truth" in row:
                rows.append(("  by the full models", *(per_cent(row["truth"].get(name)) for name in outputs)))
        head = ("change of", *(f"{name} (%)" for name in outputs), "verdict")
        return [ShortTable(("of the scene", "value (–)"), groups), ShortTable(head, rows)]

    def _change(self, row: Row, output: str) -> str:
        """Return an estimate as text; one below the resolution as smaller than that."""
        estimate, resolution = row["estimate"][output], self.summary["resolution"]
        if estimate is None:
            return "unknown"
        if 0.0 < estimate < resolution:
            return "<" + per_cent(resolution)
        return ("<" if output in row.get("bounds", ()) else "") + per_cent(estimate)

    def to_pandas(self) -> pandas.DataFrame:
        """Return one row an effect and a theory, indexed by `name`; changes are columns `estimate_…` and `truth_…`."""
        rows = []
        for row in self.rows:
            flat = {name: row[name] for name in ("name", "kind", "included", "worst", "verdict", "why")}
            for what in ("estimate", "truth"):
                flat |= {f"{what}_{output}": value for output, value in row.get(what, {}).items()}
            rows.append(flat)
        return frame_of_rows(rows, "name")

    def to_xarray(self) -> xarray.Dataset:
        """Return `estimate` and, with a check, `truth` over `name` and `output`, and the other columns over `name`.

        Infinite where a model fails, NaN where the truth was not computed.
        """
        names = ("kind", "included", "worst", "verdict", "why")
        over: dict[str, Variable] = {name: (("name",), column_of_rows(self.rows, name)) for name in names}
        for what in ("estimate", "truth"):
            if any(what in row for row in self.rows):
                values = [[row.get(what, {}).get(output, np.nan) for output in self.outputs] for row in self.rows]
                over[what] = (("name", "output"), np.array(values, dtype=np.float64))
        coordinates: dict[str, Variable] = {
            "name": (("name",), column_of_rows(self.rows, "name")),
            "output": (("output",), np.array(self.outputs, dtype=str)),
        }
        return dataset(over, coordinates, self._attributes())
