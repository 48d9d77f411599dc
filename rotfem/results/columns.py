"""What the columns of results are and their units: the axis labels of figures, the attributes of labelled arrays."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from rotfem.registry import outputs

Array = npt.NDArray[np.float64]


def figures(history: dict[str, Array]) -> dict[str, float]:
    """Return the figures of merit of a history: extremes of tip and root, with times, final values, Jacobi drift.

    Extremes inside the history are those of the parabola through three neighbouring samples.
    """
    out: dict[str, float] = {}
    t = history["t"]
    if len(t) == 0:
        return out
    for name in [n for n in history if n.startswith(("tip_", "root_"))]:
        out[f"{name}_final"] = history[name][-1]
        if len(t) > 1:
            out[f"{name}_min_time"], out[f"{name}_min"] = extreme(t, history[name], -1)
            out[f"{name}_max_time"], out[f"{name}_max"] = extreme(t, history[name], 1)
    if len(t) > 1:
        scale = max(float(np.max(np.abs(history["kinetic"]))), float(np.max(np.abs(history["strain"]))), 1e-300)
        out["jacobi_change"] = (history["jacobi"][-1] - history["jacobi"][0]) / scale
    return {key: float(value) for key, value in out.items()}


def extreme(t: Array, y: Array, sign: int) -> tuple[float, float]:
    """Return (time, value) of the largest sign·y, by a parabola through the largest sample and its neighbours."""
    i = int(np.argmax(sign * y))
    if i in (0, len(y) - 1):
        return float(t[i]), float(y[i])
    c = np.polyfit(t[i - 1 : i + 2] - t[i], y[i - 1 : i + 2], 2)
    if c[0] * sign >= 0:
        return float(t[i]), float(y[i])
    s = -c[1] / (2 * c[0])
    return float(t[i] + s), float(np.polyval(c, s))


#: Part of the largest number of its unit below which one is shown as 0.
ZERO = 1e-9


def zeros(columns: Mapping[str, Array]) -> list[str]:
    """Return the columns of which every number is shown as 0, `ZERO` of the largest of its unit and below."""
    largest: dict[str, float] = {}
    sizes = {name: float(np.max(np.abs(values), initial=0.0)) for name, values in columns.items()}
    units = {name: described(name)[1] or name for name in columns}
    for name, size in sizes.items():
        largest[units[name]] = max(largest.get(units[name], 0.0), size)
    return [name for name, size in sizes.items() if size <= ZERO * largest[units[name]]]


_SUB = {"1": "₁", "2": "₂", "3": "₃"}

#: Column ↦ what it is, and its unit; "1" of pure numbers.
COLUMNS = {
    "t": ("time t", "s"),
    "x": ("position X", "m"),
    "y": ("position Y", "m"),
    "psi": ("angle ψ", "rad"),
    "psi_dot": ("speed Ω", "rad/s"),
    **{f"u{i}": (f"u{sub}", "m") for i, sub in _SUB.items()},
    "alpha": ("rotation α", "rad"),
    **{f"alpha{i}": (f"rotation α{_SUB[i]}", "rad") for i in "12"},
    **{f"theta{i}": (f"rotation θ{sub}", "rad") for i, sub in _SUB.items()},
    "N": ("axial force N", "N"),
    "Q": ("shear force Q", "N"),
    "M": ("bending moment M", "N·m"),
    "T": ("torsional moment T", "N·m"),
    **{f"Q{i}": (f"shear force Q{_SUB[i]}", "N") for i in "23"},
    **{f"M{i}": (f"bending moment M{_SUB[i]}", "N·m") for i in "23"},
    **{f"gamma{i}": (f"strain Γ{sub}", "1") for i, sub in _SUB.items()},
    "kappa": ("curvature κ", "1/m"),
    **{f"kappa{i}": (f"curvature κ{sub}", "1/m") for i, sub in _SUB.items()},
    **{f"n{ij}": (f"membrane force n{_SUB[ij[0]]}{_SUB[ij[1]]}", "N/m") for ij in ("11", "22", "12")},
    **{f"m{ij}": (f"moment m{_SUB[ij[0]]}{_SUB[ij[1]]}", "N") for ij in ("11", "22", "12")},
    **{f"q{i}": (f"shear force q{_SUB[i]}", "N/m") for i in "12"},
    "von_mises": ("equivalent stress", "Pa"),
    "von_mises_max": ("largest equivalent stress", "Pa"),
    "kinetic": ("kinetic energy", "J"),
    "strain": ("strain energy", "J"),
    "jacobi": ("Jacobi integral", "J"),
    **{f"root_f{i}": (f"force of the hub on the root, f{sub}", "N") for i, sub in _SUB.items()},
    **{f"root_m{i}": (f"moment of the hub about the root, m{sub}", "N·m") for i, sub in _SUB.items()},
    "torque": ("torque on the hub", "N·m"),
    "hub_kinetic": ("kinetic energy of the hub", "J"),
    "angular_momentum": ("angular momentum", "N·m·s"),
    "impulse": ("impulse of the torque", "N·m·s"),
    "work": ("work of the torque", "J"),
    "pitch": ("pitch of the blade", "rad"),
    "speed": ("speed Ω", "rad/s"),
    "frequency": ("frequency in the rotating frame", "rad/s"),
    "frequency_hz": ("frequency in the rotating frame", "Hz"),
    "damping": ("damping ratio", "1"),
    "growth": ("growth", "1/s"),
    "residual": ("backward error", "1"),
    "mesh_error": ("relative error that the mesh may cause", "1"),
    "error_bound": ("relative error that round-off may cause", "1"),
    "confidence": ("squared correlation with the speed before", "1"),
    "turning": ("wave with the spin (1) or against it (−1)", "1"),
    "frequency_fixed": ("frequency in the fixed frame", "rad/s"),
    "estimate": ("estimated relative change", "1"),
    "truth": ("relative change of the full models", "1"),
    "worst": ("largest estimated relative change", "1"),
    "step": ("time step", "s"),
    "error": ("error of the discretisation, relative", "1"),
    "model_error": ("error of the theory, relative", "1"),
    "total_error": ("error, that of the theory included, relative", "1"),
    "uncertainty": ("uncertainty of the reference, relative", "1"),
    "time": ("time of one run without set-up, median", "s"),
    "time_min": ("shortest time of one run", "s"),
    "time_max": ("longest time of one run", "s"),
    "cpu_time": ("processor time of one run, median", "s"),
    "setup": ("time of the set-up, median", "s"),
}


def described(column: str) -> tuple[str, str]:
    """Return what a column is and its unit; its name and "" of one that nothing is known of.

    A registered output functional has the unit it was registered with.
    """
    name, at, place = column.partition("@")
    if at:  # a place along a beam, as M@2.5 is of 2.5 m
        what, unit = described(name)
        return f"{what} at {place} m", unit
    if column in COLUMNS:
        return COLUMNS[column]
    if column.startswith("tip_"):
        what, unit = described(column.removeprefix("tip_"))
        return f"tip {what}", unit
    if column.startswith("shape_"):
        what, unit = described(column.removeprefix("shape_"))
        return f"shape, {what}{' × length' if unit == 'rad' else ''}", "1"
    if column.startswith("share_"):
        return f"share of the kinetic energy, {column.removeprefix('share_')}", "1"
    if column in outputs:
        return column, outputs[column].unit
    return column, ""


def label(column: str, shown: str = "") -> str:
    """Return the axis label of a column, with its unit, or with the one that it is shown in."""
    return f"{described(column)[0]} {shown_unit(column, shown)}".rstrip()


def label_of(name: str) -> str:
    """Return a number of a summary, as frequency_last_1, in words with the unit of the column that it begins with."""
    words = name.split("_")
    known = ("_".join(words[:n]) for n in range(len(words), 0, -1))
    unit = next(filter(None, map(shown_unit, known)), "")
    what = described(name)[0]
    return f"{what if what != name else ' '.join(words).replace('.', ', ')} {unit}".rstrip()


def shown_unit(column: str, shown: str = "") -> str:
    """Return the unit of a column, or the one that it is shown in, as "(m)"; "" of one without."""
    unit = shown or described(column)[1]
    return f"({'–' if unit == '1' else unit})" if unit else ""
