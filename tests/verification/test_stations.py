"""Section forces, strains and unknowns at stations along a beam."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

import rotfem
from rotfem.results.files import read_csv
from tests.beams import SPIN_UP, STRUCTURE

#: M (N·m) along the Reissner beam in its spin-up, computed without finite elements (see the README.md there).
REFERENCE = Path(__file__).resolve().parents[1] / "reference" / "spin_up_moment.csv"
PLACES = [0.0, 0.7, 2.5, 5.3, 9.1, 10.0]
LOADS = {"tip_force": [0.0, 3.0], "distributed": [0.0, 2.0]}
SECTION = STRUCTURE["section"]
SPATIAL: dict[str, Any] = {
    "type": "spatial_beam",
    "length": 10.0,
    "hub_radius": 0.5,
    "section": {
        **{"EA": SECTION["EA"], "GA2": SECTION["GA"], "GA3": SECTION["GA"], "GJ": 1e4},
        **{"EI2": 3e4, "EI3": SECTION["EI"], "mass_per_length": SECTION["mass_per_length"]},
    },
}
STILL = {"type": "constant", "speed": 0.0}
STEADY: dict[str, Any] = {
    "structure": {**STRUCTURE, "hub_radius": 0.5},
    "motion": {"type": "constant", "speed": 3.0},
    "loads": LOADS,
    "output": {"stations": PLACES, "error": False},
}


def forces(elements: int, degree: int, theory: str = "reissner", **more: Any) -> dict[str, np.ndarray]:
    """Return N, Q and M of the spinning, loaded beam at the places, and the moment at the root."""
    scene = {**STEADY, "mesh": {"elements": elements, "degree": degree}, "model": {"theory": theory}, **more}
    result = rotfem.run(scene)
    assert result.stations is not None
    return {name: result.stations[name][0] for name in ("N", "Q", "M")} | dict(result.summary["root"])


@pytest.fixture(scope="module")
def reference() -> dict[str, np.ndarray]:
    """N, Q and M on a mesh that is so fine that its errors are round-off."""
    return forces(48, 4)


@pytest.mark.parametrize(("degree", "coarse", "order"), [(2, 8, 2.7), (3, 4, 3.7)])
def test_order(degree: int, coarse: int, order: float, reference: dict[str, np.ndarray]) -> None:
    """All section forces at all places, ends of cells among them, converge with the order k + 1 of the Gauss points."""
    errors = []
    for elements in (coarse, 2 * coarse):
        found = forces(elements, degree)
        errors.append([np.max(np.abs(found[n] - reference[n])) / np.max(np.abs(reference[n])) for n in ("Q", "M")])
    assert np.all(np.log2(np.array(errors[0]) / errors[1]) > order)


def test_equilibrium(reference: dict[str, np.ndarray]) -> None:
    """At the root they are the force of the hub, and M(L) = 0."""
    assert reference["M"][0] == pytest.approx(-reference["root_m3"], rel=1e-7)
    assert reference["N"][0] == pytest.approx(-reference["root_f1"], rel=1e-7)
    assert reference["Q"][0] == pytest.approx(-reference["root_f2"], rel=1e-7)
    assert abs(reference["M"][-1]) < 1e-7 * reference["M"][0]


def test_statics() -> None:
    """A clamped beam in the linear theory: Q = F + q (L − X), M = F (L − X) + q (L − X)²/2, exactly."""
    still = {"motion": {"type": "constant", "speed": 0.0}}
    found = forces(2, 3, "linear", **still)
    arm = 10.0 - np.array(PLACES)
    np.testing.assert_allclose(found["Q"], 3.0 + 2.0 * arm, rtol=1e-7)
    np.testing.assert_allclose(found["M"], 3.0 * arm + arm**2, rtol=1e-7, atol=1e-6)
    np.testing.assert_allclose(found["N"], 0.0, atol=1e-9)


def test_nothing_reaches_over_a_step_of_the_section() -> None:
    """EI jumps by ten at mid-span: M = F (L − X) does not, nor M/EI beside it; a station there is the outer one."""
    step = [[0.0, 1.4e5], [4.999, 1.4e5], [5.0, 1.4e4], [10.0, 1.4e4]]
    scene = {
        "structure": {**STRUCTURE, "section": {**STRUCTURE["section"], "EI": step}},
        "motion": {"type": "constant", "speed": 0.0},
        "model": {"theory": "linear"},
        "loads": {"tip_force": [0.0, 3.0]},
        "output": {"stations": [4.9, 5.0, 5.1], "quantities": ["M", "kappa"]},
    }
    stations = rotfem.run(scene).stations
    assert stations is not None
    np.testing.assert_allclose(stations["M"][0], 3.0 * (10.0 - stations.x), rtol=1e-6)
    np.testing.assert_allclose(stations["kappa"][0] * [1.4e5, 1.4e4, 1.4e4], stations["M"][0], rtol=1e-6)


def test_a_spin_up_over_time(tmp_path: Path) -> None:
    """M along the Reissner beam against a fine mesh, 1e-4 of its largest; files hold what the result has."""
    time = {"end": 2.0, "step": 0.02}
    scene = {**SPIN_UP, "motion": {"type": "spin_up", "speed": 6.0, "duration": 4.0}, "time": time}
    output = {"stations": 5, "every": 10, "quantities": ["M"], "error": False}
    coarse = rotfem.run({**scene, "output": output}, folder=tmp_path)
    fine = rotfem.run({**scene, "output": output, "mesh": {"elements": 30, "degree": 3}})
    assert coarse.stations is not None
    assert fine.stations is not None
    assert len(coarse.stations.t) == 11
    scale = np.max(np.abs(fine.stations["M"]))
    assert np.max(np.abs(coarse.stations["M"] - fine.stations["M"])) < 1e-4 * scale
    assert coarse.stations["M"][-1, 0] == pytest.approx(-coarse.history["root_m3"][-1], rel=1e-3)
    np.testing.assert_allclose(coarse.stations["u2"][:, -1], coarse.history["tip_u2"][::10], rtol=1e-12)
    columns = read_csv(tmp_path / "stations.csv")
    assert list(columns) == ["t", "x", "M", "u1", "u2", "alpha"]
    np.testing.assert_array_equal(columns["M"].reshape(11, 5), coarse.stations["M"])
    rotfem.run({**scene, "output": {**output, "format": "netcdf"}}, folder=tmp_path)
    with xarray.open_dataset(tmp_path / "stations.nc", engine="scipy") as file:
        np.testing.assert_array_equal(file["M"], coarse.stations["M"])
        assert file["M"].attrs["units"] == "N·m"
    assert not (tmp_path / "stations.csv").exists()


def test_moments_of_the_spin_up() -> None:
    """M along the Reissner beam, and the hub's, against one polynomial over it: 1e-5 of the mesh, 2e-6 of the steps."""
    table = np.loadtxt(REFERENCE, delimiter=",", skiprows=1)
    output = {"stations": [0.0, 2.0, 4.0, 6.0, 8.0], "quantities": ["M"], "error": False}
    time = {"end": 12.5, "step": 0.05, "scheme": "esdirk4"}
    result = rotfem.run({**SPIN_UP, "time": time, "output": output})
    assert result.stations is not None
    rows, scale = np.round(table[:, 0] / 0.05).astype(int), np.max(np.abs(table[:, 1:]))
    np.testing.assert_allclose(result.stations["M"][rows], table[:, 1:], rtol=0, atol=2e-5 * scale)
    np.testing.assert_allclose(result.history["root_m3"][rows], -table[:, 1], rtol=0, atol=5e-6 * scale)


