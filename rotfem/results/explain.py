"""What an explanation returns: how much every effect and every theory changes the outputs of a scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotfem.results.columns import ShortTable, per_cent
from rotfem.results.files import json_text
from rotfem.results.result import Row, Rows, Variables, column_of_rows


@dataclass(repr=False)
class ExplainResult(Rows):
    """Outcome of `rotfem explain`.

    Attributes:
        summary: scene, dimensionless groups, changes, warnings, timings; JSON-able.
        rows: one dictionary an effect, a theory, and steps and mesh: `kind`, `name`, `included`, `why`, `estimate`
            (output ↦ relative change; None where it is unknown, below `summary["resolution"]` round-off), `worst`,
            `verdict`; `bounds`,
            outputs whose change is only known to be below the estimate; with a check `truth` (output ↦ relative change
            of the full models).
    """

    index = ("name",)

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

    def texts(self) -> dict[str, str]:
        """Return explain.json."""
        explained = {name: self.summary[name] for name in ("groups", "outputs", "resolution")} | {"rows": self.rows}
        return {"explain.json": json_text(explained)}

    def drawn(self) -> dict[str, str]:
        """Return explain.png."""
        return {"explain.png": "results.plots_scene:explain_figure"}

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

    def flat_rows(self) -> list[Row]:
        """Return one row an effect and a theory; changes are columns `estimate_…` and `truth_…`."""
        rows = []
        for row in self.rows:
            flat = {name: row[name] for name in ("name", "kind", "included", "worst", "verdict", "why")}
            for what in ("estimate", "truth"):
                flat |= {f"{what}_{output}": value for output, value in row.get(what, {}).items()}
            rows.append(flat)
        return rows

    def arrays(self) -> tuple[Variables, Variables]:
        """Return `estimate` and, with a check, `truth` over `name` and `output`, and the other columns over `name`.

        Infinite where a model fails, NaN where the truth was not computed.
        """
        names = ("kind", "included", "worst", "verdict", "why")
        over: Variables = {name: (("name",), column_of_rows(self.rows, name)) for name in names}
        for what in ("estimate", "truth"):
            if any(what in row for row in self.rows):
                values = [[row.get(what, {}).get(output, np.nan) for output in self.outputs] for row in self.rows]
                over[what] = (("name", "output"), np.array(values, dtype=np.float64))
        names_of = {"name": [row["name"] for row in self.rows], "output": self.outputs}
        return over, {key: ((key,), np.array(values, dtype=str)) for key, values in names_of.items()}
