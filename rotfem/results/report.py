"""One HTML file of a result that needs nothing else: summary, figures, modes that move, tables, scene.

Figures and tables are those of `Result.drawings` and `Result.tables`. A figure is a vector graphic, which stays sharp
where it is enlarged.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import tomli_w

from rotfem.results.columns import ShortTable, ShownUnits, per_cent
from rotfem.results.files import json_text, write_text
from rotfem.results.modes import ModesResult
from rotfem.results.result import Result, data_url

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Rows of a table, at most.
MOST = 2000

#: Largest displacement of a mode that moves, part of the length.
AMPLITUDE = 0.15

#: What a summary says first ↦ what it is called.
FACTS = {
    "theory": "theory",
    "about": "modes about the state",
    "frame": "frame",
    "effects": "effects",
    "type": "structure",
    "length": "length (m)",
    "mass": "mass (kg)",
    "elements": "elements",
    "dofs": "unknowns",
    "steps": "time steps",
    "speeds_solved": "speeds solved",
    "frequencies": "frequencies",
    "output": "output",
    "accuracy": "accuracy wanted",
    "truth": "theory of the reference",
    "settings": "settings measured",
    "ranks": "processes",
}

#: Contribution to an error ↦ what it means.
MEANING = {
    "time": "finite time steps; a shorter time.step or a smaller time.tolerance lessens it",
    "space": "finite elements; more mesh.elements or a higher mesh.degree lessen it",
    "model": "the theory, compared with the exact strains; a richer model.theory lessens it",
    "round_off": "arithmetic with 16 digits; no setting lessens it",
    "total": "all of them together",
}


def write_report(result: Result, drawing: Figure | None, folder: Path) -> Path:
    """Write report.html of a result, with a drawing of the scene's structure, into a folder; return its path.

    Raises:
        OutputError: it cannot be written.
    """
    summary, drawn = result.summary, [draw() for draw in result.drawings().values()]
    name, command, status = (escape(str(summary[key])) for key in ("name", "command", "status"))
    figures = "".join(f"<h3>{escape(title_of(figure))}</h3>{picture(figure)}" for figure in drawn)
    hint = '<p class="hint">A double click enlarges a figure, a second one shows all of it; dragging moves it.</p>'
    moving, cards = animated(result)
    tables = [f'<div class="scroll">{table.html(MOST)}</div>' for table in result.tables() if table.rows]
    sections = [
        f'<header><h1>{name}</h1><p>rotfem {command}</p><span class="status {status}">{status}</span></header>',
        section("Summary", facts(summary) + messages(summary)),
        section("Figures", figures and hint + figures),
        section("Modes in motion", cards),
        section("Tables", "".join(tables)),
        section("How exact it is", error_table(summary)),
        section("Scene", scene(summary, drawing)),
        section("Made with", facts_list(summary["versions"]) + folded("summary.json", json_text(dict(summary)))),
    ]
    content = {
        "title": f"{name}: rotfem {command}",
        "content": "\n".join(sections),
        "modes": json.dumps(moving, separators=(",", ":")),
    }
    text = Path(__file__).with_suffix(".html").read_text(encoding="utf-8")
    for key, value in content.items():
        before, _, after = text.partition(f"@{key}@")
        text = before + value + after
    return write_text(folder / "report.html", text)


# --- words and tables -------------------------------------------------------------------------------------------------


def section(title: str, content: str) -> str:
    """Return a section; nothing where it has no content."""
    return f"<section><h2>{title}</h2>\n{content}</section>" if content else ""


def facts(summary: Mapping[str, Any]) -> str:
    """Return what was computed and how."""
    units, found = ShownUnits.of(summary), dict[str, Any]()
    if isinstance(summary.get("speed"), float):
        found[f"speed ({units.speed})"] = float(units.speeds(summary["speed"]))
    found |= {said: summary[key] for key, said in FACTS.items() if summary.get(key) not in (None, [])}
    if (total := summary.get("error", {}).get("total")) is not None:
        found["error, estimated"] = f"{100 * total:.2g} %"
    found["computing time (s)"] = summary.get("timings", {}).get("total")
    return facts_list(found)


def facts_list(found: Mapping[str, Any]) -> str:
    """Return names and values."""
    return "<dl>" + "".join(f"<div><dt>{k}</dt><dd>{shown(v)}</dd></div>" for k, v in found.items()) + "</dl>"


def messages(summary: Mapping[str, Any]) -> str:
    """Return what failed, warnings and advice."""
    out = []
    if failure := summary.get("failure"):
        when = "" if failure.get("time") is None else f" at t = {failure['time']:.6g} s"
        out.append(f'<p class="note failed">{escape(failure["what"])}{when}. {escape(failure.get("advice") or "")}</p>')
    said = [*summary.get("warnings", ()), *summary.get("advice", ())]
    return "".join([*out, *(f'<p class="note">{escape(str(text))}</p>' for text in said)])


def shown(value: Any) -> str:
    """Return a value as it is read."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return ", ".join(map(shown, value))
    return escape(str(value))


