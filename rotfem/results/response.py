"""What a frequency response returns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rotfem.results.files import json_text, rows_text
from rotfem.results.frames import Variable, dataset, frame_of_rows
from rotfem.results.result import Result
from rotfem.results.tables import ShortTable, by_unit, named, number
from rotfem.results.units import ShownUnits

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure

Array = npt.NDArray[np.float64]


@dataclass(repr=False)
class ResponseResult(Result):
    """Outcome of `rotfem response`.

    Attributes:
        summary: scene, speed, outputs, modes, peaks, warnings, timings; JSON-able.
        rows: one dictionary a frequency: `frequency` (rad/s), `frequency_hz`, `per_rev` (frequency over speed, of what
            spins); of every output, as `tip_u2`, `root_m3` or, at a station, `M@2.5`, the amplitude `tip_u2` (in its
            unit), `tip_u2_phase` (rad, how far it is ahead of a load of phase 0) and `tip_u2_modal`, the amplitude by
            modes; `difference` of the two responses, relative to the direct one, at the tip, and `worst_difference` of
            all outputs; `peak` (1 at frequencies that were added to see a peak).
        direct: complex amplitudes of the outputs, shape (frequencies, outputs).
        modal: the same by modes.
    """

    rows: list[dict[str, Any]]
    direct: npt.NDArray[np.complex128]
    modal: npt.NDArray[np.complex128]

    @property
    def outputs(self) -> list[str]:
        """Names of the outputs: of the tip `tip_u1`, …, of the root `root_f1`, …, of stations `M@2.5`, …."""
        return list(self.summary["outputs"])

    @property
    def frequencies(self) -> Array:
        """Frequencies, rad/s, increasing."""
        return np.array([row["frequency"] for row in self.rows])

    def amplitude(self, output: str) -> Array:
        """Return the amplitude of an output over the frequencies, in its unit."""
        return np.asarray(np.abs(self.direct[:, self.outputs.index(output)]), dtype=np.float64)

    def phase(self, output: str) -> Array:
        """Return the phase of an output over the frequencies, rad, from −π to π."""
        return np.asarray(np.angle(self.direct[:, self.outputs.index(output)]), dtype=np.float64)

    def files(self) -> dict[str, str]:
        """Return response.csv and summary.json."""
        return {
            "response.csv": rows_text(ShownUnits.of(self.summary).rows(self.rows)),
            "summary.json": json_text(self.summary),
        }

    def drawings(self) -> dict[str, Callable[[], Figure]]:
        """Return response.png: amplitudes and phases over frequency."""
        from rotfem.results.plots import response_figure

        return {"response.png": partial(response_figure, self)}

    def tables(self) -> list[ShortTable]:
        """Return where every output is largest."""
        units, peaks = ShownUnits.of(self.summary), self.summary["peaks"]
        scales = by_unit({name: peak["amplitude"] for name, peak in peaks.items()})
        rows = [
            (named(name), number(peak["amplitude"], scales[name]), f"{units.frequencies(peak['frequency']):.8g}")
            for name, peak in peaks.items()
        ]
        return [ShortTable(("output", "largest amplitude", f"at ({units.frequency})"), rows)]

    def to_pandas(self) -> pandas.DataFrame:
        """Return one row a frequency, indexed by `frequency` (rad/s), as in response.csv."""
        return frame_of_rows(self.rows, "frequency")

    def to_xarray(self) -> xarray.Dataset:
        """Return the complex responses `direct` and `modal` over `frequency` (rad/s) and `output`."""
        over = ("frequency", "output")
        variables: dict[str, Variable] = {"direct": (over, self.direct), "modal": (over, self.modal)}
        coordinates: dict[str, Variable] = {
            "frequency": (("frequency",), self.frequencies),
            "output": (("output",), np.array(self.outputs, dtype=str)),
        }
        return dataset(variables, coordinates, self._attributes())
