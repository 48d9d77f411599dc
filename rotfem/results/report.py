"""One HTML file of a result that needs nothing else: summary, figures that respond, modes that move, tables, scene.

Figures are those of `Result.drawings`: lines, bars and ranges become figures of Bokeh (https://docs.bokeh.org), whose
script is in the file; what is drawn in three dimensions stays a picture.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import tomli_w
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.ticker import FixedLocator

from rotfem.results.columns import ZERO, Columns, ShownUnits, label, label_of, largest
from rotfem.results.files import json_text, write_text
from rotfem.results.modes import ModesResult
from rotfem.results.result import Result, data_url

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = npt.NDArray[np.float64]

#: Points of a line, and rows of a table, at most.
MOST_ROWS = 2000

#: Largest displacement of a mode that moves, part of the length.
AMPLITUDE = 0.15

#: What a summary says first, and what is called otherwise there.
FACTS = (
    *("theory", "about", "frame", "effects", "type", "length", "mass", "elements", "dofs", "steps", "speeds_inserted"),
    *("frequencies", "output", "accuracy", "truth", "ranks"),
)
CALLED = {"type": "structure", "length": "length (m)", "mass": "mass (kg)", "dofs": "unknowns", "ranks": "processes"}

#: Figure of merit of a column ↦ its heading.
MERITS = {
    **{"final": "at the end", "min": "smallest", "min_time": "smallest at t (s)"},
    **{"max": "largest", "max_time": "largest at t (s)"},
}


def write_report(result: Result, drawing: Figure | None, folder: Path) -> Path:
    """Write report.html of a result, with a drawing of the scene's structure, into a folder; return its path."""
    from bokeh.embed import components
    from bokeh.resources import Resources

    summary, figures = result.summary, {name: draw() for name, draw in result.drawings().items()}
    name, command, status = (escape(str(summary[key])) for key in ("name", "command", "status"))
    live = {file: found for file, figure in figures.items() if (found := interactive(figure)) is not None}
    scripts, places = components(live) if live else ("", {})
    parts = "".join(
        f"<figure><h3>{escape(_title(figure))}</h3>{places.get(file) or picture(figure)}</figure>"
        for file, figure in figures.items()
    )
    hint = '<p class="hint">Drag to move, zoom with the tools on the right, click a name to hide its line.</p>'
    moving, cards = animated(result)
    sections = [
        f'<header><h1>{name}</h1><p>rotfem {command}</p><span class="status {status}">{status}</span></header>',
        section("Summary", facts(summary) + messages(summary)),
        section("Figures", (hint if live else "") + parts),
        section("Modes in motion", cards),
        section("Tables", "".join(table(*entry) for entry in tables(result))),
        section("Estimated error", error_table(summary)),
        section("Scene", scene(summary, drawing)),
        section("Made with", facts_list(summary["versions"]) + folded("summary.json", json_text(dict(summary)))),
    ]
    content = {
        "title": f"{name}: rotfem {command}",
        "library": Resources(mode="inline", components=["bokeh"]).render_js() if live else "",
        "content": "\n".join(sections),
        "modes": json.dumps(moving, separators=(",", ":")),
        "scripts": scripts,
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
    found |= {CALLED.get(key, label_of(key)): summary[key] for key in FACTS if summary.get(key) not in (None, [])}
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


def tables(result: Result) -> Iterator[tuple[str, list[dict[str, Any]]]]:
    """Yield title and rows of what a summary has in lists, of figures and peaks, and of the settings of a study."""
    summary, merits = result.summary, result.summary.get("figures", {})
    names = [key.removesuffix("_final") for key in merits if key.endswith("_final")]
    found = [{said: merits.get(f"{name}_{key}") for key, said in MERITS.items()} for name in names]
    yield "Largest and last values", [{"quantity": label(n)} | row for n, row in zip(names, found, strict=True)]
    yield "Peaks", [{"output": label(name), **peak} for name, peak in summary.get("peaks", {}).items()]
    for key, value in summary.items():
        if isinstance(value, list) and value and all(isinstance(row, dict) for row in value):
            yield key.replace("_", " ").capitalize(), ShownUnits.of(summary).rows(value)
    if summary["command"] == "cost":
        yield "Settings", list(getattr(result, "rows", ()))


def table(title: str, rows: Sequence[Mapping[str, Any]]) -> str:
    """Return a table that a click on a heading sorts; dictionaries in a row become columns of their own."""
    columns = Columns.of_rows([dict(_flat(row)) for row in rows[:MOST_ROWS]])
    if not columns.values:
        return ""
    scales = dict.fromkeys(("residual", "error_bound", "mesh_error"), 0.0)  # near 0 and not shown as 0
    scales |= {"damping": 1.0, "growth": largest(columns.values.get("frequency", ()))}
    head, body = "", [""] * len(rows[:MOST_ROWS])
    for name, values in columns.values.items():
        is_number = name in columns.numbers
        kind = "" if is_number else ' class="text"'
        head += f"<th{kind}>{escape(label_of(name))}</th>"
        scale = scales.get(name, largest(v for v in values if isinstance(v, float) and np.isfinite(v)))
        for i, value in enumerate(values):
            data = f' data-value="{value!r}"' if is_number and value is not None and np.isfinite(value) else ""
            small = isinstance(value, float) and abs(value) <= ZERO * scale
            body[i] += f"<td{kind}{data}>{shown(0 if small else value)}</td>"
    more = f"<p>the first {MOST_ROWS} of {len(rows)} rows</p>" if len(rows) > MOST_ROWS else ""
    lines = "".join(f"<tr>{cells}</tr>" for cells in body)
    inner = f'<table class="sortable"><thead><tr>{head}</tr></thead><tbody>{lines}</tbody></table>'
    return f'<h3>{escape(title)}</h3><div class="scroll">{inner}</div>{more}'


def _flat(row: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in row.items():
        if key == "row":  # of a table of its own
            continue
        if isinstance(value, Mapping):
            yield from _flat(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


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
    """Return the contributions to the error; nothing where no error was estimated."""
    parts = {name: value for name, value in summary.get("error", {}).items() if name not in ("scale", "time_at")}
    scale = summary.get("error", {}).get("scale")
    return table("", [{"of": name.replace("_", "-"), "relative error": value} for name, value in parts.items()]) + (
        f"<p>Relative to {scale:.6g} m, the largest displacement.</p>" if scale else ""
    )


def scene(summary: Mapping[str, Any], drawing: Figure | None) -> str:
    """Return the drawing and the tables of the scene, those of defaults too."""
    image = "" if drawing is None else f"<figure>{picture(drawing)}</figure>"
    if "scene" not in summary:
        return image
    return image + folded("all keys of the scene", tomli_w.dumps(summary["scene"]))


def folded(title: str, text: str) -> str:
    """Return a text that is folded away under its title."""
    return f"<details><summary>{title}</summary><pre>{escape(text)}</pre></details>"


# --- figures ----------------------------------------------------------------------------------------------------------


def _title(figure: Figure) -> str:
    text = figure.get_suptitle() or (figure.axes[0].get_title() if len(figure.axes) == 1 else "")
    return str(text).replace("\n", "; ")


def picture(figure: Figure) -> str:
    """Return a figure as an image in the page."""
    return f'<img alt="{escape(_title(figure))}" src="{data_url(figure, 110)}">'


def interactive(figure: Figure) -> Any:
    """Return a figure as one of Bokeh, its panels moving together; None if it is more than lines, bars and ranges."""
    from bokeh.layouts import gridplot
    from bokeh.models import Range1d

    axes = [axis for axis in figure.axes if axis.axison]
    if not axes or any(a.name == "3d" or a.images for a in axes):
        return None
    known = (Line2D, Rectangle, PolyCollection)
    if not all(isinstance(artist, known) for a in axes for artist in (*a.lines, *a.patches, *a.collections)):
        return None
    x: dict[tuple[float, float], Any] = {}
    panels = [panel(a, x.setdefault(a.get_xlim(), Range1d(*map(float, a.get_xlim())))) for a in axes]
    options = {"sizing_mode": "stretch_width", "toolbar_location": "right", "toolbar_options": {"logo": None}}
    return gridplot(panels, ncols=1, **options)


def panel(axes: Any, x_range: Any) -> Any:
    """Return one panel as a figure of Bokeh."""
    from bokeh.models import BoxAnnotation, Legend, LegendItem, Range1d, Span
    from bokeh.plotting import figure

    tall = axes.get_position().height * axes.get_figure().get_figheight() * 100.0
    plot = figure(
        height=int(np.clip(tall, 170, 480)),
        x_range=x_range,
        y_range=Range1d(*map(float, axes.get_ylim())),
        x_axis_type=axes.get_xscale(),
        y_axis_type=axes.get_yscale(),
        x_axis_label=axes.get_xlabel() or None,
        y_axis_label=axes.get_ylabel() or None,
        title=axes.get_title(loc="left") or None,
        tools="pan,wheel_zoom,box_zoom,reset,hover",
        tooltips=[("", "$name"), ("x", "$x"), ("y", "$y")],
    )
    dashes = {"-": "solid", "--": "dashed", ":": "dotted", "-.": "dashdot"}
    named: dict[str, list[Any]] = {}
    for line in (line for line in axes.lines if len(line.get_xydata())):
        colour = to_hex(line.get_color())
        dash = dashes.get(str(line.get_linestyle()), "solid")
        if line.get_transform() != axes.transData:  # a line from one side to the other
            across = line.get_transform() == axes.get_yaxis_transform()
            place = float(np.asarray(line.get_ydata() if across else line.get_xdata())[0])
            way = "width" if across else "height"
            plot.add_layout(Span(location=place, dimension=way, line_color=colour, line_dash=dash, line_width=1))
            continue
        said = str(line.get_label())
        said = _text_at(axes, line, colour) if said.startswith("_") else said
        x, y = thinned(np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float))
        drawn = []
        if str(line.get_linestyle()) not in ("None", "none", ""):
            drawn.append(plot.line(x, y, color=colour, line_dash=dash, line_width=line.get_linewidth(), name=said))
        if str(line.get_marker()) not in ("None", "none", "", " "):
            face = line.get_markerfacecolor()
            fill = None if str(face) == "none" else to_hex(face)
            drawn.append(plot.scatter(x, y, size=line.get_markersize(), color=colour, fill_color=fill, name=said))
        named.setdefault(said, []).extend(drawn)
    for bar in axes.patches:
        (left, bottom), width, height = bar.get_xy(), bar.get_width(), bar.get_height()
        said, colour = str(bar.get_label()).removeprefix("_nolegend_"), to_hex(bar.get_facecolor())
        if bar.get_data_transform() != axes.transData:  # a range from one side to the other
            across = bar.get_data_transform() == axes.get_yaxis_transform()
            ends = {"bottom": bottom, "top": bottom + height} if across else {"left": left, "right": left + width}
            plot.add_layout(BoxAnnotation(**ends, fill_color=colour, fill_alpha=0.3, line_color=None, level="underlay"))
            continue
        ends = {"left": left, "right": left + width, "bottom": bottom, "top": bottom + height}
        named.setdefault(said, []).append(plot.quad(**ends, color=colour, name=said))
    for area in axes.collections:
        for path in area.get_paths():
            colour, corners = to_hex(np.asarray(area.get_facecolor())[0].tolist()), np.asarray(path.vertices)
            plot.patch(corners[:, 0], corners[:, 1], color=colour, alpha=0.25, line_width=0)
    items = [LegendItem(label=said, renderers=drawn) for said, drawn in named.items() if said and drawn]
    if items and (len(items) > 1 or len(named) > 1):
        style = {"click_policy": "hide", "label_text_font_size": "9pt", "border_line_color": None}
        plot.add_layout(Legend(items=items, **style), "right")
    if isinstance(axes.yaxis.get_major_locator(), FixedLocator) and (ticks := axes.get_yticks()) is not None:
        plot.yaxis.ticker = [float(tick) for tick in ticks]
        labels = [text.get_text() for text in axes.get_yticklabels()]
        plot.yaxis.major_label_overrides = {float(t): said for t, said in zip(ticks, labels, strict=True) if said}
    plot.grid.grid_line_color = "#e6eaee"
    plot.outline_line_color = "#c3cbd4"
    return plot


def _text_at(axes: Any, line: Line2D, colour: str) -> str:
    """Return the text of a line's colour that stands nearest to its end; nothing where there is none."""
    end = float(np.asarray(line.get_ydata(), dtype=np.float64)[-1])
    there = [text for text in axes.texts if to_hex(text.get_color()) == colour and hasattr(text, "xy")]
    return str(min(there, key=lambda text: abs(float(text.xy[1]) - end)).get_text()) if there else ""


def thinned(x: Array, y: Array) -> tuple[Any, Any]:
    """Return a line by `MOST_ROWS` at most: of every stretch its lowest and highest point."""
    if len(x) > MOST_ROWS:
        parts = np.array_split(np.arange(len(x)), MOST_ROWS // 2)
        kept = sorted({int(part[i]) for part in parts for i in (np.argmin(y[part]), np.argmax(y[part]))})
        x, y = x[kept], y[kept]
    return x.astype(np.float32), y.astype(np.float32)


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
        said = f"{row['label']}, {frequency}"
        cards += f"<figure><canvas></canvas><figcaption>{row['mode']}: {escape(said)}</figcaption></figure>"
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    extent = float(np.linalg.norm(high - low))
    size = [1.05 * extent, (2.6 * AMPLITUDE if flat else 0.62) * extent]
    middle = [float(value) for value in (low + high) / 2]
    data = {"flat": flat, "nodes": np.round(nodes, 5).tolist(), "lines": lines.tolist(), "shapes": moves}
    hint = "" if flat else '<p class="hint">Drag to turn the view.</p>'
    return {**data, "size": size, "middle": middle}, f'{hint}<div class="modes">{cards}</div>'
