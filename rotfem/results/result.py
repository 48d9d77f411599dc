"""What all results share: a summary, files, figures, tables and labelled arrays."""

from __future__ import annotations

import base64
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from html import escape
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from rotfem.errors import printable
from rotfem.results.tables import ShortTable

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure


@dataclass(repr=False)
class Result(ABC):
    """Outcome of a computation.

    Attributes:
        summary: what was computed and how it went; JSON-able.
    """

    summary: dict[str, Any]

    def with_summary(self, **entries: Any) -> Self:
        """Return this result with further entries of its summary, or others in the place of those it has."""
        return replace(self, summary={**self.summary, **entries})

    def __repr__(self) -> str:
        more = f", {n} warning{'s' * (n > 1)}" if (n := len(self.warnings)) else ""
        return f"<{type(self).__name__} {self.title[:200]!r}, {self.status}{more}>"

    def _repr_html_(self) -> str:
        """Return title, warnings, short tables and the main figure, as notebooks show a result."""
        parts = [f"<b>{escape(self.title)}</b>", *(f"<br>warning: {escape(line)}" for line in self.warnings)]
        parts += [table.html() for table in self.tables()]
        if self.drawings():
            image = base64.b64encode(png(self.plot())).decode()
            parts.append(f'<img src="data:image/png;base64,{image}" style="max-width: 100%">')
        return "\n".join(parts)

    @property
    def status(self) -> str:
        """Word for how it ended: "done", or "failed" or "interrupted", with what was computed until then."""
        return str(self.summary["status"])

    @property
    def warnings(self) -> list[str]:
        """What to know before the numbers are used."""
        return list(self.summary.get("warnings", ()))

    @property
    def title(self) -> str:
        """Heading of figures: name of the scene, theory where there is one, and status unless it is done."""
        words = printable(": ".join(self.summary[key] for key in ("name", "theory") if key in self.summary))
        return words if self.status == "done" else f"{words} ({self.status})"

    @abstractmethod
    def files(self) -> dict[str, str]:
        """Return file name ↦ text, in the order they are written."""

    def large(self) -> list[Callable[[Path], object]]:
        """Return what writes files that are not text into a folder, each one whole or none; none here."""
        return []

    @abstractmethod
    def drawings(self) -> dict[str, Callable[[], Figure]]:
        """Return file name ↦ what draws that figure, the main one first; empty where there is nothing to draw."""

    @abstractmethod
    def tables(self) -> list[ShortTable]:
        """Return short tables of what matters most, as commands print them and notebooks show them."""

    @abstractmethod
    def to_pandas(self) -> pandas.DataFrame:
        """Return the result as a table.

        Raises:
            ImportError: pandas is not installed.
        """

    @abstractmethod
    def to_xarray(self) -> xarray.Dataset:
        """Return the result as labelled arrays with `units` and `long_name` among their attributes.

        Raises:
            ImportError: xarray is not installed.
        """

    def write(self, folder: str | Path) -> list[Path]:
        """Write the files into a folder, in the place of the results that are there; return their paths.

        Raises:
            OutputError: the folder cannot be written, or another process writes its results there.
        """
        from rotfem.results.result_set import ResultSet

        with ResultSet(Path(folder), self.summary.get("command", "")) as results:
            return results.publish(self)

    def plot(self, path: str | Path | None = None, drawing: str = "") -> Figure:
        """Return a figure, a Matplotlib one of its own that pyplot does not know of. A notebook shows it.

        Args:
            path: file to write it to as well, in the format of its ending (png, pdf, svg, …).
            drawing: which of `drawings`, with or without its ending; the main one if empty.

        Raises:
            ValueError: there is no such drawing, or the format is not one of Matplotlib's.
            OutputError: the file cannot be written.
        """
        from rotfem.results.plots import save

        drawings = {name.removesuffix(".png"): draw for name, draw in self.drawings().items()}
        name = drawing.removesuffix(".png") or next(iter(drawings), "")
        if name not in drawings:
            there = ", ".join(drawings) or "none, as too little was computed"
            raise ValueError(f"drawing {drawing!r} is not among those of this result; there is {there}")
        figure = drawings[name]()
        vars(figure)["_repr_png_"] = partial(png, figure)  # Matplotlib has none without a magic of the notebook
        if path is not None:
            save(figure, Path(path))
        return figure

    def _attributes(self) -> dict[str, Any]:
        """Return what labelled arrays say of themselves as a whole."""
        names = ("command", "name", "theory", "frame", "kind", "status")
        return {name: self.summary[name] for name in names if name in self.summary}


def png(figure: Figure) -> bytes:
    """Return a figure as PNG of a size that suits a notebook."""
    file = BytesIO()
    figure.savefig(file, format="png", dpi=72)
    return file.getvalue()
