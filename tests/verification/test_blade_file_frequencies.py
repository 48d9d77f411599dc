"""A bent, twisted blade with centres beside its line, from files: against beams in the files' own axes, in numpy."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.interpolate import CubicSpline

import rotfem
from tests import blade_decks as decks
from tests import blade_main_decks as mains
from tests.beam_matrices import frequencies

Array = npt.NDArray[np.float64]

#: From the order of BeamDyn, x, y, z, to that of the reference, the tangent first: z, x, y. No sign changes.
ORDER = [2, 0, 1, 5, 3, 4]

#: Stations of the line along the pitch axis (m); between them it is a cubic spline, and the twist linear.
Z = np.linspace(0.0, decks.LENGTH, 9)


def points(sweep: float) -> Array:
    """Return key points x, y, z (m) and twist (degrees): bent upwind, swept to the trailing edge."""
    part = Z / decks.LENGTH
    return np.stack([-1.5 * part**2, sweep * part**3, Z, 12.0 - 13.5 * part], axis=-1)


def of_openfast(keys: Array) -> Array:
    """Return the frequencies at rest (rad/s) of the blade of `decks`, in axes x flapwise, y edgewise, z along it.

    Sections are across the tangent, their x without part along y before the twist, which turns about −z.
    """
    fine = np.linspace(0.0, decks.LENGTH, 4001)
    line = CubicSpline(Z, keys[:, :3])
    speed = np.linalg.norm(line(fine, 1), axis=1)
    arcs = CubicSpline(fine, speed).antiderivative()(fine)
    both = [decks.iec_matrices(s, angle) for s, angle in zip(decks.STATIONS, decks.ANGLE, strict=True)]
    (K0, M0), (K1, M1) = [[matrix[np.ix_(ORDER, ORDER)] for matrix in pair] for pair in both]

    def matrices(s: float) -> tuple[Array, Array]:
        part = s / arcs[-1]
        return (1 - part) * K0 + part * K1, (1 - part) * M0 + part * M1

    at_keys = np.interp(Z, fine, arcs)

    def triad(s: float) -> Array:
        z = line(np.interp(s, arcs, fine), 1)
        z /= np.linalg.norm(z)
        x = np.cross([0.0, 1.0, 0.0], z)
        x /= np.linalg.norm(x)
        y = np.cross(z, x)
        twist = np.radians(np.interp(s, at_keys, keys[:, 3]))
        return np.stack([z, np.cos(twist) * x - np.sin(twist) * y, np.sin(twist) * x + np.cos(twist) * y], axis=1)

    return frequencies(at_keys, matrices, triad, degree=5)


def beamdyn(folder: Path, keys: Array) -> dict[str, Any]:
    (folder / "blade.dat").write_text(decks.beamdyn_blade())
    (folder / "primary.dat").write_text(mains.beamdyn_primary(keys.tolist()))
    return {"from": str(folder / "primary.dat")}


def hawc2(folder: Path, keys: Array) -> dict[str, Any]:
    """Return the section of a main body whose axes are x = −y, y = x of OpenFAST, and its twist about +z."""
    length = CubicSpline(Z, np.linalg.norm(CubicSpline(Z, keys[:, :3])(Z, 1), axis=1)).integrate(0.0, decks.LENGTH)
    (folder / "blade.st").write_text(decks.hawc2(True).replace("2.0000000000000000e+01", f"{length:.12e}", 1))
    rows = "\n".join(f"sec {i} {-y} {x} {z} {-twist} ;" for i, (x, y, z, twist) in enumerate(keys, start=1))
    head, rest = mains.hawc2_htc().split("nsec 2 ;")
    text = f"{head}nsec {len(keys)} ;\n{rows}\n{rest[rest.index('    end c2_def') :]}"
    (folder / "main.htc").write_text(text)
    return {"from": str(folder / "main.htc"), "body": "blade1"}


@pytest.mark.parametrize(("file", "sweep"), [(beamdyn, 0.8), (hawc2, 0.0)])
def test_blade_of_a_file_in_its_own_axes(
    tmp_path: Path, file: Callable[[Path, Array], dict[str, Any]], sweep: float
) -> None:
    """Signs of prebend, sweep, twist and centres, order of matrices: a wrong sign changes a frequency by 1e-2 and more.

    A blade with sweep and prebend whose twist is linear between key points is not quite one of linear pretwist.
    """
    keys = points(sweep)
    scene = {
        "structure": {"type": "spatial_beam", "section": file(tmp_path, keys)},
        "motion": {"type": "constant", "speed": 0.0},
        "model": {"theory": "consistent_linear", "effects": ["rotary_inertia"]},
        "modes": {"count": 6},
        "mesh": {"elements": 8},
    }
    found = np.array([row["frequency"] for row in rotfem.modes(scene).rows])
    np.testing.assert_allclose(found, of_openfast(keys)[:6], rtol=2e-5)
