"""What all results share: a summary, files, figures, tables and labelled arrays."""

from __future__ import annotations

import base64
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from html import escape
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from rotfem.errors import OutputError, SceneError, printable
from rotfem.listeners import ONE_PROCESS
from rotfem.registry import resolved
from rotfem.results.columns import Columns, ShortTable, ShownUnits, Variables, dataset
from rotfem.results.files import write_whole
from rotfem.results.result_set import RUNNING, ResultFolder, Writer

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure

Array = npt.NDArray[np.float64]
Row = dict[str, Any]


@dataclass(repr=False)
class Result(ABC):
    """Outcome of a computation.

    Attributes:
        summary: what was computed and how it went; JSON-able.
    """

    summary: dict[str, Any]

    #: What draws the figure of a result that has one, "module:function" below rotfem.
    figure: ClassVar[str] = ""

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
            parts.append(f'<img src="{data_url(self.plot(), 72)}" style="max-width: 100%">')
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

    @property
    def frame(self) -> str:
        """Frame of components and frequencies: "rotating" with the hub, or "fixed", that of a round shaft."""
        return "fixed" if self.summary.get("frame") == "fixed" else "rotating"

    @property
    @abstractmethod
    def table(self) -> Columns:
        """Main table: what pandas and, with more of some results, xarray have."""

    def data(self) -> dict[str, Columns]:
        """Return name of a CSV file, without its ending ↦ its columns."""
        return {self.summary["command"]: self.table}

    def column(self, name: str) -> Array:
        """Return the numbers of a column of the main table, such as `frequency`: of every row, or over its grid."""
        table = self.table
        if name not in (numbers := table.numbers):
            raise KeyError(f"no number {name!r} in the table; there are {', '.join(numbers)}")
        return np.asarray(table.grid(name)[1], dtype=np.float64)

    def texts(self) -> dict[str, str]:
        """Return file name ↦ text of the tables."""
        return {f"{name}.csv": columns.csv() for name, columns in self.data().items()}

    def large(self) -> list[Callable[[Path], object]]:
        """Return what writes files that are not text into a folder, each one whole or none; none here."""
        return []

    def drawings(self) -> dict[str, Callable[..., Figure]]:
        """Return file name ↦ what draws that figure, the main one first; empty where there is nothing to draw."""
        return {name: partial(resolved(f"rotfem.{function}"), self) for name, function in self.drawn().items()}

    def drawn(self) -> dict[str, str]:
        """Return file name ↦ "module:function", below rotfem, of the figures there are."""
        return {f"{self.figure.partition(':')[2].removesuffix('_figure')}.png": self.figure}

    @abstractmethod
    def tables(self) -> list[ShortTable]:
        """Return short tables of what matters most, as commands print them and notebooks show them."""

    def to_pandas(self) -> pandas.DataFrame:
        """Return the main table, labelled by what its rows are of."""
        return self.table.to_pandas()

    def arrays(self) -> Variables:
        """Return the labelled arrays, name ↦ dimensions and values: the columns of the main table."""
        return self.table.variables()

    def to_xarray(self) -> xarray.Dataset:
        """Return the result as labelled arrays (see `arrays`) with `units` and `long_name` among their attributes.

        The attribute `frame` of the whole says along whose axes components are.
        """
        names = ("command", "name", "theory", "kind", "status")
        known = {name: self.summary[name] for name in names if name in self.summary}
        return dataset(self.arrays(), known | {"frame": self.frame})

    def write(self, folder: str | Path) -> list[Path]:
        """Write the files into a folder, in the place of the results that are there; return their paths."""
        with ResultFolder(ONE_PROCESS, Path(folder), self.summary.get("command", "")) as results:
            return [*results.publish(self.texts()), results.summarise(self.summary)]

    def write_into(
        self, results: ResultFolder, plots: bool = False, further: Sequence[Writer] = (), again: bool = False
    ) -> list[OutputError | SceneError]:
        """Write tables, then large files and figures, the summary last; return what went wrong with these.

        Of a result whose tables are there already (`again`) it writes what else is wanted, and the summary.
        """
        if not again:
            results.publish(self.texts())
            results.summary = {**self.summary, "status": RUNNING}
            writers = [*self.large(), *further, *([self.draw] if plots else [])]
            problems = [results.attempt(write) for write in writers]
            if (fields := getattr(self, "fields", None)) is not None:
                problems.append(results.attempt(fields, self.summary.get("shared") == "mesh"))
            lost = [f"not written: {problem}" for problem in problems if isinstance(problem, OutputError)]
            self.summary["warnings"] = [*self.summary["warnings"], *lost]
        else:
            problems = [results.attempt(write) for write in further]
        results.summarise(self.summary)
        return [problem for problem in problems if problem is not None]

    def draw(self, folder: Path) -> list[Path]:
        """Write all figures into a folder; return their paths."""
        return [save(draw(), folder / name) for name, draw in self.drawings().items()]

    def plot(self, path: str | Path | None = None, drawing: str = "", **options: Any) -> Figure:
        """Return a figure, a Matplotlib one of its own that pyplot does not know of. A notebook shows it.

        Args:
            path: file that it is written to.
            drawing: which of them, the main one by default.
            options: of a Campbell diagram `ax`, axes to draw on, whose figure is then returned, and `orders`, the k of
                the lines kΩ drawn in the place of those of the diagram; marked are the crossings that it has.
        """
        drawings = {name.removesuffix(".png"): draw for name, draw in self.drawings().items()}
        name = drawing.removesuffix(".png") or next(iter(drawings), "")
        if name not in drawings:
            there = ", ".join(drawings) or "none, as too little was computed"
            raise ValueError(f"drawing {drawing!r} is not among those of this result; there is {there}")
        figure = drawings[name](**options)
        vars(figure)["_repr_png_"] = partial(image, figure, 72)  # Matplotlib has none without a magic of the notebook
        if path is not None:
            save(figure, Path(path))
        return figure