def test_a_spatial_beam_in_a_plane_is_a_planar_one() -> None:
    """N, Q, M are N, Q2, M3 there, and T, Q3, M2 of a moment at the tip constant, with pretwist along turned axes."""
    scene = {**STEADY, "model": {"theory": "linear"}, "motion": {"type": "constant", "speed": 0.0}}
    loads = {"tip_force": [5.0, 3.0, 0.0], "tip_moment": [2.0, 0.0, 0.0], "distributed": [0.0, 2.0, 0.0]}
    three = rotfem.run({**scene, "structure": SPATIAL, "loads": loads}).stations
    plane = rotfem.run({**scene, "loads": {"tip_force": [5.0, 3.0], "distributed": [0.0, 2.0]}}).stations
    assert three is not None
    assert plane is not None
    for one, other in (("N", "N"), ("Q", "Q2"), ("M", "M3"), ("kappa", "kappa3"), ("u2", "u2"), ("alpha", "theta3")):
        scale = np.max(np.abs(plane[one]))
        np.testing.assert_allclose(three[other], plane[one], atol=1e-6 * scale, err_msg=one)  # the work of the moment
    np.testing.assert_allclose(three["T"], 2.0, rtol=1e-3)  # of moments on turned sections the work is of second order
    np.testing.assert_allclose(three["kappa1"], three["T"] / 1e4, rtol=1e-9)


