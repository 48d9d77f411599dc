"""Observed orders: h^(p+1) in space for P1 … P4, h² in time for both schemes.

The rates are theorems of finite elements (L² norm, smooth solution) and of second-order schemes; the cases are chosen
smooth: a steady state, and a spin-up whose speed rises from zero with zero rate.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from numpy.polynomial.legendre import leggauss
from scipy.interpolate import BarycentricInterpolator

from rotfem import run

Array = npt.NDArray[np.float64]

#: A thick beam, well deflected: tip u2 = 0.3 L, with shear, stretch and spin all taking part.
STEADY = {
    "motion": {"type": "constant", "speed": 2.0},
    "model": {"theory": "reissner"},
    "loads": {"tip_force": [0.0, 2.0], "distributed": [0.0, 1.0]},
}
ELEMENTS = {1: (16, 32, 64), 2: (8, 16, 32), 3: (6, 12, 24), 4: (4, 8, 16)}


def field(shape: dict[str, Array], degree: int, x: Array) -> Array:
    """Return (u1, u2, alpha) at x, shape (3, len(x)), of the nodal values of a beam with equal elements."""
    nodes, h = shape["x"], shape["x"][degree]
    elements = (len(nodes) - 1) // degree
    element = np.minimum((x / h).astype(int), elements - 1)
    out = np.empty((3, len(x)))
    for e in range(elements):
        here, own = element == e, slice(e * degree, (e + 1) * degree + 1)
        for i, name in enumerate(("u1", "u2", "alpha")):
            out[i, here] = BarycentricInterpolator(nodes[own], shape[name][own])(x[here])
    return out


@pytest.fixture(scope="module")
def exact(unit_beam: Any) -> tuple[Array, Array, Array]:
    """Return (points, weights, field) of a solution whose error is below those measured: P6 on 64 elements."""
    s, w = leggauss(8)
    x = ((np.arange(64)[:, None] + (s + 1) / 2) / 64).ravel()
    fine = run(unit_beam({"mesh": {"elements": 64, "degree": 6}}, **STEADY))
    return x, np.tile(w / 128, 64), field(fine.shape, 6, x)


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
def test_order_in_space(unit_beam: Any, exact: tuple[Array, Array, Array], degree: int) -> None:
    x, w, solution = exact
    errors = []
    for n in ELEMENTS[degree]:
        mesh = {"elements": n, "degree": degree}
        shape = run(unit_beam({"mesh": mesh}, **STEADY)).shape
        errors.append(np.sqrt((field(shape, degree, x) - solution) ** 2 @ w))
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    np.testing.assert_allclose(orders[-1], degree + 1, rtol=0, atol=0.1)


#: A short spin-up of the unit beam; the first frequency is 3.5 rad/s, the axial ones start at 31 rad/s.
UNSTEADY = {
    "motion": {"type": "spin_up", "speed": 2.0, "duration": 2.0},
    "mesh": {"elements": 2, "degree": 3},
}
SCHEMES = {
    "generalised_alpha, rho 1.0": {"scheme": "generalised_alpha", "spectral_radius": 1.0},
    "generalised_alpha, rho 0.8": {"scheme": "generalised_alpha", "spectral_radius": 0.8},
    "generalised_alpha, rho 0.0": {"scheme": "generalised_alpha", "spectral_radius": 0.0},
    "newmark": {"scheme": "newmark"},
    "energy_conserving": {"scheme": "energy_conserving"},
}


def changes_of_history(
    make: Any, scheme: dict[str, Any], theory: str, frame: str = "rotating", number: int = 3
) -> Array:
    """Return the largest change of (u1, u2, alpha) over all coarse times from each of some steps to the half of it."""
    histories = []
    for k in range(number):
        time = {"end": 2.0, "step": 0.02 / 2**k, "output_every": 2**k, **scheme}
        h = run(make({"model.theory": theory, "model.frame": frame}, **UNSTEADY, time=time)).history
        histories.append(np.array([h["tip_u1"], h["tip_u2"], h["tip_alpha"]]))
    return np.array([np.abs(b - a).max(axis=1) for a, b in pairwise(histories)])


@pytest.mark.parametrize("scheme", list(SCHEMES))
@pytest.mark.parametrize("theory", ["reissner", "consistent_linear"])
def test_order_in_time(unit_beam: Any, scheme: str, theory: str) -> None:
    change = changes_of_history(unit_beam, SCHEMES[scheme], theory)
    orders = np.log2(change[:-1] / change[1:])
    np.testing.assert_allclose(orders[-1], 2.0, rtol=0, atol=0.1)


@pytest.mark.parametrize("scheme", ["generalised_alpha, rho 0.8", "energy_conserving"])
def test_order_in_time_in_the_inertial_frame(unit_beam: Any, scheme: str) -> None:
    change = changes_of_history(unit_beam, SCHEMES[scheme], "reissner", "inertial")
    orders = np.log2(change[:-1] / change[1:])
    np.testing.assert_allclose(orders[-1], 2.0, rtol=0, atol=0.1)


@pytest.mark.parametrize(
    ("theory", "frame", "order"),
    # In the inertial frame the clamp is moved, which costs a method of stage order two up to one order.
    [("reissner", "rotating", 4.0), ("linear", "rotating", 4.0), ("reissner", "inertial", 3.0)],
)
def test_higher_order_in_time(unit_beam: Any, theory: str, frame: str, order: float) -> None:
    """The order is that of bending: axial motions, which these steps do not resolve, are damped with less."""
    change = changes_of_history(unit_beam, {"scheme": "esdirk4"}, theory, frame, 4)
    orders = np.log2(change[:-1] / change[1:])
    assert np.all(orders[-1, 1:] > order - 0.25)