@dataclass(repr=False)
class Rows(Result):
    """A result that is a table of rows.

    Attributes:
        rows: name ↦ value of each row; what a row does not have is absent.
    """

    rows: list[Row]

    #: Names that label the rows, and what these are called where there are none.
    index: ClassVar[tuple[str, ...]] = ()
    dimension: ClassVar[str] = "row"

    def flat_rows(self) -> list[Row]:
        """Return the rows as a table has them, with one value a name, in the units shown too, and with their frame."""
        frame = {"frame": self.frame} if "frame" in self.summary else {}
        return [row | frame for row in ShownUnits.of(self.summary).rows(self.rows)]

    @property
    def table(self) -> Columns:
        """The rows as columns, labelled by `index`."""
        return Columns.of_rows(self.flat_rows(), self.index, self.dimension)

    def arrays(self) -> Variables:
        """Return the labelled arrays, name ↦ dimensions and values; the frame is an attribute of all of them."""
        return {name: array for name, array in super().arrays().items() if name != "frame"}


class OfTable:
    """Attribute of a result that holds a column of its main table.

    Args:
        name: of the column.
        doc: what it is, its shape and unit.
    """

    def __init__(self, name: str, doc: str):
        self.name, self.__doc__ = name, doc

    def __get__(self, result: Result | None, of: type[Result]) -> Array:
        return self if result is None else result.column(self.name)  # type: ignore[return-value]


def image(figure: Figure, dpi: int, format: str = "png") -> bytes:
    """Return a figure as an image of so many dots per inch."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    file = BytesIO()
    if format != "png":
        figure.savefig(file, format=format, dpi=dpi)
        return file.getvalue()
    before, figure.dpi = figure.dpi, dpi
    try:
        FigureCanvasAgg(figure).print_png(file)  # `savefig` would draw all twice
    finally:
        figure.dpi = before
    return file.getvalue()


def data_url(figure: Figure, dpi: int) -> str:
    """Return a figure as a PNG image inside a page."""
    return f"data:image/png;base64,{base64.b64encode(image(figure, dpi)).decode()}"


def save(figure: Figure, path: Path) -> Path:
    """Write a figure whole or not at all, in the format of the file's ending, PNG if it has none; return the path."""
    return write_whole(path, image(figure, 100, path.suffix[1:] or "png"))
