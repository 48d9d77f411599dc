"""The answer of a row of choices, its numbers, and what is true of the answers of all rows.

They are finite. Of runs: the force of the hub on the root is the rate of momentum less the loads; a scheme that keeps
the energy keeps it; and the motion is the same with all unknowns and without those that nothing moves, with and without
estimates of its error, in one go and resumed from a checkpoint.
"""

from __future__ import annotations

import tempfile
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

import rotfem
from tests.balances import FORCES
from tests.finite import check_finite
from tests.pairs.covering import Row
from tests.pairs.scenes import SPEED, TOLERANCE, Tables, tables_of

Array = npt.NDArray[np.float64]
#: Name ↦ values.
Columns = dict[str, Array]

#: How far states at the end of a step are off balance, where not by Newton's last increment; see test_root_reaction.
DIGITS = {"esdirk4": 1e-3, "tolerance": 1e-3}
#: Loads and roots that have a potential, as far as the frame does not turn gravity about.
CONSERVATIVE = {"motion": ("rest", "constant"), "loads": ("none", "tip", "span"), "damping": ("none",)}


class Stopped(Exception):
    """In the place of a kill."""


def answer(row: Row, folder: Path) -> Any:
    """Return the result of the command of a row.

    Args:
        row: a level of every factor.
        folder: for results and checkpoints.
    """
    tables, command = tables_of(row), row["command"]
    if command == "campbell":
        return rotfem.campbell(tables, [0.0, 0.5 * SPEED, SPEED], orders=1)
    if command == "response":
        return rotfem.response(tables, 1.0, 4.0, number=3)
    if command != "run":
        return getattr(rotfem, command)(tables)
    return run(row, tables, folder)


def run(row: Row, tables: Tables, folder: Path) -> Any:
    """Return the result of a run, by way of a checkpoint if the row has it so."""
    outputs = FORCES if is_balanced(row) else None
    if row["checkpoint"] == "no":
        return rotfem.run(tables, outputs=outputs, folder=fresh(folder) if row["output"] == "fields" else None)
    kept, calls = fresh(folder), count()

    def stop(share: float) -> None:
        if share < 1.0 and next(calls) > 2:
            raise Stopped

    try:
        rotfem.run(tables, outputs=outputs, folder=kept, checkpoint=1, progress=stop)
    except Stopped:
        return rotfem.run(tables, outputs=outputs, folder=kept, resume=True)
    raise AssertionError("the run had ended before it was broken off")


def fresh(folder: Path) -> Path:
    """Return a new folder in another one, the same on all processes."""
    comm = MPI.COMM_WORLD
    return Path(comm.bcast(tempfile.mkdtemp(dir=folder) if comm.rank == 0 else None))


def is_balanced(row: Row) -> bool:
    """Return whether the balance of forces is computed beside a row: of a planar beam, whose form is soon compiled.

    Linear theories have followers at their undeformed places, and balance them to their order only.
    """
    followers = row["loads"] == "follower" and row["theory"] != "reissner"
    return row["structure"] == "planar" and row["frame"] == "rotating" and not followers


def columns_of(result: Any) -> Columns:
    """Return the numbers of a result: its history, stations and shape, or its rows."""
    out: Columns = {}
    for table in ("history", "shape", "resultants"):
        out |= {f"{table}.{name}": np.asarray(values) for name, values in getattr(result, table, {}).items()}
    if getattr(result, "stations", None) is not None:
        out |= {f"stations.{name}": np.asarray(values) for name, values in result.stations.values.items()}
    # Which speeds a diagram inserts may be a matter of round-off: a mode that rests has a vector of nothing else.
    rows = [row for row in getattr(result, "rows", []) if not row.get("refined")]
    for name in rows[0] if rows else ():
        values = [row.get(name) for row in rows]
        if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
            out[f"rows.{name}"] = np.array(values, dtype=float)
    return out


def kind_of(name: str) -> str:
    """Return what the columns have in common whose largest value is the scale of one.

    Lengths and angles of the tip, forces and moments of a structure of 2 m; energies; growth and damping of a mode as
    its frequency is: of what is zero the round-off of the others is left.
    """
    table, _, column = name.partition(".")
    word = column.partition("_")[0]
    if table == "rows":
        return "rows.frequency" if word in ("growth", "damping", "frequency") else f"rows.{word}"
    if table == "history":
        known = {"t": "t", "tip": "tip", "root": "root", "balance": "root", "psi": "psi"}
        return f"history.{known.get(word, 'energy')}"
    return "shape" if table == "shape" else f"{table}.{column.rstrip('0123456789')}"


