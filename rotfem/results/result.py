"""What all results share: a summary, files, figures, tables and labelled arrays."""

from __future__ import annotations

import base64
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from html import escape
from importlib import import_module
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from rotfem.errors import printable
from rotfem.registry import resolved
from rotfem.results.columns import ShortTable, described
from rotfem.results.files import json_text, rows_text, write_whole

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure

Array = npt.NDArray[np.float64]
Row = dict[str, Any]

#: Name of a labelled array ↦ its dimensions and values.
Variables = dict[str, tuple[tuple[str, ...], npt.NDArray[Any]]]


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

    def files(self) -> dict[str, str]:
        """Return file name ↦ text, in the order they are written: tables, then summary.json."""
        return {**self.texts(), "summary.json": json_text(self.summary)}

    @abstractmethod
    def texts(self) -> dict[str, str]:
        """Return file name ↦ text of the tables."""

    def large(self) -> list[Callable[[Path], object]]:
        """Return what writes files that are not text into a folder, each one whole or none; none here."""
        return []

    def drawings(self) -> dict[str, Callable[[], Figure]]:
        """Return file name ↦ what draws that figure, the main one first; empty where there is nothing to draw."""
        return {name: partial(resolved(f"rotfem.{function}"), self) for name, function in self.drawn().items()}

    def drawn(self) -> dict[str, str]:
        """Return file name ↦ "module:function", below rotfem, of the figures there are."""
        return {f"{self.figure.partition(':')[2].removesuffix('_figure')}.png": self.figure}

    @abstractmethod
    def tables(self) -> list[ShortTable]:
        """Return short tables of what matters most, as commands print them and notebooks show them."""

    @abstractmethod
    def to_pandas(self) -> pandas.DataFrame:
        """Return the result as a table.

        Raises:
            ImportError: pandas is not installed.
        """

    def to_xarray(self) -> xarray.Dataset:
        """Return the result (see `arrays`) as labelled arrays with `units` and `long_name` among their attributes.

        Raises:
            ImportError: xarray is not installed.
        """
        names = ("command", "name", "theory", "frame", "kind", "status")
        return dataset(*self.arrays(), {name: self.summary[name] for name in names if name in self.summary})

    @abstractmethod
    def arrays(self) -> tuple[Variables, Variables]:
        """Return variables and coordinates of the labelled arrays."""

    def write(self, folder: str | Path) -> list[Path]:
        """Write the files into a folder, in the place of the results that are there; return their paths.

        Raises:
            OutputError: the folder cannot be written, or is neither empty nor one of rotfem's.
        """
        from rotfem.listeners import ONE_PROCESS
        from rotfem.results.result_set import ResultFolder

        with ResultFolder(ONE_PROCESS, Path(folder), self.summary.get("command", "")) as results:
            return results.publish(self)

    def draw(self, folder: Path) -> list[Path]:
        """Write all figures into a folder; return their paths.

        Raises:
            OutputError: one cannot be written.
        """
        return [save(draw(), folder / name) for name, draw in self.drawings().items()]

    def plot(self, path: str | Path | None = None, drawing: str = "") -> Figure:
        """Return a figure, a Matplotlib one of its own that pyplot does not know of. A notebook shows it.

        Args:
            path: file to write it to as well, in the format of its ending (png, pdf, svg, …).
            drawing: which of `drawings`, with or without its ending; the main one if empty.

        Raises:
            ValueError: there is no such drawing, or the format is not one of Matplotlib's.
            OutputError: the file cannot be written.
        """
        drawings = {name.removesuffix(".png"): draw for name, draw in self.drawings().items()}
        name = drawing.removesuffix(".png") or next(iter(drawings), "")
        if name not in drawings:
            there = ", ".join(drawings) or "none, as too little was computed"
            raise ValueError(f"drawing {drawing!r} is not among those of this result; there is {there}")
        figure = drawings[name]()
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

    #: Names that label the rows, and the dimension that the labelled arrays have of them.
    index: ClassVar[tuple[str, ...]] = ()
    dimension: ClassVar[str] = "row"

    def column(self, name: str) -> Array:
        """Return a number of every row, such as `frequency`, shape (rows,).

        Raises:
            KeyError: there is none of that name.
        """
        there = [key for key, value in (self.rows[0] if self.rows else {}).items() if not isinstance(value, str)]
        if name not in there:
            raise KeyError(f"no number {name!r} of the rows; there are {', '.join(there)}")
        return np.array([row[name] for row in self.rows], dtype=np.float64)

    def flat_rows(self) -> list[Row]:
        """Return the rows as a table has them, with one value a name."""
        return self.rows

    def texts(self) -> dict[str, str]:
        """Return the rows as a CSV file that is called after the command."""
        return {f"{self.summary['command']}.csv": rows_text(self.flat_rows())}

    def arrays(self) -> tuple[Variables, Variables]:
        """Return the columns over `dimension`, the number of the row from 0 on."""
        rows = self.flat_rows()
        names = dict.fromkeys(name for row in rows for name in row)
        return {name: ((self.dimension,), column_of_rows(rows, name)) for name in names}, {}

    def to_pandas(self) -> pandas.DataFrame:
        """Return the rows as a table, labelled by `index`; what a row does not have is NaN.

        Raises:
            ImportError: pandas is not installed.
        """
        table = optional("pandas").DataFrame(self.flat_rows())
        return table.set_index(list(self.index)) if self.index and not table.empty else table


