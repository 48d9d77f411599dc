"""What a Campbell diagram returns: modes followed over speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rotfem.results.columns import Columns, ShortTable, ShownUnits, number, numbers, shown_unit
from rotfem.results.files import json_text
from rotfem.results.result import Array, OfTable, Rows


@dataclass(frozen=True)
class CriticalSpeed:
    """A speed at which the frequency of a branch is a multiple of it.

    Attributes:
        speed: rad/s.
        kind: "forward" of a rotor's whirl that an unbalance excites; "backward" of whirl against the spin at its speed,
            or a wave of a disk that stands still in the fixed frame; "per_rev" of any other one.
        order: 1 of whirl, nodal diameters of a disk's wave, k of "per_rev".
        branch: number of the branch, from 1 on; 0 of a whirl that is none of the branches.
        per_rev: k, the frequency in the frame of the diagram over the speed; 0 of forward whirl in the rotating one.
        frequency: of the branch there, in the frame of the diagram, kΩ, rad/s.
        label: of the branch.
    """

    speed: float
    kind: str
    order: int
    branch: int
    per_rev: int
    frequency: float
    label: str


@dataclass(frozen=True)
class Instability:
    """A range of speeds in which a mode grows.

    Attributes:
        speed: where it begins, rad/s; the first speed if the sweep begins with it.
        kind: "static instability" or "dynamic instability".
        until: where it ends, rad/s; None if no speed of the sweep ends it.
    """

    speed: float
    kind: str
    until: float | None


@dataclass(repr=False)
class CampbellResult(Rows):
    """Outcome of `rotfem campbell`; `to_pandas()["frequency"].unstack("label")` are the frequencies over speed.

    Attributes:
        summary: scene, branches, critical speeds, instabilities, self-checks, warnings, timings; JSON-able.
        rows: one dictionary a speed and branch: `speed` (rad/s), `branch`, `label`, `mode` (its name at this speed),
            `frequency` (rad/s), `frequency_hz`, `damping`, `growth` (1/s), `residual`, `error_bound`, `mesh_error`,
            `share_…`, `confidence` (MAC with the previous speed), `refined` (1 where the speed was not
            asked for); of a shaft or a disk `turning` (1 for a wave that runs with the spin in the rotor, −1 against
            it, 0 for a standing one), `whirl` ("forward", "backward" or "standing") and `frequency_fixed` (rad/s, in
            the fixed frame). A shaft has `log_decrement` δ = −2π Re λ/|Im λ|, None of what does not vibrate; in the
            rotating frame it has `frequency_fixed_2` of its smaller wave, too: both are |ω ± Ω|.
    """

    index = ("speed", "label")
    frequencies = OfTable(
        "frequency",
        "Frequencies in the `frame`, (speeds, branches), rad/s; NaN where a branch is lost.",
    )
    damping = OfTable("damping", "Damping ratios −Re λ/|λ|, (speeds, branches); NaN where a branch is lost.")
    growth = OfTable("growth", "Growth Re λ, (speeds, branches), 1/s; NaN where a branch is lost.")

    @property
    def labels(self) -> list[str]:
        """Name of every branch, that of its mode at the first speed."""
        return [branch["label"] for branch in self.summary["branches"]]

    @property
    def speeds(self) -> Array:
        """All speeds solved, those asked for and those in between that following the modes took, rad/s."""
        return np.array(list(self._refined()), dtype=np.float64)

    @property
    def refined(self) -> npt.NDArray[np.bool_]:
        """Which of `speeds` were not asked for, shape (speeds,)."""
        return np.array(list(self._refined().values()), dtype=bool)

    @property
    def critical_speeds(self) -> list[CriticalSpeed]:
        """Critical speeds: the synchronous ones of a rotor by increasing speed, then where branches meet kΩ."""
        return [CriticalSpeed(**crossing) for crossing in self.summary["critical_speeds"]]

    @property
    def instabilities(self) -> list[Instability]:
        """Ranges of speed in which a mode grows."""
        return [Instability(**onset) for onset in self.summary["instabilities"]]

    def _refined(self) -> dict[float, bool]:
        return {row["speed"]: bool(row["refined"]) for row in self.rows}

    def branches(self) -> dict[str, dict[str, Array]]:
        """Return label ↦ columns `speed`, `frequency`, `growth`, … over the speeds at which the branch was found."""
        out: dict[str, dict[str, Array]] = {}
        for label in dict.fromkeys(row["label"] for row in self.rows):
            mine = Columns.of_rows([row for row in self.rows if row["label"] == label])
            out[label] = {name: mine.array(name).astype(np.float64) for name in mine.numbers}
        return out

    def data(self) -> dict[str, Columns]:
        """Return the branches, and critical speeds over a key where these are asked for."""
        rows = self.summary.get("map", {}).get("rows")
        return super().data() | ({"critical_map": Columns.of_rows(rows)} if rows else {})

    def texts(self) -> dict[str, str]:
        """Return campbell.csv and campbell.json."""
        keys = ("branches", "critical_speeds", "instabilities", "ambiguous", "per_rev", "orders", "rated", "operating")
        return {
            **super().texts(),
            "campbell.json": json_text(
                {"frame": self.frame, **{k: self.summary[k] for k in keys if k in self.summary}, "rows": self.rows}
            ),
        }

    def drawn(self) -> dict[str, str]:
        """Return campbell.png and, of a rotor in the rotating frame, campbell_fixed.png."""
        both = self.frame != "fixed" and "whirl" in self.rows[0]
        fixed = {"campbell_fixed.png": "results.plots_campbell:fixed_figure"}
        over = {"critical_map.png": "results.plots_campbell:map_figure"}
        more = (fixed if both else {}) | (over if self.summary.get("map", {}).get("rows") else {})
        return {"campbell.png": "results.plots_campbell:campbell_figure", **more}

    def tables(self) -> list[ShortTable]:
        """Return the branches, with frequencies at the first and the last speed, and the critical speeds."""
        units, ends = ShownUnits.of(self.summary), self.speeds[[0, -1]]
        branches = self.summary["branches"]

        def frequencies(name: str) -> list[str]:
            known = [None if b[name] is None else float(units.frequencies(b[name])) for b in branches]
            return ["lost" if x is None else text for x, text in zip(known, numbers(known, 8), strict=True)]

        columns = [
            [str(b["branch"]) for b in branches],
            [b["label"] for b in branches],
            frequencies("frequency_first"),
            frequencies("frequency_last"),
            [f"{b['confidence']:.3f}" for b in branches],
        ]
        first, last = (f"{units.frequency} at {number(float(units.speeds(x)))} {units.speed}" for x in ends)
        head = ("branch", "name", f"{self.frame} frame: {first}", last, "MAC (–)")
        critical = []
        for c in self.critical_speeds:
            excitation = f"{c.per_rev}Ω" if c.kind == "per_rev" else "synchronous"
            critical.append((number(float(units.speeds(c.speed)), digits=8), c.label, excitation))
        out = [ShortTable(head, list(zip(*columns, strict=True)))]
        if critical:
            out.append(ShortTable((f"critical speed ({units.speed})", "mode", "excitation"), critical))
        if over := self.summary.get("map"):
            labels = list(dict.fromkeys(row["label"] for row in over["rows"]))[:4]
            found = {(row["value"], row["label"]): f"{units.speeds(row['speed']):.6g}" for row in over["rows"]}
            heads = [f"{label.removesuffix(' whirl')} ({units.speed})" for label in labels]
            values = dict.fromkeys(row["value"] for row in over["rows"])
            rows = [(f"{value:.4g}", *(found.get((value, label), "–") for label in labels)) for value in values]
            key = over["key"].rpartition(".")[2]
            out.append(ShortTable((f"{key} {shown_unit(key)}".rstrip(), *heads), rows))
        return out