def check_same(one: Columns, other: Columns, digits: float, what: str, only: tuple[str, ...] = ()) -> None:
    """See that two answers are the same, to some part of the largest value of the columns of a kind.

    Args:
        one: columns by name.
        other: columns by name.
        digits: 0 for the same bits.
        what: what is compared, for the message.
        only: tables of which the columns are compared; all if empty.
    """
    names = [name for name in one if not only or name.partition(".")[0] in only]
    assert names or not only, f"{what}: nothing to compare"
    scales = {"rows.frequency": 1e-2, "rows.growth": 1e-2}  # rad/s, 1/s: rigid bodies have round-off there
    for name in names:
        scales[kind_of(name)] = max(scales.get(kind_of(name), 0.0), float(np.max(np.abs(one[name]), initial=0.0)))
    for name in names:
        assert name in other, f"{what}: {name} is missing"
        assert one[name].shape == other[name].shape, f"{what}: {name} has {other[name].shape}, not {one[name].shape}"
        off = float(np.max(np.abs(one[name] - other[name]), initial=0.0))
        assert off <= digits * scales[kind_of(name)], (
            f"{what}: {name} is off by {off:.3g} of {scales[kind_of(name)]:.3g}"
        )


def check_answer(row: Row, result: Any, folder: Path) -> None:
    """See that what is always true is true of the result of a row."""
    assert result.status == "done"
    columns = columns_of(result)
    summary = {key: value for key, value in result.summary.items() if key not in ("scene", "timings")}
    check_finite({"summary": summary, "result": columns}, row["command"])
    assert result.texts()
    if row["command"] != "run":
        return
    if row["time"] != "accuracy":  # whose rows are between its steps
        check_balance(row, columns)
    check_energy(row, columns)
    plain = tables_of({**row, "output": "plain"})
    if row["checkpoint"] != "no" or (row["output"] == "estimated" and row["time"] != "accuracy"):
        other = columns_of(run({**row, "checkpoint": "no", "output": "plain"}, plain, folder))
        check_same(other, columns, 0.0 if row["checkpoint"] == "no" else 1e-9, "and plain", ("history", "shape"))
    if result.summary.get("left_out") and row["structure"] == "plate":
        plain["model"]["all_unknowns"] = True
        every = columns_of(rotfem.run(plain))
        # The round-off of other unknowns may choose other adaptive steps.
        digits = TOLERANCE if row["time"] == "tolerance" else 1e-6
        check_same(every, {**every, **columns}, digits, "all unknowns and few", ("history",))


def check_balance(row: Row, columns: Columns) -> None:
    """See that the force at the root is the rate of momentum less the loads."""
    scale = max(float(np.max(np.abs(columns.get(f"history.root_{name}", np.zeros(1))))) for name in ("f1", "f2", "f3"))
    newton = 1e-9 * 1e5  # N: the last increment, of the length, times EA
    for name in FORCES:
        if f"history.{name}" not in columns:
            continue
        root, whole = columns[f"history.root_{name[-2:]}"], columns[f"history.{name}"]
        off = float(np.max(np.abs(root - whole)))
        assert off <= DIGITS.get(row["time"], 1e-6) * scale + newton, (
            f"balance of {name[-2:]} is off by {off:.3g} of {scale:.3g}"
        )


def check_energy(row: Row, columns: Columns) -> None:
    """See that a scheme that keeps the energy of a conservative motion does."""
    conservative = all(row[factor] in levels for factor, levels in CONSERVATIVE.items())
    if row["time"] != "energy_conserving" or not conservative or row["root"] not in ("clamped",):
        return
    energy, strain = columns["history.jacobi"], columns["history.strain"]
    drift = float(np.max(np.abs(energy - energy[0])))
    scale = max(float(np.max(np.abs(strain))), float(np.max(np.abs(energy))))
    assert drift <= 1e-8 * scale + 1e-14, f"the energy is off by {drift:.3g} of {scale:.3g}"
