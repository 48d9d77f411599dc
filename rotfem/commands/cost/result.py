"""What a work–precision study returns, and how it is written. No dolfinx in it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rotfem.commands.cost.front import Row, describe, recommend, setting_of
from rotfem.commands.cost.reference import Reference
from rotfem.commands.cost.tuned import write_tuned
from rotfem.errors import ComputationError
from rotfem.results.files import json_text, rows_text, write_text
from rotfem.scene import Scene


@dataclass
class CostResult:
    """Outcome of `rotfem cost`.

    Attributes:
        summary: scene, output, references with orders and uncertainties, model errors, recommendation; JSON-able.
        rows: one dictionary a setting: `theory`, `elements`, `degree`, `scheme`, `step` (s), `tolerance`, `status`,
            `error`, `model_error`, `total_error`, `uncertainty` (relative), `time`, `time_min`, `time_max`, `cpu_time`,
            `setup` (s; medians of `repeats`), `dofs`, `steps`, `iterations`, `pareto`, `reason`.
        scene: the scene studied.
        references: theory ↦ its converged output.
    """

    summary: dict[str, Any]
    rows: list[Row]
    scene: Scene = field(repr=False)
    references: dict[str, Reference] = field(default_factory=dict, repr=False)

    def recommend(self, accuracy: float) -> Row | None:
        """Return the fastest row within a relative accuracy, uncertainty included; None if there is none."""
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
            raise ComputationError(
                f"no setting tried is within {wanted:g}", advice="a larger --accuracy, or smaller --steps"
            )
        error = row["error"] if row["total_error"] is None else row["total_error"]
        remark = (
            f"{self.scene.name}, tuned to a relative accuracy of {wanted:g} of {self.summary['output']}: "
            f"{describe(row)}.\nMeasured: error {error:.1e}, {row['time']:.3g} s."
        )
        return write_tuned(self.scene, setting_of(row), Path(path), remark)

    def write(self, folder: str | Path) -> list[Path]:
        """Write cost.csv, cost.json and summary.json, each whole or not at all; return their paths.

        Raises:
            OutputError: the folder cannot be written.
        """
        folder = Path(folder)
        flat = [{k: "x".join(map(str, v)) if isinstance(v, list) else v for k, v in row.items()} for row in self.rows]
        keys = ("output", "references", "model_errors", "recommended", "recommendations")
        return [
            write_text(folder / "cost.csv", rows_text(flat)),
            write_text(folder / "cost.json", json_text({**{k: self.summary[k] for k in keys}, "rows": self.rows})),
            write_text(folder / "summary.json", json_text(self.summary)),
        ]
