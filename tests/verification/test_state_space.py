"""The modal state-space model against the time integration, and the exported matrices against the model they are of."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import scipy.linalg as sl
from scipy import signal
from scipy.io import mmread
from scipy.sparse import load_npz

from rotfem import ComputationError, OutputError, modes, run
from rotfem.analysis.state_space import state_space, write_matrices

Array = npt.NDArray[np.float64]

SPINNING = {"structure.hub_radius": 1.0, "motion": {"type": "constant", "speed": 6.0}, "modes.count": 6}
OUTPUTS = ("tip_u1", "tip_u2", "tip_alpha")


@pytest.mark.parametrize(
    ("theory", "viscosity", "given", "seen"),
    [
        ("consistent_linear", 0.0, "tip_force_2", {"tip_u2": 1.5e-3, "tip_alpha": 5e-3}),
        ("reissner", 1e-3, "tip_moment", {"tip_u2": 5e-3}),
    ],
)
def test_step_response(spin_up: Any, theory: str, viscosity: float, given: str, seen: dict[str, float]) -> None:
    """A force of 1 N across the tip, or a moment of 1 N·m, at t = 0: six modes against steps of fourth order of all.

    Modes answer a step by at most twice their static part, so what is left out is 2 Σ_{n>6} 4/β_n⁴ of L³/EI, 3e-4 of
    the peak; steps of 2 ms are a fiftieth of a period of the third mode, and add 1e-3. Of force to rotation and moment
    to deflection at most 2 Σ_{n>6} 4/β_n³ of L²/EI is left out, 5e-3 of the peak of twice L²/2EI. Moment to rotation
    needs more modes than six.
    """
    scene = spin_up(SPINNING | {"model.theory": theory, "structure.damping": {"kelvin_voigt": viscosity}})
    result = modes(scene)
    model = state_space(result.analysis, result.spinning, 6)
    force = {"tip_force": {"over_time": [[0.0, 0.0, 0.0], [1e-9, 0.0, 1.0]]}}
    moment = {"tip_moment": {"over_time": [[0.0, 0.0], [1e-9, 1.0]]}}
    start = {"initial": {"state": "steady"}, "time": {"end": 1.5, "step": 0.002, "scheme": "esdirk4"}}
    history = run(scene.replace({"loads": moment if given == "tip_moment" else force} | start)).history
    u = np.zeros((len(history["t"]), 3))
    u[:, model.inputs.index(given)] = 1.0
    _, y, _ = signal.lsim(model.system(), u, history["t"])
    for name, tolerance in seen.items():
        found, expected = y[:, model.outputs.index(name)], history[name] - history[name][0]
        assert abs(found[0]) < 0.01 * np.max(np.abs(found)), name
        assert np.max(np.abs(found - expected)) < tolerance * np.max(np.abs(expected)), name


def test_what_scipy_makes_of_it(unit_beam: Any, tmp_path: Path) -> None:
    """signal.StateSpace takes it; poles are the eigenvalues, the gain at zero frequency is the static answer."""
    damped = {"structure.damping": {"kelvin_voigt": 1e-3}, "motion.speed": 3.0, "structure.hub_radius": 0.5}
    result = modes(unit_beam(damped))
    model = state_space(result.analysis, result.spinning, 4)
    system = signal.StateSpace(*model.system())
    values = result.spinning.pairs.values[:4]
    np.testing.assert_allclose(
        np.sort_complex(np.linalg.eigvals(system.A)), np.sort_complex([*values, *values.conj()]), rtol=1e-9
    )
    assert (model.A.shape, model.B.shape, model.C.shape, model.D.shape) == ((8, 8), (8, 3), (3, 8), (3, 3))
    gain = model.D - model.C @ np.linalg.solve(model.A, model.B)
    forces = ({"tip_force": [1e-6, 0.0]}, {"tip_force": [0.0, 1e-6]}, {"tip_moment": 1e-6})
    at_rest = np.array([run(unit_beam(damped)).history[name][0] for name in OUTPUTS])
    for column, load in enumerate(forces):
        h = run(unit_beam(damped, loads=load)).history
        static = (np.array([h[name][0] for name in OUTPUTS]) - at_rest) / 1e-6
        np.testing.assert_allclose(gain[:, column], static, rtol=1e-5, atol=1e-7)
    file = np.load(model.write(tmp_path / "state_space.npz"))
    for name in "ABCD":
        np.testing.assert_array_equal(file[name], getattr(model, name))
    assert tuple(file["inputs"]) == ("tip_force_1", "tip_force_2", "tip_moment")
    assert tuple(file["outputs"]) == OUTPUTS
    assert float(file["speed"]) == 3.0


def test_unstable_mode_is_in_the_model(hub_beam: Any) -> None:
    """A real growing eigenvalue is one state, its decaying partner another; so the model answers as the matrices do."""
    result = modes(hub_beam({"model.theory": "linear", "motion": {"type": "constant", "speed": 4.0}}))
    model = state_space(result.analysis, result.spinning, 6)
    poles = np.linalg.eigvals(model.A).real
    assert np.max(poles) == pytest.approx(2.743576669, rel=1e-6)  # iccia_frequencies.csv
    assert np.min(poles) == pytest.approx(-np.max(poles))
    tip, s, p = result.analysis.structure.tip_values.columns(len(result.spinning.q)), 2j, result.spinning.pencil
    M, C, K = (p.apply(A, np.eye(len(tip))) for A in (p.M, p.C, p.K))
    full = tip.T @ np.linalg.solve(s**2 * M + s * C + K, tip)
    found = model.C @ np.linalg.solve(s * np.eye(len(model.A)) - model.A, model.B) + model.D
    np.testing.assert_allclose(found, full, atol=1e-4 * np.max(np.abs(full)))


def test_what_nothing_holds_has_no_static_answer(spin_up: Any) -> None:
    """A hinge on the axis, without a spring: the flexibility of the others would be lost in round-off."""
    result = modes(spin_up({"structure.root": {"lag_stiffness": 0.0}, "motion": {"type": "constant", "speed": 0.0}}))
    with pytest.raises(ComputationError, match="no static answer"):
        state_space(result.analysis, result.spinning, 2)


def test_exported_matrices(unit_beam: Any, tmp_path: Path) -> None:
    """Matrix Market and npz hold the same matrices, without the clamp; they give the frequencies of `modes`."""
    scene = unit_beam({"motion.speed": 3.0, "structure.tip_mass": 0.1, "model.theory": "reissner"})
    result = modes(scene)
    paths = write_matrices(result.analysis, result.spinning, tmp_path)
    names = {"M.mtx", "C.mtx", "K.mtx", "M.npz", "C.npz", "K.npz", "unknowns.csv"}
    assert {path.name for path in paths} == names
    M, C, K = (mmread(tmp_path / f"{name}.mtx").toarray() for name in "MCK")
    for name, matrix in zip("MCK", (M, C, K), strict=True):
        np.testing.assert_array_equal(load_npz(tmp_path / f"{name}.npz").toarray(), matrix)
    zero, one = np.zeros_like(M), np.eye(len(M))
    values = sl.eigvals(np.block([[zero, one], [-K, -C]]), np.block([[one, zero], [zero, M]]))
    found = np.sort(values.imag[values.imag > 1e-6])[:6]
    np.testing.assert_allclose(found, [row["frequency"] for row in result.rows], rtol=1e-7)
    with (tmp_path / "unknowns.csv").open(newline="") as file:
        unknowns = list(csv.DictReader(file))
    assert [int(row["row"]) for row in unknowns] == list(range(len(M)))
    x = np.array([float(row["x1"]) for row in unknowns])
    assert x.min() > 0.0
    assert x.max() == 1.0
    mass = np.array([row["component"] == "u2" for row in unknowns], dtype=float)
    # A rigid translation of the beam but for its first element has less than the whole mass, 1.1, and not much less.
    assert 1.0 < mass @ M @ mass < 1.1
    with pytest.raises(OutputError, match="missing"):
        write_matrices(result.analysis, result.spinning, tmp_path / "missing")
