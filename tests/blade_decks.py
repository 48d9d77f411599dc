"""One small blade as the files of other programs have it: 20 m, two stations, all centres beside the line.

What it is: at the root and the tip, about centres (y to the leading edge, z downwind, m), principal axes turned by
ANGLE against the section axes of the line.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

LENGTH, TWIST = 20.0, (12.0, -1.5)  # m; degrees, positive turns the leading edge upwind
ANGLE = (4.0, -7.0)  # degrees, of the principal axes, right-handed about the axis to the tip
STATIONS: list[dict[str, Any]] = [
    {
        **{"EA": 4e9, "GA2": 8e8, "GA3": 5e8, "GJ": 9e7, "EI2": 3e8, "EI3": 9e8},
        **{"m": 300.0, "J2": 20.0, "J3": 70.0, "cg": (-0.10, 0.02), "ec": (0.05, 0.01), "sc": (0.12, -0.03)},
    },
    {
        **{"EA": 5e8, "GA2": 1e8, "GA3": 6e7, "GJ": 2e6, "EI2": 4e6, "EI3": 3e7},
        **{"m": 40.0, "J2": 0.3, "J3": 2.5, "cg": (-0.03, 0.01), "ec": (0.02, 0.0), "sc": (0.04, -0.01)},
    },
]


def iec_matrices(station: dict[str, Any], angle: float) -> tuple[Array, Array]:
    """Return stiffness and mass about the line in IEC axes x, y, z (y to the trailing edge), order of BeamDyn.

    Sums of forces and momenta at each centre, as they are for x, y, z: not the program's formulas, nor its axes.
    """
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    edge, flap = np.array([s, -c, 0.0]), np.array([c, s, 0.0])  # principal axes 2 and 3: to the leading edge, downwind
    along = np.array([0.0, 0.0, 1.0])

    def motion_at(point: tuple[float, float], direction: Array) -> Array:
        """Return the row that gives a strain in a direction at (y, z) of our axes: Γ·d + (K×p)·d."""
        p = np.array([point[1], -point[0], 0.0])
        return np.concatenate([direction, np.cross(p, direction)])

    def turn(direction: Array) -> Array:
        return np.concatenate([np.zeros(3), direction])

    K = np.zeros((6, 6))
    for stiffness, row in (
        (station["EA"], motion_at(station["ec"], along)),
        (station["GA2"], motion_at(station["sc"], edge)),
        (station["GA3"], motion_at(station["sc"], flap)),
        (station["GJ"], turn(along)),
        (station["EI2"], turn(edge)),
        (station["EI3"], turn(flap)),
    ):
        K += stiffness * np.outer(row, row)
    M = np.zeros((6, 6))
    for direction in np.eye(3):
        row = motion_at(station["cg"], direction)
        M += station["m"] * np.outer(row, row)
    for inertia, direction in ((station["J2"], edge), (station["J3"], flap), (station["J2"] + station["J3"], along)):
        M += inertia * np.outer(turn(direction), turn(direction))
    return K, M


def _rows(matrix: Array) -> str:
    return "\n".join("  ".join(f"{value: .16e}" for value in row) for row in matrix)


def beamdyn_blade() -> str:
    """Return BeamDyn's blade file."""
    blocks = []
    for eta, station, angle in zip((0.0, 1.0), STATIONS, ANGLE, strict=True):
        K, M = iec_matrices(station, angle)
        blocks.append(f" {eta:.6f}\n{_rows(K)}\n\n{_rows(M)}\n")
    return "\n".join(
        [
            " ------- BEAMDYN V1.00.* INDIVIDUAL BLADE INPUT FILE --------------------------",
            " a small blade",
            " ---------------------- BLADE PARAMETERS --------------------------------------",
            "2   station_total    - Number of blade input stations (-)",
            " 1   damp_type        - Damping type: 0: no damping; 1: damped",
            "  ---------------------- DAMPING COEFFICIENT------------------------------------",
            "   mu1        mu2        mu3        mu4        mu5        mu6",
            "   (-)        (-)        (-)        (-)        (-)        (-)",
            "0.001 0.001 0.001 0.001 0.001 0.001",
            " ---------------------- DISTRIBUTED PROPERTIES---------------------------------",
            *blocks,
        ]
    )


