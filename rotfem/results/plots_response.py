"""Figures of frequency responses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from rotfem.results.columns import described, is_at_station, label
from rotfem.results.units import ShownUnits

if TYPE_CHECKING:
    from rotfem.results.response import ResponseResult

#: Part of the largest output of its unit below which one is round-off.
SHOWN = 1e-9


def response_figure(result: ResponseResult) -> Figure:
    """Return amplitudes, direct and by modes (dashed), and phases over frequency, of tip and root.

    What does not answer is left out.
    """
    units, size = ShownUnits.of(result.summary), np.max(np.abs(result.direct), axis=0)
    kinds = [described(name)[1] for name in result.outputs]
    largest: dict[str, float] = {}
    for kind, value in zip(kinds, size, strict=True):
        largest[kind] = max(largest.get(kind, 0.0), float(value))
    own = [not is_at_station(name) for name in result.outputs]
    drawn = [i for i, kind in enumerate(kinds) if own[i] and size[i] > SHOWN * largest[kind]]
    figure = Figure(figsize=(9, 2.2 * max(len(drawn), 1) + 2.4))
    panels = figure.subplots(len(drawn) + 1, 1, sharex=True, squeeze=False)[:, 0]
    x = units.frequencies(result.frequencies)
    for axis, i in zip(panels, drawn, strict=False):
        name = result.outputs[i]
        axis.semilogy(x, np.abs(result.direct[:, i]), lw=1.4, color=f"C{i}")
        axis.semilogy(x, np.abs(result.modal[:, i]), lw=1.0, ls="--", color="0.3")
        axis.set_ylabel(label(name))
        panels[-1].plot(x, np.degrees(np.angle(result.direct[:, i])), lw=1.2, color=f"C{i}", label=name)
    panels[-1].set_ylabel("phase (°)")
    panels[-1].set_yticks(np.arange(-180, 181, 90))
    panels[-1].set_xlabel(f"frequency of the load ({units.frequency}); amplitudes by modes dashed")
    if drawn:
        panels[-1].legend(fontsize=8, ncols=len(drawn))
    for axis in panels:
        axis.grid(True, lw=0.4, alpha=0.6)
    panels[0].set_title(f"{result.title}, at {units.speeds(result.summary['speed']):g} {units.speed}")
    figure.align_ylabels()
    height = figure.get_figheight()
    figure.subplots_adjust(left=0.12, right=0.97, top=1 - 0.4 / height, bottom=0.55 / height, hspace=0.12)
    return figure
