"""What holds of every figure: units on axes, nothing cut off, data inside, legends outside the axes."""

from __future__ import annotations

import re

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

#: Pixels by which boxes of texts may leave the figure: they are those of the font, not of its letters.
TOUCH = 1.0


def check(figure: Figure) -> None:
    """Assert what holds of every figure."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    (width, height), renderer = canvas.get_width_height(), canvas.get_renderer()
    named = [text for axes in figure.axes for text in (axes.title, axes.xaxis.label, axes.yaxis.label, *axes.texts)]
    for text in (text for text in (*figure.texts, *named) if text.get_text().strip()):
        box = Text.get_window_extent(text, renderer)  # that of an annotation would have its arrow too
        inside = min(box.x0, box.y0, width - box.x1, height - box.y1) >= -TOUCH
        assert inside, f"{text.get_text()!r} is cut off"
    for legend in [*figure.legends, *(axes.get_legend() for axes in figure.axes if axes.get_legend())]:
        box = legend.get_window_extent()
        assert not any(box.overlaps(axes.bbox) for axes in figure.axes), "a legend lies over data"
    for axes in figure.axes:
        for name in (axes.get_xlabel(), axes.get_ylabel()):
            assert not name or re.search(r"\([^()]+\)$", name), f"no unit in {name!r}"
        low, high = sorted(axes.get_ylim())
        for line in axes.get_lines():
            if line.get_transform() == axes.transData and axes.get_yscale() == "linear":
                y = np.asarray(line.get_ydata(), dtype=float)
                y, slack = y[np.isfinite(y)], 1e-9 * (high - low)
                assert np.all((y >= low - slack) & (y <= high + slack)), "data lie outside the axes"