def elastodyn() -> str:
    """Return ElastoDyn's blade file: no centres in it."""
    rows = "\n".join(
        f"{x:.6f} 0.25 {twist:.4f} {station['m']:.6e} {station['EI2']:.6e} {station['EI3']:.6e}"
        for x, twist, station in zip((0.0, 1.0), TWIST, STATIONS, strict=True)
    )
    return f"""------- ELASTODYN V1.00.* INDIVIDUAL BLADE INPUT FILE --------------------------
a small blade
---------------------- BLADE PARAMETERS ----------------------------------------
          2   NBlInpSt    - Number of blade input stations (-)
   0.5   BldFlDmp(1) - Blade flap mode #1 structural damping in percent of critical (%)
---------------------- BLADE ADJUSTMENT FACTORS --------------------------------
          1   FlStTunr(1) - Blade flapwise modal stiffness tuner, 1st mode (-)
    1.04   AdjBlMs     - Factor to adjust blade mass density (-)
     1.1   AdjFlSt     - Factor to adjust blade flap stiffness (-)
     0.9   AdjEdSt     - Factor to adjust blade edge stiffness (-)
---------------------- DISTRIBUTED BLADE PROPERTIES ----------------------------
    BlFract  PitchAxis  StrcTwst  BMassDen  FlpStff  EdgStff
      (-)       (-)       (deg)    (kg/m)    (Nm^2)   (Nm^2)
{rows}
---------------------- BLADE MODE SHAPES ---------------------------------------
     0.1   BldFl1Sh(2) - Flap mode 1, coeff of x^2
"""


def hawc2(full: bool) -> str:
    """Return HAWC2's st file, with full matrices about the elastic centre or with centres."""
    lines = ["1 ; number of sets", "-----", "#1 ; set number", "r and so on", "$1 2"]
    for r, s, angle in zip((0.0, LENGTH), STATIONS, ANGLE, strict=True):
        radii = [np.sqrt(s["J2"] / s["m"]), np.sqrt(s["J3"] / s["m"])]
        if full:
            values = [r, s["m"], *s["cg"], *radii, angle, *s["ec"], *_about_elastic(s, angle)]
        else:
            E, G, A = 1e10, 4e9, s["EA"] / 1e10
            shear = [s["GA2"] / G / A, s["GA3"] / G / A]
            stiff = [E, G, s["EI2"] / E, s["EI3"] / E, s["GJ"] / G, *shear, A]
            values = [r, s["m"], *s["cg"], *radii, *s["sc"], *stiff, angle, *s["ec"]]
        lines.append("  ".join(f"{value:.16e}" for value in values))
    return "\n".join(lines) + "\n"


def _about_elastic(s: dict[str, Any], angle: float) -> Array:
    """Return the upper triangle along principal axes about the elastic centre: shear, axial, bending, torsion."""
    c, t = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    dy, dz = s["sc"][0] - s["ec"][0], s["sc"][1] - s["ec"][1]
    x, y = c * dy + t * dz, c * dz - t * dy  # of the shear centre along principal axes
    K = np.diag([s["GA2"], s["GA3"], s["EA"], s["EI2"], s["EI3"], s["GJ"]])
    K[0, 5] = K[5, 0] = -y * s["GA2"]
    K[1, 5] = K[5, 1] = x * s["GA3"]
    K[5, 5] += y**2 * s["GA2"] + x**2 * s["GA3"]
    return np.asarray(K[np.triu_indices(6)])


