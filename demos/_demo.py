"""What the demos share: their command line, one line of output and one kind of figure."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpi4py import MPI

import rotfem

History = Mapping[str, np.ndarray]

THEORIES = ("linear", "consistent_linear", "von_karman_linear", "second_order", "von_karman", "reissner")

FIRST_RANK = MPI.COMM_WORLD.rank == 0


def command_line(main: Callable[[Path | None], float]) -> None:
    """Call main(path of the figure, or None) as the command line says."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--figure", type=Path, metavar="PATH", help="save a figure there (.png, .pdf, .svg)")
    main(parser.parse_args().figure)


def say(text: str) -> None:
    """Print on one of the processes only."""
    if FIRST_RANK:
        print(text)


def report(what: str, value: float, reference: float, unit: str) -> None:
    """Print a computed number, what it should be, and the difference."""
    say(f"{what}: {value:.9g} {unit}, reference {reference:.9g} {unit}, difference {value - reference:+.1e} {unit}")


def in_every_theory(scene: rotfem.Scene, column: str) -> tuple[dict[str, History], dict[str, float]]:
    """Return theory ↦ history and, where it does not diverge, the least value (m) of a column; print the latter."""
    histories: dict[str, History] = {}
    peaks = {}
    for theory in THEORIES:
        try:
            # Their errors are seen against the richest theory and the reference, so that none has to be estimated.
            result = rotfem.run(scene.replace({"model.theory": theory, "output.error": False}))
        except rotfem.ComputationError as error:
            say(f"{theory:18s} diverged at t = {error.time:.2f} s")
            result = error.result
        else:
            peaks[theory] = float(result.summary["figures"][f"{column}_min"])
        histories[theory] = result.history
    for theory, peak in peaks.items():
        off = 100 * (peak / peaks["reissner"] - 1)
        say(f"{theory:18s} min {column.removeprefix('tip_')} at the tip {peak:.6f} m, {off:+.3f} % of reissner")
    return histories, peaks


def ladder(
    histories: Mapping[str, History], column: str, inset: tuple[float, float, float, float]
) -> tuple[Figure, Axes]:
    """Return a figure of a column over time in all theories, with the differences at the peak enlarged in an inset.

    Args:
        histories: theory ↦ history; the last one, which the others are compared with, is drawn in black.
        column: what is drawn, m.
        inset: where the inset is, in parts of the axes: left, bottom, width, height.
    """
    figure = Figure(figsize=(9, 4.5), layout="constrained")
    axis = figure.subplots()
    peak = axis.inset_axes(inset, xlim=(6.2, 7.4), ylim=(-0.5775, -0.563))
    styles = {"linear": "-", "consistent_linear": "-", "von_karman_linear": ":"}
    for panel in (axis, peak):
        for theory, h in histories.items():
            panel.plot(h["t"], h[column], styles.get(theory, "--"), lw=1.6, label=theory)
        panel.lines[-1].set(color="black", lw=1.0, ls="-")
    axis.indicate_inset_zoom(peak, edgecolor="grey")
    peak.tick_params(labelsize="x-small")
    axis.grid(True, lw=0.4, alpha=0.6)
    return figure, axis


def plot_tip(histories: Mapping[str, History], path: Path | None, title: str) -> None:
    """Draw the tip's u₂ and u₁ over time, one curve a history (two at most), if there is a path to save it to."""
    if path is None or not FIRST_RANK:
        return
    figure = Figure(figsize=(8, 5.5), layout="constrained")
    above, below = figure.subplots(2, sharex=True)
    for style, (name, h) in zip(("-", "--"), histories.items(), strict=False):
        above.plot(h["t"], h["tip_u2"], style, lw=1.4, label=name)
        below.plot(h["t"], h["tip_u1"], style, lw=1.4)
    above.set(title=title, ylabel="tip deflection u₂ (m)")
    above.legend(fontsize="small")
    below.set(xlabel="time t (s)", ylabel="tip displacement u₁ (m)")
    for axis in (above, below):
        axis.grid(True, lw=0.4, alpha=0.6)
    save(figure, path)


def save(figure: Figure, path: Path) -> None:
    """Save a figure, making its folder where there is none."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    say(f"figure in {path}")
