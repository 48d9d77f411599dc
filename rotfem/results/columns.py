"""What the columns of results are and their units: the axis labels of figures, the attributes of labelled arrays."""

from __future__ import annotations

from rotfem.registry import outputs

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


def is_at_station(column: str) -> bool:
    """Return whether a column is of a place along a beam, as M@2.5 is of 2.5 m."""
    return "@" in column


def described(column: str) -> tuple[str, str]:
    """Return what a column is and its unit; its name and "" of one that nothing is known of.

    A registered output functional has the unit it was registered with.
    """
    if is_at_station(column):
        name, _, place = column.partition("@")
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
    what, unit = described(column)
    unit = shown or unit
    return f"{what} ({'–' if unit == '1' else unit})" if unit else what
