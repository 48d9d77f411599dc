"""What a check and an explanation of a scene return: what its structure is, and what effects and theories change."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rotfem.results.columns import ZERO, Columns, ShortTable, number, numbers, per_cent
from rotfem.results.result import Array, Result, Row, Rows
from rotfem.results.surfaces import Surface

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Panels of properties: names in one panel, its label, whether on a logarithmic axis.
PANELS = (
    (("mass_per_length",), "mass (kg/m)", False),
    (("EA", "GA", "GA2", "GA3"), "EA, GA (N)", True),
    (("EI", "EI2", "EI3", "GJ"), "EI, GJ (N·m²)", True),
    (("rotary_inertia", "rotary_inertia2", "rotary_inertia3"), "inertia (kg·m)", False),
    (("pretwist",), "pretwist (°)", False),
    (("mass_center_y", "tension_center_y", "shear_center_y"), "centres, y (m)", False),
    (("mass_center_z", "tension_center_z", "shear_center_z"), "centres, z (m)", False),
)


@dataclass(repr=False)
class CheckResult(Result):
    """Outcome of `rotfem check`. Vectors and tensors are in frame axes.

    Attributes:
        summary: `length` (m), `mass` (kg), `center_of_mass` (m, from the origin of the frame), `root` (position of the
            clamp, m), `first_moment_root` (kg·m), `inertia_root` and `inertia_center` (kg·m², 3×3, about the clamp and
            the centre of mass), `inertia_axis` (kg·m², about the axis of rotation), `elements`, warnings; JSON-able.
        columns: of a beam, properties along it over `x` (m).
        nodes: coordinates of the nodes by name (m).
        surface: of the structure, as modes move it.
    """

    summary: dict[str, Any]
    columns: dict[str, Array]
    nodes: dict[str, Array]
    surface: Surface
    figure = "results.of_scene:check_figure"

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

    @property
    def table(self) -> Columns:
        """Properties along a beam over `x`; of a plate the coordinates of its nodes."""
        return Columns(self.columns, ("x",)) if self.columns else Columns(self.nodes, dimension="node")

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


def check_figure(result: CheckResult) -> Figure:
    """Return the structure as seen along axes 3, 2 and 1 with its centre of mass, and properties along a beam.

    A shaft is drawn from the side, with its steps, disks and bearings.
    """
    from matplotlib.figure import Figure

    from rotfem.results.plots import dress
    from rotfem.results.plots_shaft import draw_shaft

    columns = result.columns
    there = [(tuple(n for n in names if n in columns), title, log) for names, title, log in PANELS]
    panels = [panel for panel in there if any(np.any(columns[n]) for n in panel[0])]
    figure = Figure(figsize=(10, 4.2 + 1.2 * len(panels)), layout="constrained")
    grid = figure.add_gridspec(2 + len(panels), 4, height_ratios=[1.7, 1.7, *[1.0] * len(panels)])
    points, center = result.surface.points, result.summary["center_of_mass"]
    if of_shaft := result.frame == "fixed":
        draw_shaft(figure.add_subplot(grid[:2, :]), result.summary["scene"]["structure"])
    for spot, i, j in () if of_shaft else ((grid[0, :3], 0, 1), (grid[1, :3], 0, 2), (grid[:2, 3], 1, 2)):
        axis = figure.add_subplot(spot)
        axis.triplot(points[:, i], points[:, j], result.surface.triangles, lw=0.3, color="0.4")
        axis.plot(center[i], center[j], "o", ms=6, mfc="none", color="C3", label="centre of mass")
        if j == 1:
            axis.legend(fontsize=7, loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False)
        dress(axis, f"axis {i + 1} (m)", f"axis {j + 1} (m)")
        if (i, j) == (1, 2):  # the angles of sections are what they are
            axis.set_aspect("equal", adjustable="datalim")
    for row, (names, title, logarithmic) in enumerate(panels, start=2):
        axis = figure.add_subplot(grid[row, :])
        for name, dashes in zip(names, ("-", "--", ":", "-."), strict=False):  # equal ones lie on each other
            values = np.degrees(columns[name]) if name == "pretwist" else columns[name]
            axis.plot(columns["x"], values, lw=1.3, ls=dashes, label=name)
        found = np.concatenate([columns[name] for name in names])
        if logarithmic and np.max(found) > 10.0 * np.min(found) > 0.0:
            axis.set_yscale("log")
        last = row == len(panels) + 1
        axis.set_xlim(columns["x"][0], columns["x"][-1])
        dress(axis, "position X along the axis (m)" if last else "", title)
        axis.tick_params(labelbottom=last)
        if len(names) > 1:
            axis.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)
    s = result.summary
    figure.suptitle(
        f"{s['name']}: {s['mass']:.6g} kg, {s['length']:.6g} m, axes of the {result.frame} frame", fontsize=10
    )
    return figure


# --- explanations -----------------------------------------------------------------------------------------------------


@dataclass(repr=False)
class ExplainResult(Rows):
    """Outcome of `rotfem explain`.

    Attributes:
        summary: scene, changes, the model that it calls for, warnings, timings; JSON-able.
        rows: one dictionary an effect and a theory: `kind`, `name`, `included`, `why`, `estimate`
            (output ↦ relative change; None where it is unknown, below `summary["resolution"]` round-off), `worst`,
            `verdict`.
    """

    index = ("name",)
    figure = "results.of_scene:explain_figure"

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
    def needed(self) -> dict[str, Any]:
        """Keys ↦ values of the scene with the theory and the effects that it calls for (see `summary["needed"]`)."""
        found = self.summary["needed"]
        return {"model.theory": found["theory"], "model.effects": found["effects"]}

    @property
    def outputs(self) -> list[str]:
        """Names of the outputs whose changes were estimated."""
        return list(self.summary["outputs"])

    def tables(self) -> list[ShortTable]:
        """Return how much every effect and theory changes the outputs."""
        outputs, rows = self.outputs, []
        for row in self.rows:
            before = {True: "without ", False: "with "}[row["included"]] if row["kind"] == "effect" else ""
            what = before + row["name"] + (" theory" if row["kind"] == "theory" else "")
            cells = [self._change(row, name) for name in outputs]
            rows.append((what, *cells, f"{row['verdict']}: {row['why']}"))
        head = ("change of", *(f"{name} (%)" for name in outputs), "verdict")
        return [ShortTable(head, rows)]

    def _change(self, row: Row, output: str) -> str:
        """Return an estimate as text; one below the resolution as smaller than that."""
        estimate, resolution = row["estimate"][output], self.summary["resolution"]
        if estimate is None:
            return "–" if row["verdict"] == "not available" else "unknown"
        if 0.0 < estimate < resolution:
            return "<" + per_cent(resolution)
        return per_cent(estimate)

    def flat_rows(self) -> list[Row]:
        """Return one row an effect and a theory; changes are columns `estimate_…`."""
        names = ("name", "kind", "included", "worst", "verdict", "why")
        return [
            {name: row[name] for name in names} | {f"estimate_{output}": x for output, x in row["estimate"].items()}
            for row in self.rows
        ]


def explain_figure(result: ExplainResult) -> Figure:
    """Return a bar for every effect and theory: relative change of each output."""
    from matplotlib.figure import Figure

    rows, outputs = result.rows, result.summary["outputs"]
    figure = Figure(figsize=(8, 0.45 * len(rows) + 1.4), layout="constrained")
    axis = figure.add_subplot()
    shown = [v for row in rows for v in row["estimate"].values() if v and ZERO < v < np.inf]
    left, right = 10 ** np.floor(np.log10(min([*shown, 1e-2]))) / 3, 3 * max([*shown, 1.0])
    height = 0.8 / max(len(outputs), 1)
    for j, output in enumerate(outputs):
        for i, row in enumerate(rows):
            known, at = row["estimate"].get(output, 0.0), i + (j - (len(outputs) - 1) / 2) * height
            value = left if known is None else known
            width = float(np.clip(value, left, right)) - left
            axis.barh(at, width, height, left=left, color=f"C{j}", label=output if i == 0 else None)
            if known is None:
                axis.annotate("unknown", (left, at), (3, -3), textcoords="offset points", fontsize=8)
            if not np.isfinite(value):
                axis.annotate("fails", (right, at), (-3, -3), textcoords="offset points", fontsize=8, ha="right")
    axis.axvline(1e-2, color="0.4", lw=0.8, ls="--", label="1 %, noticeable")
    axis.set_xscale("log")
    axis.set_xlim(left, right)
    names = [f"{'without' if row['included'] else 'with'} {row['name']}" for row in rows]
    names = [n if row["kind"] == "effect" else row["name"] for n, row in zip(names, rows, strict=True)]
    axis.set_yticks(range(len(rows)), names)
    axis.invert_yaxis()
    axis.set_xlabel("relative change of the output (–)")
    figure.suptitle(f"{result.summary['name']}: what each effect and other theories change", fontsize=10)
    axis.grid(True, axis="x", lw=0.4, alpha=0.6)
    figure.legend(fontsize=8, loc="outside lower center", ncols=4, frameon=False)
    return figure
