"""A table that is on disk while it grows: a CSV file of whole lines at all times."""

from __future__ import annotations

import os
from pathlib import Path
from time import monotonic

from rotfem.results.files import csv_text, line, write_text
from rotfem.results.run import Table

#: Seconds from one time that rows are written to the next.
INTERVAL = 1.0


class LiveTable:
    """CSV file of a table that grows: what is new is written once a second, by one call of the system.

    A disk that is full is no end: lines that fit are there, and the others are tried again the next time.

    Args:
        path: the file; one that is there is replaced.
        table: the table, with the rows it starts with.

    Attributes:
        rows: how many rows are on disk.

    Raises:
        OutputError: the file cannot be written.
    """

    def __init__(self, path: Path, table: Table):
        self.path, self.table, self.rows = path, table, len(table)
        self._size = len(write_text(path, csv_text(table.arrays())).read_bytes())
        self._written, self._busy = monotonic(), False

    def update(self) -> None:
        """Write the rows that are new, if `INTERVAL` has passed since that was done."""
        if monotonic() - self._written >= INTERVAL:
            self.flush()

    def flush(self) -> bool:
        """Write the rows that are new; return whether all are on disk. May be called by a signal at any time."""
        if self._busy:
            return False
        self._busy = True
        try:
            return self._append()
        finally:
            self._busy = False

    def _append(self) -> bool:
        self._written = monotonic()
        data = "".join(map(line, self.table.rows(self.rows))).encode()
        if not data:
            return True
        try:
            descriptor = os.open(self.path, os.O_WRONLY | os.O_NOFOLLOW)
            try:
                whole = data[: os.pwrite(descriptor, data, self._size)].rfind(b"\n") + 1
                os.ftruncate(descriptor, self._size + whole)  # no line is left torn
            finally:
                os.close(descriptor)
        except OSError:
            return False
        self._size, self.rows = self._size + whole, self.rows + data.count(b"\n", 0, whole)
        return whole == len(data)
