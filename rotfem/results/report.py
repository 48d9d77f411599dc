"""One HTML file of a result that needs nothing else: summary, figures that respond, modes that move, tables, scene.

Figures are those of `Result.drawings`: lines become figures of Bokeh (https://docs.bokeh.org), whose script
is in the file; maps, bars and what is drawn in three dimensions stay pictures.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import tomli_w
from matplotlib.colors import to_hex

from rotfem.results.columns import Columns, ShortTable, ShownUnits, label_of, number
from rotfem.results.files import json_text, write_text
from rotfem.results.modes import ModesResult
from rotfem.results.result import Result, Rows, data_url

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = npt.NDArray[np.float64]

#: Points of a line, and rows of a table, at most; numbers of modes that move.
MOST_ROWS, MOST_NUMBERS = 2000, 60_000


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
    scene = "" if drawing is None else f"<figure>{picture(drawing)}</figure>"
    scene += folded("all keys of the scene", tomli_w.dumps(summary["scene"])) if "scene" in summary else ""
    sections = {
        "Summary": facts(summary) + messages(summary),
        "Figures": (hint if live else "") + parts,
        "Modes in motion": cards,
        "Tables": tables(result.tables()),
        "All values": tables([of_columns(result.table)]) if isinstance(result, Rows) else "",
        "Estimated error": tables(errors(summary)),
        "Scene": scene,
        "Made with": listed(summary["versions"]) + folded("summary.json", json_text(dict(summary))),
    }
    head = f'<header><h1>{name}</h1><p>rotfem {command}</p><span class="status {status}">{status}</span></header>\n'
    content = {
        "title": f"{name}: rotfem {command}",
        "library": Resources(mode="inline", components=["bokeh"]).render_js() if live else "",
        "content": head + "\n".join(f"<section><h2>{k}</h2>\n{v}</section>" for k, v in sections.items() if v),
        "modes": json.dumps(moving, separators=(",", ":")),
        "scripts": scripts,
    }
    text = Path(__file__).with_suffix(".html").read_text(encoding="utf-8")
    for key, value in content.items():
        before, _, after = text.partition(f"@{key}@")
        text = before + value + after
    return write_text(folder / "report.html", text)


# --- words and tables -------------------------------------------------------------------------------------------------


def facts(summary: Mapping[str, Any]) -> str:
    """Return what was computed and how: the numbers and words of a summary, and its lists of words."""
    units, found = ShownUnits.of(summary), dict[str, Any]()
    for key in (key for key in summary if key not in ("name", "command", "status")):
        value = summary[key]
        if key == "speed" and isinstance(value, float):
            found[f"speed ({units.speed})"] = float(units.speeds(value))
        elif isinstance(value, str | int | float):
            found[label_of(key)] = value
        elif key in ("effects", "outputs") and value:
            found[key] = ", ".join(value)
    found["computing time (s)"] = summary.get("timings", {}).get("total")
    return listed({key: number(value, 0.0) if isinstance(value, float) else value for key, value in found.items()})


def listed(found: Mapping[str, Any]) -> str:
    """Return names and values; those that there are."""
    there = {key: escape(str(value)) for key, value in found.items() if value is not None}
    return "<dl>" + "".join(f"<div><dt>{key}</dt><dd>{value}</dd></div>" for key, value in there.items()) + "</dl>"


def messages(summary: Mapping[str, Any]) -> str:
    """Return what failed, warnings and advice."""
    out = []
    if failure := summary.get("failure"):
        when = "" if failure.get("time") is None else f" at t = {failure['time']:.6g} s"
        out.append(f'<p class="note failed">{escape(failure["what"])}{when}. {escape(failure.get("advice") or "")}</p>')
    said = [*summary.get("warnings", ()), *summary.get("advice", ())]
    return "".join([*out, *(f'<p class="note">{escape(str(text))}</p>' for text in said)])


def tables(found: Iterable[ShortTable]) -> str:
    """Return tables that a click on a heading sorts."""
    return "".join(f'<div class="scroll">{table.html(MOST_ROWS)}</div>' for table in found if table.rows)


def of_columns(columns: Columns) -> ShortTable:
    """Return all columns as a table."""
    texts = []
    for name in columns.values:
        is_number, values = name in columns.numbers, list[Any](columns.array(name)[:MOST_ROWS])
        texts.append(["–" if is_number and np.isnan(v) else f"{v:.6g}" if is_number else str(v) for v in values])
    return ShortTable(tuple(map(label_of, columns.values)), list(zip(*texts, strict=True)))


def errors(summary: Mapping[str, Any]) -> Iterator[ShortTable]:
    """Yield the contributions to the error, and what other settings cost, as far as these were estimated."""
    parts = {name: value for name, value in summary.get("error", {}).items() if name not in ("scale", "time_at")}
    yield ShortTable(("of", "relative error (–)"), [(name, number(value, 0.0)) for name, value in parts.items()])
    settings = [{k: row.get(k) for k in ("words", "error", "seconds")} for row in summary.get("settings", ())]
    yield of_columns(Columns.of_rows(settings))


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
    """Return a figure as one of Bokeh, its panels moving together; None if it is more than lines."""
    from bokeh.layouts import gridplot
    from bokeh.models import Range1d

    axes = [axis for axis in figure.axes if axis.axison]
    if not axes or any(a.name == "3d" or a.images or a.collections for a in axes):
        return None
    if any(patch.get_data_transform() == a.transData for a in axes for patch in a.patches):  # bars, no ranges
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
        colour, style = to_hex(line.get_color()), str(line.get_linestyle())
        dash = dashes.get(style, "solid")
        if line.get_transform() != axes.transData:  # a line from one side to the other
            across = line.get_transform() == axes.get_yaxis_transform()
            place = float(np.asarray(line.get_ydata() if across else line.get_xdata())[0])
            way = "width" if across else "height"
            plot.add_layout(Span(location=place, dimension=way, line_color=colour, line_dash=dash, line_width=1))
            continue
        said = str(line.get_gid() or line.get_label())
        said = "" if said.startswith("_") else said
        x, y = thinned(np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float))
        drawn = named.setdefault(said, [])
        if style in dashes:
            drawn.append(plot.line(x, y, color=colour, line_dash=dash, line_width=line.get_linewidth(), name=said))
        if str(line.get_marker()) not in ("None", "none", "", " "):
            face = line.get_markerfacecolor()
            fill = None if str(face) == "none" else to_hex(face)
            drawn.append(plot.scatter(x, y, size=line.get_markersize(), color=colour, fill_color=fill, name=said))
    for range_ in axes.patches:
        low, width = range_.get_x(), range_.get_width()
        fill = to_hex(range_.get_facecolor())
        box = BoxAnnotation(left=low, right=low + width, fill_color=fill, fill_alpha=0.3, line_color=None)
        box.level = "underlay"
        plot.add_layout(box)
    items = [LegendItem(label=said, renderers=drawn) for said, drawn in named.items() if said and drawn]
    if items and (len(items) > 1 or len(named) > 1):
        options = {"click_policy": "hide", "label_text_font_size": "9pt", "border_line_color": None}
        plot.add_layout(Legend(items=items, **options), "right")
    plot.grid.grid_line_color = "#e6eaee"
    plot.outline_line_color = "#c3cbd4"
    return plot


def thinned(x: Array, y: Array) -> tuple[Any, Any]:
    """Return a line by `MOST_ROWS` at most: of every stretch its lowest and highest point."""
    if len(x) > MOST_ROWS:
        parts = np.array_split(np.arange(len(x)), MOST_ROWS // 2)
        kept = sorted({int(part[i]) for part in parts for i in (np.argmin(y[part]), np.argmax(y[part]))})
        x, y = x[kept], y[kept]
    return x.astype(np.float32), y.astype(np.float32)


# --- modes ------------------------------------------------------------------------------------------------------------


def animated(result: Result) -> tuple[dict[str, Any], str]:
    """Return points, lines between them and shapes of modes as the page draws them, and a card for each mode."""
    if not isinstance(result, ModesResult) or result.surface is None:
        return {}, ""
    surface = result.surface
    ends = np.concatenate([surface.triangles[:, [i, j]] for i, j in ((0, 1), (1, 2), (2, 0))])
    middle, moves, cards = (surface.points.min(axis=0) + surface.points.max(axis=0)) / 2, [], ""
    for row, shape, frequency in result.with_shapes()[: max(1, MOST_NUMBERS // (6 * len(surface.points)))]:
        z = surface.scale(shape) * surface.moved(shape)
        moves.append([np.round(part, 5).tolist() for part in (z.real, z.imag)])
        said = escape(f"{row['mode']}: {row['label']}, {frequency}")
        cards += f"<figure><canvas></canvas><figcaption>{said}</figcaption></figure>"
    data = {"points": np.round(surface.points, 5).tolist(), "shapes": moves, "extent": surface.size}
    if result.frame == "fixed":  # orbits of one corner of some sections
        data["orbits"] = (4 * np.unique(np.linspace(0, len(surface.points) // 4 - 1, 9).round())).astype(int).tolist()
    data |= {"lines": np.unique(np.sort(ends, axis=1), axis=0).tolist(), "middle": middle.tolist()}
    return data, f'<p class="hint">Drag to turn the view.</p><div class="modes">{cards}</div>'
