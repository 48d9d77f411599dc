"""What the demos share: their command line, one line of output and one kind of figure."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from mpi4py import MPI

History = Mapping[str, np.ndarray]

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