def bmodes() -> str:
    """Return BModes' section properties of a blade without what that format cannot say: y offsets only, no angle."""
    rows = []
    for x, twist, s in zip((0.0, 1.0), TWIST, STATIONS, strict=True):
        cg, tc, sc = s["cg"][0], s["ec"][0], s["sc"][0]
        edge = s["EI3"] + s["EA"] * (tc - sc) ** 2
        inertias = [s["J2"], s["J3"] + s["m"] * cg**2]
        values = [x, twist, twist, s["m"], *inertias, s["EI2"], edge, s["GJ"], s["EA"], cg, sc, tc]
        rows.append("  ".join(f"{value:.12e}" for value in values))
    names = (
        "str_tw tw_iner mass_den flp_iner edge_iner flp_stff edge_stff tor_stff axial_stff cg_offst sc_offst tc_offst"
    )
    return "\n".join(["a small blade", "2  n_secs: number of sections", "", f"sec_loc {names}", "(-)", *rows, ""])


def windio() -> str:
    """Return a windIO file of the first version: a straight blade."""
    upper = np.triu_indices(6)
    both = [iec_matrices(s, angle) for s, angle in zip(STATIONS, ANGLE, strict=True)]
    stiffness, mass = (["[" + ", ".join(f"{v:.16e}" for v in pair[i][upper]) + "]" for pair in both] for i in (0, 1))
    twist = ", ".join(f"{np.radians(t):.16e}" for t in TWIST)
    return f"""name: small
components:
  blade:
    outer_shape_bem:
      twist: &twist
        grid: [0.0, 1.0]
        values: [{twist}]
      reference_axis: &axis
        x: {{grid: [0.0, 1.0], values: [0.0, 0.0]}}
        y: {{grid: [0.0, 1.0], values: [0.0, 0.0]}}
        z: {{grid: [0.0, 0.5, 1.0], values: [0.0, {LENGTH / 2}, {LENGTH}]}}
    elastic_properties_mb:
      six_x_six:
        reference_axis: *axis
        twist: *twist
        stiff_matrix:
          grid: [0.0, 1.0]
          values:
            - {stiffness[0]}
            - {stiffness[1]}
        inertia_matrix:
          grid: [0.0, 1.0]
          values:
            - {mass[0]}
            - {mass[1]}
"""


def windio_2() -> str:
    """Return a windIO file of version 2: the same blade, on a hub that is coned upwind."""
    stiffness, mass = [], []
    for s, angle in zip(STATIONS, ANGLE, strict=True):
        K, M = iec_matrices(s, angle)
        stiffness.append(K)
        x, y = M[1, 5] / s["m"], -M[0, 5] / s["m"]
        mass.append([s["m"], x, y, M[3, 3], M[4, 4], M[5, 5], -M[3, 4]])
    rows = [(f"K{i + 1}{j + 1}", [K[i, j] for K in stiffness]) for i, j in zip(*np.triu_indices(6), strict=True)]
    inertias = zip(("mass", "cm_x", "cm_y", "i_edge", "i_flap", "i_plr", "i_cp"), zip(*mass, strict=True), strict=True)

    def lines(named: Any) -> str:
        return "\n".join(f"          {name}: [{', '.join(f'{v:.16e}' for v in values)}]" for name, values in named)

    return f"""windIO_version: '2.0'
assembly:
  rotor_orientation: Upwind
components:
  hub:
    diameter: 3.0
    cone_angle: 4.0
  blade:
    reference_axis:
      x: {{grid: [0.0, 1.0], values: [0.0, 0.0]}}
      y: {{grid: [0.0, 1.0], values: [0.0, 0.0]}}
      z: {{grid: [0.0, 0.5, 1.0], values: [0.0, {LENGTH / 2}, {LENGTH}]}}
    outer_shape:
      twist: {{grid: [0.0, 1.0], values: [{TWIST[0]}, {TWIST[1]}]}}
    structure:
      elastic_properties:
        stiffness_matrix:
          grid: [0.0, 1.0]
{lines(rows)}
        inertia_matrix:
          grid: [0.0, 1.0]
{lines(inertias)}
        # no masses
"""