@pytest.mark.parametrize(
    ("output", "key"),
    [
        ({"stations": [0.0, 11.0]}, "output.stations"),
        ({"stations": [5.0, 1.0]}, "output.stations"),
        ({"stations": 1}, "output.stations"),
        ({"quantities": ["M"]}, "output.quantities"),
        ({"stations": 3, "quantities": ["M2"]}, "output.quantities"),
    ],
)
def test_refused(output: dict[str, Any], key: str) -> None:
    with pytest.raises(rotfem.SceneError, match=key):
        rotfem.Scene.from_dict({**SPIN_UP, "output": output})


def test_damping_by_mode_is_a_stress() -> None:
    """M and Q at the root are those of a free hub at every step, to the mesh: 5e-5 and 5e-4. It makes 2e-2 of them."""
    scene = {
        "structure": {**STRUCTURE, "damping": {"modal": [0.02, 0.03, 0.05]}},
        "motion": {"type": "torque", "hub_inertia": 20.0, "pulses": [[0.0, 0.3, 10.0]]},
        "mesh": {"elements": 16, "degree": 3},
        "time": {"end": 0.5, "step": 0.005},
        "output": {"stations": [0.0, 10.0], "quantities": ["M", "Q"], "error": False},
    }
    result = rotfem.run(scene)
    assert result.stations is not None
    for name, root, close in (("M", "root_m3", 2e-4), ("Q", "root_f2", 2e-3)):
        hub = result.history[root]
        assert np.max(np.abs(result.stations[name][1:, 0] + hub[1:])) < close * np.max(np.abs(hub)), name


def test_twist_is_about_the_bent_axis():
    """An end moment m bends a beam with GJ = EI₂ = EI₃ to a helix: its turn at x is θ = κ x about κ = m/GJ.

    Its part about the bent axis is 2 atan(tan(½|κ| x) κ₁/|κ|); of torsion alone it is κ₁ x, of bending 0.
    """
    x, round_bar = np.array([0.0, 4.0, 10.0]), {**SPATIAL["section"], "GJ": 1e4, "EI2": 1e4, "EI3": 1e4}
    for turns in ([0.1, 0.15, 0.0], [0.1, 0.0, 0.0], [0.0, 0.15, 0.0]):
        scene = {
            "structure": {**SPATIAL, "section": round_bar},
            "motion": {"type": "constant", "speed": 0.0},
            "loads": {"tip_moment": {"value": [1e4 * k for k in turns], "kind": "follower"}},
            "output": {"stations": x.tolist(), "error": False},
        }
        stations, size = rotfem.run(scene).stations, np.linalg.norm(turns)
        assert stations is not None
        wanted = 2 * np.arctan(np.tan(size * x / 2) * turns[0] / size)
        np.testing.assert_allclose(stations["twist"][-1], wanted, atol=1e-5)
