"""Modes of heavily damped structures: all of them are found, those that no longer vibrate as a slow and a fast one.

Where the damping matrix is a combination of M and K, C = η K + a₀ M, each undamped frequency ω gives the roots of

    λ² + (η ω² + a₀) λ + ω² = 0,

which shares nothing with the search for them. In a spinning beam the stiffening by its force is not damped, so there
the roots are those of the exported matrices by LAPACK.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import scipy.linalg as sl

from rotfem import campbell, modes
from tests.beams import STRUCTURE

Array = npt.NDArray[Any]

SECTION = STRUCTURE["section"]


def beam(viscosity: float, mass_rate: float, speed: float, count: int, **changes: Any) -> dict[str, Any]:
    """Return a scene of a planar beam with Kelvin–Voigt and mass-proportional damping."""
    damping = {"kelvin_voigt": viscosity, "rayleigh": [mass_rate, 0.0]}
    return {
        "structure": {"type": "planar_beam", "length": 10.0, "section": SECTION, "damping": damping},
        "motion": {"type": "constant", "speed": speed},
        "mesh": {"elements": 8},
        "modes": {"count": count},
        **changes,
    }


def roots(omega: Array, viscosity: float, mass_rate: float) -> Array:
    """Return the roots of λ² + (η ω² + a₀) λ + ω² = 0 with non-negative imaginary part, by increasing ω, slow first."""
    out: list[complex] = []
    for w in omega:
        half = 0.5 * (viscosity * w**2 + mass_rate)
        if half < w:
            out.append(complex(-half, np.sqrt(w**2 - half**2)))
        else:  # their product is ω², which keeps the digits of the slow one
            fast = -half - np.sqrt(half**2 - w**2)
            out += [complex(w**2 / fast), complex(fast)]
    return np.array(out)


@cache
def undamped(theory: str) -> Array:
    """Return the frequencies of the beam at rest, rad/s."""
    return modes(beam(0.0, 0.0, 0.0, 14, model={"theory": theory})).frequencies


@pytest.mark.parametrize(
    ("viscosity", "theory"), [(1e-3, "consistent_linear"), (2e-2, "reissner"), (1.0, "consistent_linear")]
)
def test_proportional_damping(viscosity: float, theory: str) -> None:
    """At rest all first ten eigenvalues are those of the undamped frequencies, to ten times their error bounds.

    The bounds are those of two computations, and near critical damping a root moves more than the frequency it is of.
    """
    expected = roots(undamped(theory), viscosity, 1.0)[:10]
    result = modes(beam(viscosity, 1.0, 0.0, 10, model={"theory": theory}))
    assert len(result.rows) == 10
    tolerance = 10 * (result.column("error_bound") + 1e-9)
    found = result.eigenvalues
    distance = np.array([np.min(np.abs(expected - lam)) / abs(lam) for lam in found])
    missed = np.array([np.min(np.abs(found - lam)) / abs(lam) for lam in expected])
    assert np.all(distance < tolerance)
    assert np.all(missed < np.max(tolerance))
    assert result.stable


def test_overdamped_modes_are_named() -> None:
    """Each undamped mode is one row that vibrates, or a slow and a fast one with its number."""
    result = modes(beam(0.02, 1.0, 0.0, 9))
    over = [f"{n}th edgewise, {way}" for n in (4, 5, 6) for way in ("slow", "fast")]
    assert result.labels == ["1st edgewise", "2nd edgewise", "3rd edgewise", *over]
    np.testing.assert_array_equal(result.frequencies[3:], 0.0)
    np.testing.assert_allclose(result.damping[3:], 1.0)


def test_plate_and_free_hub() -> None:
    """The same roots of a plate at rest; a free hub keeps its rigid-body mode, and its others are damped so, too."""
    plate = {"type": "plate", "length": 1.0, "width": 0.5, "thickness": 0.01, "E": 7e10, "nu": 0.3, "rho": 2700.0}
    still = {"motion": {"type": "constant", "speed": 0.0}}
    hub = {"motion": {"type": "torque", "hub_inertia": 50.0, "pulses": [[0.0, 1.0, 1.0]]}}
    cases = [
        ({"structure": plate, **still, "mesh": {"elements": [4, 4]}}, 5e-3, 0),
        ({**beam(0.0, 0.0, 0.0, 6), **hub}, 0.02, 1),
    ]
    for scene, viscosity, rigid in cases:
        structure = {key: value for key, value in scene["structure"].items() if key != "damping"}
        bare, damping = scene | {"structure": structure}, {"kelvin_voigt": viscosity}
        free = modes(bare | {"modes": {"count": 9 + rigid}})
        expected = roots(free.frequencies[rigid:], viscosity, 0.0)[:6]
        result = modes(bare | {"structure": structure | {"damping": damping}, "modes": {"count": 6 + rigid}})
        assert result.labels[:rigid] == ["rigid body"] * rigid
        np.testing.assert_allclose(result.eigenvalues[rigid:], expected, rtol=1e-6)


@pytest.mark.parametrize("viscosity", [5e-3, 0.1])
def test_spinning(viscosity: float) -> None:
    """In spin all rows are eigenvalues of the matrices by LAPACK, and none with a slower shape is left out."""
    result = modes(beam(viscosity, 1.0, 6.0, 8, model={"theory": "reissner"}))
    pencil, clamped = result.spinning.pencil, result.analysis.system.clamped
    size = pencil.K.getSize()[0]
    free = np.setdiff1d(np.arange(size), clamped)
    M, C, K = (np.real(pencil.apply(A, np.eye(size)))[np.ix_(free, free)] for A in (pencil.M, pencil.C, pencil.K))
    d, unit = 1 / np.sqrt(np.diag(K)), 100.0
    M, C, K = (unit**p * A * np.outer(d, d) for p, A in ((2, M), (1, C), (0, K)))
    one, zero = np.eye(len(free)), np.zeros_like(M)
    values, vectors = sl.eig(np.block([[zero, one], [-K, -C]]), np.block([[one, zero], [zero, M]]))
    x = vectors[: len(free)]
    omega = unit * np.sqrt(np.abs(np.sum(x.conj() * (K @ x), axis=0) / np.sum(x.conj() * (M @ x), axis=0)))
    found = result.eigenvalues
    distance = [np.min(np.abs(unit * values - lam)) / abs(lam) for lam in found]
    assert np.max(distance) < 1e-7  # LAPACK's own error, of 1e-16 times the largest |λ|
    slow = (values.imag >= 0.0) & (omega < 60.0)  # two undamped frequencies are below
    for lam in unit * values[slow]:
        assert np.min(np.abs(found - lam)) < 1e-7 * abs(lam)


def test_campbell() -> None:
    """Branches of a heavily damped beam are followed over speed, and none is lost."""
    scene = beam(5e-3, 1.0, 6.0, 4, mesh={"elements": 4})
    result = campbell(scene, [0.0, 3.0, 6.0])
    assert result.labels == ["1st edgewise", "2nd edgewise", "3rd edgewise", "4th edgewise"]
    assert np.all(np.isfinite(result.frequencies))
    single = modes(scene)
    np.testing.assert_allclose(result.frequencies[-1], single.frequencies, rtol=1e-8)


def test_a_damper_at_a_hinge_on_every_mesh() -> None:
    """It makes one motion of the root overdamped, whose fast eigenvalue grows with the mesh and is far from the others.

    The vibrations converge: cubic elements of 0.83 and 0.42 m, the fifth mode 2e-5 apart.
    """
    hinge = {**STRUCTURE, "hub_radius": 1.0, "root": {"lag_stiffness": 0.0, "lag_damping": 200.0}}
    scene = {"structure": hinge, "motion": {"type": "constant", "speed": 20.0}, "modes": {"count": 5}}
    found = [modes({**scene, "mesh": {"elements": n}}) for n in (12, 24)]
    np.testing.assert_allclose(found[0].frequencies, found[1].frequencies, rtol=1e-4)
    assert all(np.all(np.array([row["residual"] for row in r.summary["modes"]]) < 1e-8) for r in found)


@pytest.mark.parametrize(
    ("damper", "damping"), [(0.01, {}), (1.0, {"modal": [0.01, 0.02]}), (100.0, {"kelvin_voigt": 1e-3})], ids=str
)
def test_a_damper_at_a_hinge_without_a_spring(damper: float, damping: dict[str, Any]) -> None:
    """Its zero eigenvalue is the slow one of an overdamped mode, whatever the sign that round-off gives to it.

    Stiffness, mass and damper in other proportions of the same eigenvalues are rounded otherwise, which moves the zero
    to either side and, with its error bound, nothing else: the lists are the same.
    """
    found = []
    for size in (1.0, 1.1, 1.3, 1.7, 3.0):
        section = {"EA": 1e5, "GA": 3e4, "EI": 120.0, "mass_per_length": 0.5, "rotary_inertia": 2e-4}
        root = {"lag_stiffness": 0.0, "lag_damping": size * damper}
        beam = {"section": {k: size * v for k, v in section.items()}, "root": root, "damping": damping}
        structure = {"type": "planar_beam", "length": 2.0, "hub_radius": 0.3, **beam}
        scene = {"structure": structure, "motion": {"type": "constant", "speed": 0.0}, "modes": {"count": 3}}
        result = modes({**scene, "model": {"theory": "linear"}, "mesh": {"elements": 3}, "output": {"error": False}})
        found.append([(row["label"], row["growth"], row["frequency"]) for row in result.rows])
        slow = result.rows[0]
        assert slow["label"] == "rigid body" or (slow["label"] == "1st edgewise, slow" and slow["error_bound"] >= 1.0)
    for other in found[1:]:
        assert [label for label, *_ in other] == [label for label, *_ in found[0]]
        np.testing.assert_allclose([r[1:] for r in other], [r[1:] for r in found[0]], rtol=1e-3, atol=1e-6)
