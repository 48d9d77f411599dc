"""What holds of every figure: no text over another or cut off, units on axes, data inside, legends outside the axes."""

from __future__ import annotations

import re
from itertools import combinations
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

#: Pixels by which boxes of texts may touch: they are those of the font, not of its letters.
TOUCH = 1.0


def drawn_texts(figure: Figure) -> list[tuple[str, Any]]:
    """Return (text, box in pixels) of everything written in a figure; of ticks those within the limits."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    ticks = [tick for axes in figure.axes for axis in (axes.xaxis, axes.yaxis) for tick in axis.get_major_ticks()]
    every = [tick for axes in figure.axes for axis in (axes.xaxis, axes.yaxis) for tick in axis.get_minor_ticks()]
    of_ticks = {id(text) for tick in (*ticks, *every) for text in (tick.label1, tick.label2)}
    found = [text for text in figure.findobj(Text) if id(text) not in of_ticks and text.get_visible()]
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            shown = [tick for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
            found += [tick.label1 for tick in shown if tick.label1.get_visible()]
    renderer = canvas.get_renderer()
    # that of an annotation would have its arrow too
    return [(text.get_text(), Text.get_window_extent(text, renderer)) for text in found if text.get_text().strip()]


def check(figure: Figure) -> None:
    """Assert what holds of every figure."""
    boxes = drawn_texts(figure)
    for text, box in boxes:
        inside = box.x0 >= -TOUCH and box.y0 >= -TOUCH
        inside &= box.x1 <= figure.bbox.x1 + TOUCH and box.y1 <= figure.bbox.y1 + TOUCH
        assert inside, f"{text!r} is cut off"
    for (one, a), (other, b) in combinations(boxes, 2):
        width, height = min(a.x1, b.x1) - max(a.x0, b.x0), min(a.y1, b.y1) - max(a.y0, b.y0)
        assert min(width, height) <= TOUCH, f"{one!r} lies over {other!r}"
    legends = [*figure.legends, *(axes.get_legend() for axes in figure.axes if axes.get_legend())]
    for legend in legends:
        box = legend.get_window_extent()
        assert not any(box.overlaps(axes.bbox) for axes in figure.axes), "a legend lies over data"
    for axes in figure.axes:
        for name in (axes.get_xlabel(), axes.get_ylabel()):
            assert not name or re.search(r"\([^()]+\)$", name), f"no unit in {name!r}"
        for axis in (axes.xaxis, axes.yaxis):
            numbers = any(tick.label1.get_visible() and tick.label1.get_text() for tick in axis.get_major_ticks())
            words = any(re.search("[a-z]", tick.label1.get_text()) for tick in axis.get_major_ticks())
            assert axis.label.get_text() or words or not numbers, "numbers without what they are"
        within(axes)


def within(axes: Axes) -> None:
    """Assert that the limits of an axis with a linear scale hold all points of its lines."""
    (left, right), (low, high) = sorted(axes.get_xlim()), sorted(axes.get_ylim())
    for line in axes.get_lines():
        if line.get_transform() != axes.transData or axes.get_yscale() != "linear":
            continue  # those of a whole axis
        x, y = (np.asarray(values, dtype=float) for values in line.get_data())
        there = np.isfinite(x) & np.isfinite(y)
        slack = 1e-9 * (high - low)
        assert np.all((x[there] >= left) & (x[there] <= right))
        assert np.all((y[there] >= low - slack) & (y[there] <= high + slack))