def error_table(summary: Mapping[str, Any]) -> str:
    """Return the contributions to the error and what they mean; nothing where no error was estimated."""
    error = summary.get("error", {})
    rows = [
        (name.replace("_", "-"), per_cent(error[name]), meaning) for name, meaning in MEANING.items() if name in error
    ]
    scale = f"<p>Relative to {error['scale']:.6g} m, the largest displacement.</p>" if error.get("scale") else ""
    return ShortTable(("contribution", "error (%)", "what it is"), rows).html() + scale if rows else ""


def scene(summary: Mapping[str, Any], drawing: Figure | None) -> str:
    """Return the drawing and the tables of the scene, those of defaults too."""
    image = "" if drawing is None else picture(drawing)
    if "scene" not in summary:
        return image
    return image + folded("all keys of the scene", tomli_w.dumps(summary["scene"]))


def folded(title: str, text: str) -> str:
    """Return a text that is folded away under its title."""
    return f"<details><summary>{title}</summary><pre>{escape(text)}</pre></details>"


# --- figures ----------------------------------------------------------------------------------------------------------


def title_of(figure: Figure) -> str:
    """Return what a figure shows, in one line."""
    text = figure.get_suptitle() or (figure.axes[0].get_title() if len(figure.axes) == 1 else "")
    return str(text).replace("\n", "; ")


def picture(figure: Figure) -> str:
    """Return a figure as an image in the page."""
    image = f'<img alt="{escape(title_of(figure))}" src="{data_url(figure, 110, "svg")}" draggable="false">'
    return f'<figure class="picture">{image}</figure>'


# --- modes ------------------------------------------------------------------------------------------------------------


def animated(result: Result) -> tuple[dict[str, Any], str]:
    """Return nodes, lines between them and shapes of modes as the page draws them, and a card for each mode."""
    if not isinstance(result, ModesResult) or not result.shapes:
        return {"flat": True}, ""
    first = next(iter(result.shapes.values()))
    n, length = len(first["x"]), float(result.summary["shapes"]["length"])
    nodes = np.stack([first["x"], first.get("y", np.zeros(n)), np.zeros(n)], axis=-1)
    flat = result.triangles is None and "u3" not in first
    lines = np.stack([np.arange(n - 1), np.arange(1, n)], axis=-1)
    if result.triangles is not None:
        pairs = np.concatenate([result.triangles[:, [i, j]] for i, j in ((0, 1), (1, 2), (2, 0))])
        lines = np.unique(np.sort(pairs, axis=1), axis=0)
    moves, cards = [], ""
    for row, columns, frequency in result.with_shapes()[: max(1, 10_000 // n)]:  # of 60 000 numbers
        u = np.stack([columns.get(f"u{i}", np.zeros(n)) for i in (1, 2, 3)], axis=-1)
        v = np.stack([columns.get(f"u{i}_imag", np.zeros(n)) for i in (1, 2, 3)], axis=-1)
        scale = AMPLITUDE * length / max(float(np.max(np.hypot(u, v))), 1e-300)
        moves.append([np.round(scale * part, 5).tolist() for part in (u, v)])
        said = f"{row.get('name', row['label'])}, {frequency}"
        cards += f"<figure><canvas></canvas><figcaption>{row['mode']}: {escape(said)}</figcaption></figure>"
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    extent = float(np.linalg.norm(high - low))
    size = [1.05 * extent, (2.6 * AMPLITUDE if flat else 0.62) * extent]
    middle = [float(value) for value in (low + high) / 2]
    data = {"flat": flat, "nodes": np.round(nodes, 5).tolist(), "lines": lines.tolist(), "shapes": moves}
    hint = "" if flat else '<p class="hint">Drag to turn the view.</p>'
    return {**data, "size": size, "middle": middle}, f'{hint}<div class="modes">{cards}</div>'
