"""Matrices of sections in blade files: one blade in five formats, and matrices that no section has."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rotfem
from tests import blade_decks as decks
from tests.blade_scenes import blade, read


def along_ours(matrix: Any) -> Any:
    """Return a matrix in axes 1, 2, 3 = z, −y, x from one in x, y, z: entry by entry."""
    place, sign = [2, 1, 0, 5, 4, 3], np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0])
    return np.asarray(matrix)[np.ix_(place, place)] * np.outer(sign, sign)


def test_one_blade_in_four_formats(tmp_path: Path) -> None:
    """Matrices at root and tip are those of sums over centres in IEC axes; pretwist is −twist."""
    (tmp_path / "windio.yaml").write_text(decks.windio())
    (tmp_path / "windio2.yaml").write_text(decks.windio_2())
    beams = {
        "beamdyn": blade(tmp_path, decks.beamdyn_blade(), structure_length=decks.LENGTH),
        "hawc2 full": blade(tmp_path, decks.hawc2(True), "full.st"),
        "hawc2": blade(tmp_path, decks.hawc2(False), "centres.st"),
        "windio": read(tmp_path, "windio.yaml"),
        "windio 2": read(tmp_path, "windio2.yaml"),
    }
    for name, beam in beams.items():
        assert beam.length == pytest.approx(decks.LENGTH, rel=1e-12)
        for x, station, angle in zip((0.0, decks.LENGTH), decks.STATIONS, decks.ANGLE, strict=True):
            at = beam.section.at(x)
            for key, matrix in zip(("stiffness", "mass"), decks.iec_matrices(station, angle), strict=True):
                wanted = along_ours(matrix)
                scale = np.sqrt(np.outer(np.diag(wanted), np.diag(wanted)))
                assert np.max(np.abs(at[key] - wanted) / scale) < 1e-12, (name, key, x)
    for name in ("windio", "windio 2"):
        twist = np.array(beams[name].pretwist)
        np.testing.assert_allclose(twist[[0, -1], 1], -np.radians(decks.TWIST), rtol=1e-12)


def number(i: int, j: int, which: int) -> str:
    """Return an entry of the matrix at the root as the decks write it, of stiffness (0) or mass (1)."""
    return f"{decks.iec_matrices(decks.STATIONS[0], decks.ANGLE[0])[which][i, j]:.16e}"


@pytest.mark.parametrize(
    ("deck", "name", "which", "entry", "message"),
    [
        ("beamdyn_blade", "blade.dat", 0, 0, "line 12: the stiffness matrix of station 1 is not positive definite"),
        ("beamdyn_blade", "blade.dat", 1, 5, "line 19: the mass matrix of station 1 is not positive definite"),
        ("windio", "blade.yaml", 0, 0, "stiff_matrix has a matrix, number 1, that is not positive definite"),
        ("windio", "blade.yaml", 1, 5, "inertia_matrix has a matrix, number 1, that is not positive semidefinite"),
        ("windio_2", "blade.yaml", 1, 5, "inertia_matrix has a matrix, number 1, that is not positive semidefinite"),
    ],
)
def test_a_matrix_that_no_section_has(
    tmp_path: Path, deck: str, name: str, which: int, entry: int, message: str
) -> None:
    """Without shear stiffness, or with less inertia in torsion than its offset from the line makes, m y² + m z²."""
    text: str = getattr(decks, deck)()
    old = number(entry, entry, which)
    assert old in text
    more: dict[str, Any] = {"structure_length": decks.LENGTH} if name == "blade.dat" else {}
    with pytest.raises(rotfem.SceneError, match=message):
        blade(tmp_path, text.replace(old, "0.0" if which == 0 else "0.5", 1), name, **more)
