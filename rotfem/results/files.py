"""How results are written and read: each file whole or not at all."""

from __future__ import annotations

import csv
import io
import json
import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from pydantic_core import to_jsonable_python

from rotfem.errors import OutputError

if TYPE_CHECKING:
    import xarray

Array = npt.NDArray[np.float64]

#: How the names of hidden files begin that are not whole yet; what a killed process leaves of them may be removed.
PART = ".rotfem-"


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn an OSError into an OutputError that names the file or folder that is written."""
    try:
        yield
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(path, error.strerror or str(error).partition("\n")[0]) from None


def unwritable(path: Path, inputs: Iterable[Path] = ()) -> str:
    """Return why a file cannot be written there, or is one of the inputs; nothing where it can. Nothing is changed."""
    if os.path.realpath(path) in map(os.path.realpath, inputs):
        return "is what has been read; must be another file"
    if path.is_dir():
        return "is a folder; must be the path of a file"
    if not path.parent.is_dir():
        return f"there is no folder {path.parent}; must be in one that is there"
    try:
        with tempfile.TemporaryFile(dir=path.parent):
            return ""
    except OSError as error:
        return f"nothing can be written in {path.parent}: {error.strerror or error}"


def csv_text(columns: Mapping[str, npt.ArrayLike | Sequence[Any]]) -> str:
    """Return columns as CSV with a header; numbers keep all their digits, what is absent (None) stays empty."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(columns)
    plain = (values.tolist() if isinstance(values, np.ndarray) else values for values in columns.values())
    writer.writerows(zip(*plain, strict=True))
    return buffer.getvalue()


def read_csv(path: str | Path) -> dict[str, Array]:
    """Return the columns of a CSV file that `csv_text` made; a last line that was cut short is not read."""
    with open(path, encoding="utf-8", newline="") as file:
        rows = list(csv.reader(line for line in file if line.endswith("\n")))
    values = np.array(rows[1:], dtype=np.float64).reshape(len(rows) - 1, len(rows[0]))
    return {name: values[:, i].copy() for i, name in enumerate(rows[0])}


class Table:
    """Columns of equal length that grow by rows; their names are in the order they are written.

    Attributes:
        columns: names.
        rows: numbers, so far.
    """

    def __init__(self, columns: Iterable[str]):
        self.columns, self.rows = tuple(columns), list[tuple[float, ...]]()
        self._path: Path | None = None
        self._written, self._when = 0, 0.0

    def append(self, row: Iterable[float]) -> None:
        """Add one row in the order of the columns."""
        self.rows.append(tuple(map(float, row)))

    def arrays(self) -> dict[str, Array]:
        """Return name ↦ array of all values so far."""
        values = np.array(self.rows, dtype=np.float64).reshape(len(self.rows), len(self.columns))
        return {name: values[:, i].copy() for i, name in enumerate(self.columns)}

    def keep(self, path: Path) -> None:
        """Write the table as a CSV file, to which `flush` adds rows."""
        write_text(path, csv_text(self.arrays()))
        self._path, self._written, self._when = path, len(self.rows), monotonic()

    def flush(self, seconds: float = 0.0) -> None:
        """Add the new rows to the file, if there is one and so much time has passed since that was done.

        Where the disk is full nothing is added any more: all is written again at the end.
        """
        if self._path is None or monotonic() - self._when < seconds:
            return
        text = "".join(",".join(map(repr, row)) + "\n" for row in self.rows[self._written :])
        try:
            with open(self._path, "ab", buffering=0) as file:
                file.write(text.encode())
        except OSError:
            self._path = None
        self._written, self._when = len(self.rows), monotonic()


def json_text(data: Any) -> str:
    """Return data as JSON; numbers that JSON cannot hold (NaN, infinity) become null."""
    plain = to_jsonable_python(data, inf_nan_mode="null", fallback=lambda value: value.tolist())
    return json.dumps(plain, indent=2, allow_nan=False) + "\n"


def write_text(path: Path, text: str) -> Path:
    """Write a text file, in UTF-8, whole or not at all; return its path."""
    return write_whole(path, text.encode())


def write_whole(path: Path, content: bytes | memoryview) -> Path:
    """Write a file whole or not at all (temporary file in the same folder, then renamed); return its path."""
    with writing(path):
        descriptor, name = tempfile.mkstemp(dir=path.parent, prefix=f"{PART}{path.name}-", suffix=".part")
        try:
            with os.fdopen(descriptor, "wb") as file:
                file.write(content)
            os.umask(mask := os.umask(0))
            os.chmod(name, 0o666 & ~mask)
            os.replace(name, path)
        except BaseException:
            os.unlink(name)
            raise
    return path


def write_netcdf(path: Path, data: xarray.Dataset) -> Path:
    """Write labelled arrays, real ones, as NetCDF; return the path."""
    with writing(path):
        data.to_netcdf(path, engine="scipy")
    return path


@contextmanager
def whole_hdf5(path: Path) -> Iterator[Any]:
    """Yield an HDF5 file (`h5py.File`) to be filled, which is written whole or not at all.

    It is made in memory: HDF5 cannot close a file that there is no room for, and Python crashes where it ends.
    """
    import h5py  # takes longer than all other imports of this package

    image = io.BytesIO()
    with h5py.File(image, "w") as file:
        yield file
    with image.getbuffer() as content:
        write_whole(path, content)