def image(figure: Figure, dpi: int, format: str = "png") -> bytes:
    """Return a figure as an image of so many dots per inch.

    Raises:
        ValueError: Matplotlib does not write that format.
    """
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
    """Write a figure whole or not at all, in the format of the file's ending, PNG if it has none; return the path.

    Raises:
        ValueError: Matplotlib does not write that format.
        OutputError: it cannot be written.
    """
    return write_whole(path, image(figure, 100, path.suffix[1:] or "png"))


# --- pandas and xarray, which nothing else needs ----------------------------------------------------------------------


def optional(name: str) -> Any:
    """Return a package that rotfem can do without."""
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        missing = error.name or name
        raise ImportError(f"to_{name}() needs {missing}, which is not installed: pip install {missing}") from error


def frame(columns: Mapping[str, Any], *index: str) -> pandas.DataFrame:
    """Return named columns as a table indexed by one or several of them."""
    return optional("pandas").DataFrame(dict(columns)).set_index(list(index))


def dataset(variables: Variables, coordinates: Variables, attributes: Mapping[str, Any]) -> xarray.Dataset:
    """Return variables over coordinates, each with its `long_name` and `units` as far as they are known."""
    out = optional("xarray").Dataset(variables, coordinates, dict(attributes))
    for name, array in out.variables.items():
        what, unit = described(name)
        array.attrs |= {"long_name": what, "units": unit} if unit else {}
    return out


def column_of_rows(rows: Sequence[Mapping[str, Any]], name: str) -> npt.NDArray[Any]:
    """Return the values of one name over rows: truth values, text, or numbers; "" or NaN stand for what is absent."""
    values = [row.get(name) for row in rows]
    there = [value for value in values if value is not None]
    if there and all(isinstance(value, bool | np.bool_) for value in values):
        return np.array(values, dtype=bool)
    if any(isinstance(value, str) for value in there):
        return np.array(["" if value is None else str(value) for value in values], dtype=str)
    if all(isinstance(value, int) for value in values):
        return np.array(values, dtype=np.int64)
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


def nodes_of(columns: Mapping[str, npt.NDArray[Any]], triangles: Any) -> Variables:
    """Return where the nodes of columns are and, of a plate, the triangles between them."""
    out: Variables = {name: (("node",), columns[name]) for name in ("x", "y") if name in columns}
    return out if triangles is None else {**out, "triangles": (("triangle", "corner"), np.asarray(triangles))}
