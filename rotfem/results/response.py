"""What a frequency response returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rotfem.results.files import rows_text
from rotfem.results.result import Array, Rows, Variables
from rotfem.results.tables import ShortTable, by_unit, named, number
from rotfem.results.units import ShownUnits


@dataclass(repr=False)
class ResponseResult(Rows):
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

    direct: npt.NDArray[np.complex128]
    modal: npt.NDArray[np.complex128]
    index = ("frequency",)

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

    def texts(self) -> dict[str, str]:
        """Return response.csv."""
        return {"response.csv": rows_text(ShownUnits.of(self.summary).rows(self.rows))}

    def drawn(self) -> dict[str, str]:
        """Return response.png: amplitudes and phases over frequency."""
        return {"response.png": "results.plots:response_figure"}

    def tables(self) -> list[ShortTable]:
        """Return where every output is largest."""
        units, peaks = ShownUnits.of(self.summary), self.summary["peaks"]
        scales = by_unit({name: peak["amplitude"] for name, peak in peaks.items()})
        rows = [
            (named(name), number(peak["amplitude"], scales[name]), f"{units.frequencies(peak['frequency']):.8g}")
            for name, peak in peaks.items()
        ]
        return [ShortTable(("output", "largest amplitude", f"at ({units.frequency})"), rows)]

    def arrays(self) -> tuple[Variables, Variables]:
        """Return the complex responses `direct` and `modal` over `frequency` (rad/s) and `output`."""
        over, outputs = ("frequency", "output"), np.array(self.outputs, dtype=str)
        coordinates: Variables = {"frequency": (over[:1], self.frequencies), "output": (over[1:], outputs)}
        return {"direct": (over, self.direct), "modal": (over, self.modal)}, coordinates
