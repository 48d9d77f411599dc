"""Modes of a beam in the forms that programs of wind turbines read: polynomials and tables over the span.

ElastoDyn takes the displacement of a mode as Σ c_k ξ^k, k = 2 … 6, ξ = x/L, with Σ c_k = 1, so 1 at the tip (Jonkman &
Buhl, FAST User's Guide, NREL/EL-500-38230, 2005, "blade input file").
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rotfem.errors import InputError

if TYPE_CHECKING:
    from rotfem.results.modes import ModesResult

Array = npt.NDArray[np.float64]

#: Powers of ξ in a mode polynomial.
POWERS = (2, 3, 4, 5, 6)

#: Direction ↦ (displacement, rotation that is its slope and the sign of it) of a spatial and of a planar beam.
DIRECTIONS: dict[str, tuple[tuple[str, str, float], ...]] = {
    "flap": (("u3", "theta2", -1.0),),
    "lag": (("u2", "theta3", 1.0), ("u2", "alpha", 1.0)),
}

#: Part of a mode's largest displacement below which its tip does not move: there is no polynomial that is 1 there.
NODE = 1e-3

#: What ElastoDyn calls the modes it takes: (direction, number among them) ↦ name.
ELASTODYN = {("flap", 1): "BldFl1Sh", ("flap", 2): "BldFl2Sh", ("lag", 1): "BldEdgSh"}


def mode_table(result: ModesResult) -> list[dict[str, Any]]:
    """Return one row a mode and node: displacement and slope in flap and lag, and twist, over the span.

    Columns are `mode`, `label`, `frequency_hz`, `span` (x/L), `flap_displacement`, `flap_slope`, `lag_displacement`,
    `lag_slope`, `twist`, as far as the beam has them; the phase is that at which the largest displacement is real, and
    the largest of all displacements is 1 (m; slopes 1/m, twist rad/m).

    Raises:
        InputError: the structure is no beam.
    """
    out = []
    for row, columns in _beam_modes(result):
        x = columns["x"]
        values: dict[str, Array] = {"span": x / x[-1]}
        for direction in DIRECTIONS:
            found = _of(columns, direction)
            if found is not None:
                values |= {f"{direction}_displacement": found[0], f"{direction}_slope": found[1]}
        if "theta1" in columns:
            values["twist"] = columns["theta1"] / x[-1]
        named = {name: row[name] for name in ("mode", "label", "frequency_hz")}
        out += [named | {name: float(column[i]) for name, column in values.items()} for i in range(len(x))]
    return out


def mode_polynomials(result: ModesResult) -> list[dict[str, Any]]:
    """Return one row a bending mode: the polynomial of its leading displacement, and how well it fits.

    Columns are `mode`, `label`, `direction` ("flap" or "lag"), `number` among those of the direction, `frequency_hz`,
    `c2` … `c6`, and `fit_error` and `fit_rms`, the largest and the root mean square of what the polynomial is off at
    the nodes, in parts of the displacement of the tip. Modes that leave the tip where it is have none.

    Raises:
        InputError: the structure is no beam.
    """
    out: list[dict[str, Any]] = []
    for row, columns in _beam_modes(result):
        found = {name: _of(columns, name) for name in DIRECTIONS}
        sizes = {name: float(np.max(np.abs(pair[0]))) for name, pair in found.items() if pair is not None}
        direction = max(sizes, key=lambda name: sizes[name])
        pair = found[direction]
        assert pair is not None
        shape = pair[0]
        if sizes[direction] < 0.5 or abs(shape[-1]) < NODE * sizes[direction]:
            continue  # torsion and stretch, and shapes with a node at the tip
        coefficients, off = fit(columns["x"] / columns["x"][-1], shape / shape[-1])
        number = 1 + sum(other["direction"] == direction for other in out)
        named = {"mode": row["mode"], "label": row["label"], "direction": direction, "number": number}
        terms = {f"c{k}": float(c) for k, c in zip(POWERS, coefficients, strict=True)}
        errors = {"fit_error": float(np.max(np.abs(off))), "fit_rms": float(np.sqrt(np.mean(off**2)))}
        out.append(named | {"frequency_hz": row["frequency_hz"]} | terms | errors)
    return out


def fit(span: Array, shape: Array) -> tuple[Array, Array]:
    """Return c₂ … c₆ of the polynomial that is 1 at ξ = 1 and closest to a shape, and what it is off, (n,).

    Args:
        span: ξ of the nodes, (n,).
        shape: displacement there, 1 at the tip, (n,).
    """
    powers = span[:, None] ** np.array(POWERS)
    # With c₂ = 1 − c₃ − … − c₆ the sum is 1 whatever the others are.
    others, *_ = np.linalg.lstsq(powers[:, 1:] - powers[:, :1], shape - powers[:, 0], rcond=None)
    coefficients = np.append(1.0 - others.sum(), others)
    return coefficients, powers @ coefficients - shape


def elastodyn_lines(rows: Sequence[dict[str, Any]]) -> str:
    """Return the mode shape lines of an ElastoDyn blade file, of those of the modes it takes that are there."""
    lines = []
    for row in sorted(rows, key=lambda row: list(DIRECTIONS).index(row["direction"])):
        name = ELASTODYN.get((row["direction"], row["number"]))
        if name is None:
            continue
        of = f"{'Flap' if row['direction'] == 'flap' else 'Edge'} mode {row['number']}"
        lines += [f"{row[f'c{k}']:18.10f}   {name}({k}) - {of}, coeff of x^{k}" for k in POWERS]
    return "\n".join(lines) + "\n"


def _beam_modes(result: ModesResult) -> list[tuple[dict[str, Any], dict[str, Array]]]:
    """Return row and real columns of every mode that has a shape."""
    if result.triangles is not None:
        raise InputError("structure.type", "plate", "tables over the span are those of beams")
    rows = result.rows[len(result.rows) - len(result.shapes) :]
    return [(row, _real(columns)) for row, columns in zip(rows, result.shapes.values(), strict=True)]


def _real(columns: dict[str, Array]) -> dict[str, Array]:
    """Return the columns of a mode at the phase at which its largest displacement is real, and 1 there."""
    names = [name for name in columns if name != "x" and not name.endswith("_imag")]
    values = {name: columns[name] + 1j * columns[f"{name}_imag"] for name in names}
    moves = np.concatenate([values[name] for name in names if name.startswith("u")])
    largest = moves[np.argmax(np.abs(moves))]
    unit = largest if largest != 0.0 else 1.0
    return {"x": columns["x"]} | {name: np.real(value / unit) for name, value in values.items()}


def _of(columns: dict[str, Array], direction: str) -> tuple[Array, Array] | None:
    """Return displacement and slope (1/m) in a direction; None where the beam has none.

    The rotations of a shape are multiplied by the length of the beam.
    """
    for displacement, rotation, sign in DIRECTIONS[direction]:
        if displacement in columns and rotation in columns:
            return columns[displacement], sign * columns[rotation] / columns["x"][-1]
    return None
