"""Plates: thin and thick squares against spectral values, strips against beams, large deflection, theorems."""

from __future__ import annotations

import csv
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rotfem
from rotfem.analysis.modal import ModalAnalysis
from rotfem.commands.problem import Problem
from rotfem.errors import SceneError
from rotfem.numerics.linear import negative_eigenvalues
from rotfem.scene import Scene
from tests.plate_mesh_files import grid, write_msh

from .conftest import reference_file

E, NU, RHO = 70e9, 0.3, 2700.0


def square(h: float, **changes: Any) -> Scene:
    """Return the cantilever square a = b = 1 m of thickness h, default mesh, with dotted keys changed (__ for .)."""
    tables = {
        "structure": {"type": "plate", "length": 1.0, "width": 1.0, "thickness": h, "E": E, "nu": NU, "rho": RHO},
        "motion": {"type": "constant", "speed": 0.0},
        "model": {"theory": "von_karman_linear"},
        "modes": {"count": 8},
    }
    return Scene.from_dict(tables).replace({key.replace("__", "."): value for key, value in changes.items()})


def unit(h: float) -> float:
    """Return √(D/ρh)/a², the unit of λ and γ, rad/s."""
    return float(np.sqrt(E * h**2 / (12 * (1 - NU**2) * RHO)))


def transverse(scene: Scene) -> np.ndarray:
    """Return the frequencies (rad/s) of the modes with most of their energy across the plate."""
    return np.array([row["frequency"] for row in rotfem.modes(scene).rows if row["share_bending"] > 0.5])


# --- thin and thick squares ------------------------------------------------------------------------------------------

#: Leissa's problem, Kirchhoff's plate at rest: spectral values, five digits; the tolerance is the acceptance's.
THIN = np.array([3.4710, 8.5065, 21.285, 27.199, 30.956])


@pytest.mark.parametrize(("t", "cell"), [(1e-4, "quadrilateral"), (1e-3, "triangle")])
def test_thin_square_at_rest(t: float, cell: str) -> None:
    """8×8 cells, quadrilaterals of degree 2 or twice as many triangles of degree 3."""
    found = transverse(square(t, mesh__cell=cell))[:5] / unit(t)
    np.testing.assert_allclose(found, THIN, rtol=1e-3)


def test_thin_square_on_a_distorted_mesh(tmp_path: Path) -> None:
    """Inner nodes of the 8×8 mesh moved by up to 0.2 of a cell each way, from a mesh file."""
    points, groups = grid(8, 8)
    inner = (points[:, 0] > 0) & (points[:, 0] < 1) & (np.abs(points[:, 1]) < 0.5)
    points[inner] += np.random.default_rng(3).uniform(-0.2, 0.2, (inner.sum(), 2)) / 8
    mesh = write_msh(tmp_path / "distorted.msh", points, groups)
    scene = square(1e-4, structure__length=None, structure__width=None, structure__mesh=str(mesh))
    found = transverse(scene)[:5] / unit(1e-4)
    np.testing.assert_allclose(found, THIN, rtol=1e-3)


#: (h/a, spin, δ, γ, with Coriolis force) of the spectral values; at rest there is none of that force.
SPINNING = [
    (h, spin, 0.0, gamma, coriolis)
    for coriolis, gamma in ((False, 2.0), (False, 10.0), (True, 10.0))
    for h, spin in ((0.01, "e3"), (0.1, "e2"))
]


def spectral(case: tuple[float, str, float, float, bool]) -> np.ndarray:
    """Return the first five λ of a case from tests/reference, geometric stiffness of von Kármán."""
    *key, coriolis = case
    name = "plate_mindlin_coriolis.csv" if coriolis else f"plate_mindlin_h{case[0]:g}.csv"
    found: dict[int, float] = {}
    with reference_file(name).open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            here = [float(row["h/a"]), row["spin"], float(row["delta"]), float(row["gamma"])]
            if here == key and row.get("geo", "vk") == "vk":
                found[int(row["mode"])] = float(list(row.values())[-1] if coriolis else row["extrapolated"])
    with reference_file("plate_in_plane_stiffening.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            if coriolis and [float(row["h/a"]), row["spin"], float(row["delta"]), float(row["gamma"])] == key:
                found[int(row["mode"])] += float(row["added (n=9)"])
    return np.array([found[mode] for mode in range(1, 6)])


def spinning(case: tuple[float, str, float, float, bool], **changes: Any) -> np.ndarray:
    h, spin, delta, gamma, coriolis = case
    effects = ["centrifugal", "rotary_inertia"] + ["coriolis"] * coriolis
    axis = {"e3": [0, 0, 1], "e2": [0, 1, 0]}[spin]
    motion = {"type": "constant", "speed": gamma * unit(h), "axis": axis}
    scene = square(h, motion=motion, structure__hub_radius=delta, model__effects=effects, **changes)
    return transverse(scene) / unit(h)


@pytest.mark.parametrize("case", SPINNING, ids=str)
def test_spinning_square(case: tuple[float, str, float, float, bool]) -> None:
    """Spectral values of Mindlin's plate, tests/reference; default mesh, tolerance of the acceptance."""
    np.testing.assert_allclose(spinning(case)[:5], spectral(case), rtol=1e-3)


def test_spinning_square_converges() -> None:
    """Fast from 4×4 to 8×8 cells (theory: fourth order), then held by the singular corners of the clamp."""
    case = (0.1, "e3", 0.0, 10.0, True)
    wanted = spectral(case)
    errors = [np.max(np.abs(spinning(case, mesh__elements=[n, n])[:5] / wanted - 1)) for n in (4, 8, 16)]
    assert errors[0] / errors[1] > 8
    assert errors[2] < 7e-5


@pytest.mark.parametrize(
    ("cell", "degree", "integration"),
    [("quadrilateral", 1, "reduced"), ("triangle", 2, "reduced"), ("quadrilateral", 2, "full")],
)
def test_elements_that_lock_are_refused(cell: str, degree: int, integration: str) -> None:
    with pytest.raises(SceneError, match="lock"):
        square(0.01, mesh__cell=cell, mesh__degree=degree, mesh__integration=integration)


@pytest.mark.parametrize(
    ("mesh", "accuracy"), [({}, 1.5e-3), ({"degree": 3}, 2e-4), ({"cell": "triangle"}, 5e-4)], ids=["Q2", "Q3", "P3"]
)
def test_no_modes_that_reduced_integration_does_not_see(mesh: dict[str, Any], accuracy: float) -> None:
    """A wide cantilever 1 × 4 × 0.1 m: (1 − 3ξ²)(1 − 3η²) had 1527 rad/s. Reference: Legendre–Ritz, Mindlin, 1e-4.

    On the 4 × 16 cells of the default Q2 have 1.3e-3 of error in the sixth mode, Q3 and P3 1.1e-4 and 2.9e-4.
    """
    scene = square(
        0.1,
        structure__width=4.0,
        model__theory="consistent_linear",
        motion={"type": "constant", "speed": 0.0},
        modes__count=6,
        mesh=mesh,
    )
    frequencies = [row["frequency"] for row in rotfem.modes(scene).rows]
    np.testing.assert_allclose(frequencies, [535.0, 610.1, 824.4, 1169.9, 1668.4, 2335.7], rtol=accuracy)


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
def test_stretch_in_the_plane(theory: str) -> None:
    """A spinning square on a hub: u1 of the tip against Legendre–Ritz 7.38340e-4 (von Kármán linear, 6e-5)."""
    speed = 2.0 * unit(0.05)
    scene = square(
        0.05,
        structure__hub_radius=1.0,
        model__theory=theory,
        motion={"type": "constant", "speed": speed, "axis": [0, 0, 1]},
    )
    wanted = 7.38340e-4
    assert rotfem.run(scene).summary["figures"]["tip_u1_final"] == pytest.approx(wanted, rel=3e-3)


# --- strips are beams ------------------------------------------------------------------------------------------------

#: The spin-up beam of Kane, Ryan & Banerjee as a strip 1 m wide with ν = 0.
EA, GA, EI, MASS = 2.8e7, 1.0e7, 1.4e4, 1.2
DEPTH = float(np.sqrt(12 * EI / EA))


def strip(**changes: Any) -> Scene:
    """Return that beam as a plate that bends in the plane (1, 3), turning about −a_2."""
    structure = {"type": "plate", "length": 10.0, "width": 1.0, "thickness": DEPTH, "E": EA / DEPTH, "nu": 0.0}
    tables = {
        "structure": structure | {"rho": MASS / DEPTH, "shear_correction": 2 * GA / EA},
        "motion": {"type": "spin_up", "speed": 6.0, "duration": 15.0, "axis": [0, -1, 0]},
        "mesh": {"elements": [12, 1]},
    }
    return Scene.from_dict(tables).replace({key.replace("__", "."): value for key, value in changes.items()})


@pytest.mark.parametrize(
    ("theory", "history", "frequency"),
    [
        # Plate and beam have the same equations but for Green's strain against Reissner's. Frequencies: mesh.
        ("consistent_linear", 1e-5, 1e-3),
        ("second_order", 1e-5, 1e-3),
        ("reissner", 1e-4, 1e-3),
    ],
)
def test_strip_is_a_beam(spin_up: Any, theory: str, history: float, frequency: float) -> None:
    time = {"end": 7.0, "step": 0.02, "output_every": 5}
    beam = rotfem.run(spin_up({"model.theory": theory}, time=time)).history
    plate = rotfem.run(strip(model__theory=theory, time=time)).history
    scale = float(np.max(np.abs(beam["tip_u2"])))
    assert scale > 0.3
    np.testing.assert_allclose(plate["tip_u3"], beam["tip_u2"], rtol=0, atol=history * scale)
    np.testing.assert_allclose(plate["tip_alpha1"], beam["tip_alpha"], rtol=0, atol=3 * history * scale)
    for speed in (3.0, 12.0):
        turning = {"type": "constant", "speed": speed}
        rows = rotfem.modes(spin_up({"model.theory": theory}, motion=turning)).rows
        lag = [row["frequency"] for row in rows if row["label"].endswith("edgewise")]
        scene = strip(model__theory=theory, motion={**turning, "axis": [0, -1, 0]}, modes__count=8)
        bending = [row["frequency"] for row in rotfem.modes(scene).rows if row["label"].endswith("bending")]
        np.testing.assert_allclose(bending[:3], lag[:3], rtol=frequency)


def test_strip_with_line_mass_and_free_hub(spin_up: Any) -> None:
    """A mass along the end edge is the tip mass of the beam, and a free hub feels the strip as it feels the beam."""
    torque = {"type": "torque", "hub_inertia": 200.0, "pulses": [[0, 0.5, 50.0], [0.5, 1.0, -50.0]]}
    time = {"end": 1.5, "step": 0.01}
    beam = rotfem.run(spin_up({"structure.tip_mass": 3.0}, motion=torque, time=time)).history
    plate = rotfem.run(
        strip(structure__line_masses={"tip": 3.0}, motion={**torque, "axis": [0, -1, 0]}, time=time)
    ).history
    for name, other in (("tip_u3", "tip_u2"), ("psi_dot", "psi_dot")):
        scale = float(np.max(np.abs(beam[other])))
        np.testing.assert_allclose(plate[name], beam[other], rtol=0, atol=2e-4 * scale)


def test_tapered_strip(spin_up: Any) -> None:
    """Thickness 1.5 → 0.5 along the strip against the beam with EA ~ h, EI ~ h³: the same first three frequencies."""
    x = np.linspace(0, 10, 41)
    h = DEPTH * (1.5 - x / 10)
    section = {
        "EA": [[a, EA * b / DEPTH] for a, b in zip(x, h, strict=True)],
        "GA": [[a, GA * b / DEPTH] for a, b in zip(x, h, strict=True)],
        "EI": [[a, EI * (b / DEPTH) ** 3] for a, b in zip(x, h, strict=True)],
        "mass_per_length": [[a, MASS * b / DEPTH] for a, b in zip(x, h, strict=True)],
        "rotary_inertia": [[a, 6e-4 * (b / DEPTH) ** 3] for a, b in zip(x, h, strict=True)],
    }
    turning = {"type": "constant", "speed": 4.0}
    scene = spin_up({"structure.section": section, "model.theory": "von_karman_linear"}, motion=turning)
    lag = [row["frequency"] for row in rotfem.modes(scene).rows if row["label"].endswith("edgewise")]
    plate = strip(
        structure__thickness=[[0, 1.5 * DEPTH], [10, 0.5 * DEPTH]],
        model__theory="von_karman_linear",
        motion={**turning, "axis": [0, -1, 0]},
        modes__count=8,
    )
    bending = [row["frequency"] for row in rotfem.modes(plate).rows if row["label"].endswith("bending")]
    np.testing.assert_allclose(bending[:3], lag[:3], rtol=2e-3)  # EI is linear between 41 points, h³ is not


def test_isotropic_given_as_orthotropic() -> None:
    G = E / (2 * (1 + NU))
    tables = square(0.02, motion__speed=50.0).to_dict()
    tables["structure"] = {k: v for k, v in tables["structure"].items() if k not in ("E", "nu")}
    tables["structure"] |= {"E1": E, "E2": E, "nu12": NU, "G12": G}
    found = transverse(Scene.from_dict(tables))
    np.testing.assert_allclose(found, transverse(square(0.02, motion__speed=50.0)), rtol=1e-8)


def test_orthotropic_plate_is_an_isotropic_one_of_another_width() -> None:
    """Without Poisson's ratios and with G = √(E1 E2)/2 a thin plate is isotropic in y (E1/E2)^¼, its edges too.

    D1 w,xxxx + 2 √(D1 D2) w,xxyy + D2 w,yyyy is the isotropic plate's there, and so are M_y = D2 w,yy and
    V_y = D2 w,yyy + 2 √(D1 D2) w,xxy. Shear, which is not, is of the order (h/a)² times the square of the wave number.
    """
    h, soft = 1e-3, E / 10
    stretch = 10**0.25
    own = {"length": 1.0, "width": 1.0, "thickness": h, "rho": RHO, "E1": E, "E2": soft, "nu12": 0.0}
    own |= {"G12": np.sqrt(E * soft) / 2, "type": "plate"}
    base = {k: v for k, v in square(h).to_dict().items() if k in ("motion", "model", "modes")}
    found = transverse(Scene.from_dict(base | {"structure": own}))
    wider = {"type": "plate", "length": 1.0, "width": stretch, "thickness": h, "rho": RHO, "E": E, "nu": 0.0}
    wanted = transverse(Scene.from_dict(base | {"structure": wider}))
    np.testing.assert_allclose(found[:6], wanted[:6], rtol=1e-4)


def test_point_mass_beside_the_plate() -> None:
    with pytest.raises(SceneError, match="is not on the plate"):
        rotfem.modes(square(0.01, structure__point_masses=[[0.5, 0.7, 1.0]]))


# --- large deflection ------------------------------------------------------------------------------------------------


def cantilever(**changes: Any) -> Scene:
    """Return the strip of Sze, Liu & Lo (Finite Elem. Anal. Des. 40, 2004, section 3.1): 10 × 1 × 0.1."""
    tables = {
        "structure": {
            "type": "plate",
            "length": 10.0,
            "width": 1.0,
            "thickness": 0.1,
            "E": 1.2e6,
            "nu": 0.0,
            "rho": 1.0,
        },
        "motion": {"type": "constant", "speed": 0.0},
        "mesh": {"elements": [16, 1]},
    }
    return Scene.from_dict(tables).replace({key.replace("__", "."): value for key, value in changes.items()})


def test_end_shear() -> None:
    """Sze et al.: −U = 3.286, W = 6.698 at P = 4 (shells; 0.15 %), and the exact planar beam (strain², 1e-4)."""
    tip = rotfem.run(cantilever(loads__tip_force=[0, 0, 4.0])).history
    assert -tip["tip_u1"][-1] == pytest.approx(3.286, rel=1.5e-3)
    assert tip["tip_u3"][-1] == pytest.approx(6.698, rel=1.5e-3)
    section = {"EA": 1.2e5, "GA": 5e4, "EI": 100.0, "mass_per_length": 0.1}
    tables = {
        "structure": {"type": "planar_beam", "length": 10.0, "section": section},
        "motion": {"type": "constant", "speed": 0.0},
        "loads": {"tip_force": [0.0, 4.0]},
    }
    beam = rotfem.run(tables).history
    assert tip["tip_u1"][-1] == pytest.approx(beam["tip_u1"][-1], rel=1e-4)
    assert tip["tip_u3"][-1] == pytest.approx(beam["tip_u2"][-1], rel=1e-4)


@pytest.mark.parametrize(
    ("theory", "kind"), [("consistent_linear", "dead"), ("reissner", "dead"), ("reissner", "follower")]
)
def test_couple_in_the_plane(theory: str, kind: str) -> None:
    """A strip bent in its plane by a moment at its tip: u2 = M L²/2EI in first order.

    Strains of first order have this solution exactly, and so have their elements. The tip turns by θ = M L/EI = 0.01,
    and what is of higher order is θ²/2 = 5e-5 of an exact theory, whose couple has a shorter arm, and less of a linear
    one under its prestress.
    """
    moment, EI = 10.0, 1.2e6 * 0.1 * 1.0**3 / 12
    scene = cantilever(
        loads__tip_moment={"value": [0, 0, moment], "kind": kind}, model__theory=theory, mesh__elements=[16, 2]
    )
    figures = rotfem.run(scene).summary["figures"]
    accuracy = {"consistent_linear": 1e-5, "reissner": 6e-5}[theory]
    assert figures["tip_u2_final"] == pytest.approx(moment * 10.0**2 / (2 * EI), rel=accuracy)
    assert abs(figures["tip_u3_final"]) < 1e-9


# --- theorems --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
def test_jacobi_integral(theory: str) -> None:
    """Constant spin about a skew axis, ρ∞ = 1: T2 − T0 + W is kept to the error of the steps, which falls with h²."""
    drift = []
    for step in (2e-3, 1e-3):
        scene = square(
            0.02,
            model__theory=theory,
            motion={"type": "constant", "speed": 20.0, "axis": [0.2, 0.5, 1.0]},
            mesh__elements=[3, 2],
            loads__tip_force={"value": [0, 0, 200.0]},
            initial={"state": "undeformed"},
            time={"end": 0.2, "step": step, "spectral_radius": 1.0},
        )
        h = rotfem.run(scene).history
        drift.append(np.max(np.abs(h["jacobi"] - h["jacobi"][0])) / np.max(h["strain"]))
    if theory == "consistent_linear":  # its energy is quadratic: the trapezoidal rule keeps it to round-off
        assert max(drift) < 1e-10
        return
    assert drift[1] < 1e-4
    assert drift[0] / drift[1] == pytest.approx(4.0, rel=0.1)  # the next term is of relative size h, not yet nothing


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
def test_symmetries_and_tangents(theory: str) -> None:
    """M and K symmetric, C skew about the steady state, tangents against differences of the residual."""
    motion = {"type": "constant", "speed": 40.0, "axis": [0.3, -0.4, 1.0]}
    scene = square(
        0.02, model__theory=theory, motion=motion, mesh__elements=[3, 3], structure__hub_offset=[0.5, 0.1, 0.2]
    )
    result = rotfem.modes(scene)
    checks = result.summary["checks"]
    assert max(checks[f"asymmetry_{name}"] for name in "MCK") < 1e-12
    system, q = result.analysis.system, result.spinning.q
    direction = np.random.default_rng(1).standard_normal(q.size) * system.scale
    direction[system.clamped] = 0.0
    forces = []
    for step in (1e-6, -1e-6):
        system.set_state(q + step * direction)
        forces.append(-np.array(system.residual().array))
    product = result.spinning.pencil.apply(result.spinning.pencil.K, direction.astype(complex)).real
    product[system.clamped] = 0.0
    assert np.linalg.norm((forces[0] - forces[1]) / 2e-6 - product) < 1e-6 * np.linalg.norm(product)


def test_a_factor_kept_over_steps_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps with an old factor against steps with their own: the same history to the tolerance, spin-up and after.

    60 steps that are left off by 1e-12 of the length are off by 6e-9 of the displacement if all add up.
    """
    import rotfem.equations.system

    scene = square(
        0.05,
        model__theory="reissner",
        mesh__elements=[4, 4],
        motion={"type": "spin_up", "speed": 30.0, "duration": 0.04, "axis": [0, 1, 0]},
        time={"end": 0.06, "step": 1e-3},
        solver__increment_tolerance=1e-12,
    )
    kept = rotfem.run(scene)
    never = property(lambda _: False, lambda *_: None)
    monkeypatch.setattr(rotfem.equations.system.System, "keeps_factor", never, raising=False)
    own = rotfem.run(scene)
    scale = np.max(np.abs(own.history["tip_u3"]))
    np.testing.assert_allclose(kept.history["tip_u3"], own.history["tip_u3"], rtol=0, atol=3e-9 * scale)
    assert kept.summary["factorisations"] < 0.6 * own.summary["factorisations"]


def test_reduced_basis(monkeypatch: pytest.MonkeyPatch) -> None:
    """A Campbell diagram in a basis of modes against full solutions at every speed."""
    scene = square(
        0.05, motion={"type": "constant", "speed": 0.0, "axis": [0, 1, 0]}, mesh__elements=[5, 5], modes__count=5
    )
    speeds = list(np.linspace(0, 8 * unit(0.05), 6))
    quick = rotfem.campbell(scene, speeds)
    monkeypatch.setattr("rotfem.analysis.reduced_basis.MANY", len(speeds) + 1)
    full = rotfem.campbell(scene, speeds)
    assert quick.summary["reduced_basis"]["checks"][-1]["difference"] < 1e-6
    wanted = {(row["branch"], row["speed"]): row["frequency"] for row in full.rows if not row["refined"]}
    found = {(row["branch"], row["speed"]): row["frequency"] for row in quick.rows if not row["refined"]}
    assert list(found) == list(wanted)
    np.testing.assert_allclose(list(found.values()), list(wanted.values()), rtol=1e-6)
    assert max(row["residual"] for row in quick.rows) < 1e-6


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
def test_modes_in_the_plane_are_those_of_the_beam(theory: str) -> None:
    """A strip that spins about its normal three times as fast as it flaps first: the planar beam of its section.

    Stretched by 6e-4, it differs from the beam by less than that, and by 1.5e-4 at rest, where sections of the linear
    plates stay as straight as bilinear shear lets them. Without N⁰ on in-plane gradients it was 138 and not 233 rad/s.
    """
    material = {"E": 7e10, "nu": 0.0, "rho": 2700.0, "shear_correction": 5 / 6}
    both = {"length": 1.0, "hub_radius": 0.2}
    plate = {"type": "plate", "width": 0.04, "thickness": 0.01, **material}
    beam = {"type": "planar_beam", "section": {**material, "shape": "rectangle", "width": 0.01, "height": 0.04}}
    rows = []
    for structure, elements in ((plate, [16, 2]), (beam, 10)):
        tables = {"structure": structure | both, "mesh": {"elements": elements}, "modes": {"count": 6}}
        tables |= {"motion": {"type": "constant", "speed": 154.0}, "model": {"theory": theory}}
        rows.append(rotfem.modes(tables).rows)
    first = [next(r["frequency"] for r in found if r["label"] in ("1st in-plane", "1st edgewise")) for found in rows]
    assert first[1] == pytest.approx(233.0, abs=0.1)
    assert first[0] == pytest.approx(first[1], rel=1e-3)


def test_tip_is_the_middle_of_its_edge(tmp_path: Path) -> None:
    """No node need lie there: by symmetry the middle of a plate stretched by spin does not move across.

    The middle of an edge of a file is that of its length, wherever its nodes are: a linear field is read exactly.
    """
    three = {"mesh.elements": [6, 3], "mesh.degree": 3}
    spun = square(0.01).replace({"motion.speed": 100.0, "motion.axis": [0.0, 0.0, 1.0], **three})
    tip = {name: float(values[-1]) for name, values in rotfem.run(spun).tip.items()}
    assert tip["u1"] > 1e-6
    assert abs(tip["u2"]) < 1e-9 * tip["u1"]
    points, groups = grid(3, 3)
    points[:, 1] += 0.2 * (0.25 - points[:, 1] ** 2)  # edges of other lengths
    file = write_msh(tmp_path / "plate.msh", points, groups)
    scene = square(0.01).replace({"structure.length": None, "structure.width": None, "structure.mesh": str(file)})
    for degree in (2, 3):
        structure = rotfem.modes(scene.replace({"mesh.degree": degree})).analysis.structure
        linear = structure.V.tabulate_dof_coordinates() @ np.array([1.0, 3.0, 0.0])
        read = structure.tip_values(np.repeat(linear, structure.size))
        assert read == pytest.approx(np.ones(structure.size), abs=1e-12)


# --- a disk ----------------------------------------------------------------------------------------------------------


def disk_mesh(path: Path, inner: float, outer: float, around: int, across: int) -> Path:
    """Write an annulus of quadrilaterals clamped at its inner edge."""
    r = np.linspace(inner, outer, across + 1)
    angle = 2 * np.pi * np.arange(around) / around
    points = np.array([[a * np.cos(p), a * np.sin(p)] for a in r for p in angle])

    def node(i: int, j: int) -> int:
        return i * around + j % around

    cells = [
        [node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)] for i in range(across) for j in range(around)
    ]
    edge = [[node(0, j), node(0, j + 1)] for j in range(around)]
    return write_msh(path, points, {"plate": cells, "clamped": edge})


#: (k·outer)² of the first mode with 0 to 3 diameters, clamped at a third of the radius, free outside: the zero of the
#: determinant of the four Bessel functions of Kirchhoff's plate (Leissa 1969).
ANNULUS = (7.3235205, 7.2877849, 8.6574635, 13.6910371)


def test_annular_disk(tmp_path: Path) -> None:
    """Frequencies of 0 to 3 nodal diameters against Bessel functions, pairs, and their names.

    Straight edges put the radii off by 1/n², n cells around: 1.5 % and 0.33 % of the frequencies, and extrapolated from
    both less than 1e-3.
    """
    h, inner, outer = 1e-3, 0.1, 0.3
    found: list[dict[str, list[float]]] = []
    for around, across in ((24, 3), (48, 6)):
        mesh = disk_mesh(tmp_path / f"disk{around}.msh", inner, outer, around, across)
        scene = square(h, structure__length=None, structure__width=None, structure__mesh=str(mesh), modes__count=7)
        found.append(defaultdict(list))
        for row in rotfem.modes(scene).rows:
            found[-1][row["label"].split(",")[0]].append(row["frequency"] / unit(h) * outer**2)
    coarse, fine = found
    for m in range(4):
        name = f"{m} nodal diameter{'s' * (m != 1)}"
        pair = np.array(fine[name])
        assert len(pair) == (1 if m == 0 else 2)
        extrapolated = pair + (pair - np.array(coarse[name])) / 3
        np.testing.assert_allclose(extrapolated, ANNULUS[m], rtol=1e-3)
        assert max(pair) / min(pair) - 1 < 1e-6


def test_travelling_waves(tmp_path: Path) -> None:
    """A thick disk: the modes of a pair travel with and against the spin, the one against it at the higher frequency.

    Reference: Mindlin–Ritz in e^{imθ}, frequencies in the disk at 6000 rad/s, 1e-5; here a coarser mesh, 1e-3.
    """
    mesh = disk_mesh(tmp_path / "disk.msh", 0.05, 0.2, 32, 6)
    structure = {"type": "plate", "mesh": str(mesh), "thickness": 0.04, "E": 70e9, "nu": 0.3, "rho": 2700.0}
    scene = Scene.from_dict(
        {
            "structure": structure,
            "motion": {"type": "constant", "speed": 6000.0},
            "model": {"theory": "consistent_linear"},
            "modes": {"count": 7},
        }
    )
    result = rotfem.campbell(scene, [5900.0, 6000.0], orders=0)
    branches = result.branches()
    for m, (low, high) in {1: (10070.0, 10275.0), 2: (12829.0, 13253.0)}.items():
        name = ("", "1 nodal diameter", "2 nodal diameters")[m]
        a, b = branches[f"{name}, forward"], branches[f"{name}, backward"]
        assert sorted([a["frequency"][-1], b["frequency"][-1]]) == pytest.approx([low, high], rel=1e-3)
        assert sorted([a["turning"][-1], b["turning"][-1]]) == pytest.approx([-1.0, 1.0], abs=1e-3)
        # The Coriolis force on the directors couples the angles against the spin: ω₋ > ω₊.
        assert a["frequency_fixed"][-1] == pytest.approx(low + m * 6000.0, rel=1e-3)
        assert b["frequency_fixed"][-1] == pytest.approx(abs(high - m * 6000.0), abs=1e-3 * high)


def free_mesh(path: Path, size: float, hole: float = 0.0, offset: float = 0.0) -> Path:
    """Write a saw of 300 mm of free triangles, clamped in its hole of 60 mm, with six holes in it or none."""
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Verbosity", 1)
        shapes = gmsh.model.occ
        at = [0.095 * np.exp(1j * k * np.pi / 3) for k in range(6)] if hole else []
        cut = [
            (2, shapes.addDisk(offset, 0, 0, 0.03, 0.03)),
            *((2, shapes.addDisk(z.real, z.imag, 0, hole, hole)) for z in at),
        ]
        shapes.cut([(2, shapes.addDisk(0, 0, 0, 0.15, 0.15))], cut)
        shapes.synchronize()
        curves = [tag for _, tag in gmsh.model.getEntities(1)]
        inner = [tag for tag in curves if np.max(np.abs(gmsh.model.getBoundingBox(1, tag))) < 0.031 + offset]
        gmsh.model.addPhysicalGroup(1, inner, name="clamped")
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in gmsh.model.getEntities(2)], name="plate")
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.option.setNumber("Mesh.ElementOrder", 2)
        gmsh.model.mesh.generate(2)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    return path


def saw(mesh: Path, **changes: Any) -> dict[str, Any]:
    """Return a saw of steel, 2 mm thick."""
    structure = {"type": "plate", "mesh": str(mesh), "thickness": 0.002, "E": 210e9, "nu": 0.3, "rho": 7850.0}
    return {"structure": structure, "motion": {"type": "constant", "speed": 1.0}, "modes": {"count": 5}} | changes


def test_a_disk_is_one_on_any_mesh(tmp_path: Path) -> None:
    """Synchronous critical speed of a plain annulus on meshes of rings, 6570.5 rpm: 2e-3; names, with holes too."""
    diagram = rotfem.campbell(saw(free_mesh(tmp_path / "a.msh", 0.03)), "6000:7000:2rpm", orders=0)
    (found,) = diagram.critical_speeds
    assert (found.kind, found.label) == ("backward", "2 nodal diameters, backward")
    np.testing.assert_allclose(found.speed, 6570.5 * np.pi / 30, rtol=2e-3)
    labels = rotfem.modes(saw(free_mesh(tmp_path / "b.msh", 0.03, 0.01))).labels
    assert [text.partition(" nodal")[0] for text in labels] == ["1", "1", "0", "2", "2"]


def test_a_plate_that_is_nearly_a_disk_is_said(tmp_path: Path) -> None:
    found = rotfem.modes(saw(free_mesh(tmp_path / "a.msh", 0.03, offset=0.01)))
    assert any("nearly a disk" in text for text in found.warnings)
    assert not any("diameter" in label for label in found.labels)


@pytest.mark.estimated
def test_chords_of_a_curve_are_an_error_of_their_own(tmp_path: Path) -> None:
    """A ring of 80 to 250 mm: n straight edges around put the radii, and frequencies, off as 1/n².

    The error is estimated within a half and eight times; the right frequency is extrapolated from 32 and 64.
    """
    found, estimated = [], []
    for around in (16, 32, 64):
        mesh = disk_mesh(tmp_path / f"{around}.msh", 0.08, 0.25, around, 3)
        structure = {"type": "plate", "mesh": str(mesh), "thickness": 3e-3, "E": 2.05e11, "nu": 0.29, "rho": 7800.0}
        result = rotfem.modes(
            {"structure": structure, "motion": {"type": "constant", "speed": 0.0}, "modes": {"count": 3}}
        )
        found.append(result.frequencies[0])
        estimated.append(result.summary["error"]["geometry"])
    right = found[2] + (found[2] - found[1]) / 3
    for frequency, error in zip(found[:2], estimated[:2], strict=True):
        assert abs(frequency / right - 1) / 2 < error < 8 * abs(frequency / right - 1)
    assert estimated[0] / estimated[1] == pytest.approx(4.0, rel=0.05)


# --- films: tension outweighs the bending stiffness of a cell ---------------------------------------------------------

FILM = {"type": "plate", "E": 4e9, "nu": 0.3, "rho": 1400.0}


@pytest.mark.parametrize("theory", ["consistent_linear", "von_karman_linear", "reissner"])
def test_spinning_annulus(theory: str, tmp_path: Path) -> None:
    """A film of 0.2 to 1 m, 1 mm thick, at 100 rad/s: a Ritz code's frequencies of 0 to 3 diameters."""
    mesh = disk_mesh(tmp_path / "film.msh", 0.2, 1.0, 40, 4)
    structure = {**FILM, "mesh": str(mesh), "thickness": 1e-3}
    motion = {"type": "constant", "speed": 100.0}
    tables = {"structure": structure, "motion": motion, "model": {"theory": theory}, "modes": {"count": 6}}
    found = rotfem.modes(tables)
    assert found.stable
    assert not found.warnings
    np.testing.assert_allclose(found.frequencies[[0, 1, 3, 5]], [86.396, 108.056, 150.999, 196.177], rtol=5e-3)


@pytest.mark.parametrize("theory", ["linear", "consistent_linear"])
def test_critical_speed_of_a_film(theory: str, tmp_path: Path) -> None:
    """Below it no eigenvalue of the stiffness is negative, above it one is.

    Without what stiffens it is the least frequency in the plane, a turn of the rim: shear waves, J1 and Y1 of k r with
    u = 0 at 0.2 m and u' = u/r at 1 m, k = 0.59563/m.
    """
    mesh = disk_mesh(tmp_path / "film.msh", 0.2, 1.0, 24, 4)
    tables = {"structure": {**FILM, "mesh": str(mesh), "thickness": 1e-3}, "model": {"theory": theory}}
    motion = {"type": "constant", "speed": 100.0}
    found = rotfem.run({**tables, "motion": motion, "output": {"error": False}}).summary
    assert found["stability"]["stable"]
    critical = found["figures"]["critical_speed"]
    if theory == "linear":
        assert critical == pytest.approx(0.595631 * np.sqrt(4e9 / 2.6 / 1400.0), rel=1e-2)  # straight edges
    K, spun = ModalAnalysis(Problem.of(Scene.from_dict({**tables, "motion": motion}))).system.stiffness_pieces()
    for square, negative in ((0.999 * critical**2, False), (0.002 * critical**2, True)):
        K.axpy(square, spun)
        assert (negative_eigenvalues(K) > 0) == negative


@pytest.mark.parametrize(("theory", "thickness"), [("consistent_linear", 1e-3), ("consistent_linear", 1e-5)])
def test_heliogyro(theory: str, thickness: float) -> None:
    """A blade of film: bending has Ω √(n(2n − 1)), as a chain has, torsion Ω √(n(2n − 1) + 1) (MacNeal 1967)."""
    structure = {**FILM, "length": 10.0, "width": 1.0, "thickness": thickness}
    motion = {"type": "constant", "speed": 10.0, "axis": [0, 0, 1]}
    tables = {"structure": structure, "motion": motion, "model": {"theory": theory}, "modes": {"count": 6}}
    found = rotfem.modes(tables)
    assert found.stable
    assert not any("unstable" in warning for warning in found.warnings)
    rows = {row["label"]: row["frequency"] / 10.0 for row in found.rows}
    for family, more in (("bending", 0), ("torsion", 1)):
        both = [rows[f"1st {family}"], rows[f"2nd {family}"]]
        np.testing.assert_allclose(both, np.sqrt([1 + more, 6 + more]), rtol=2e-3)


@pytest.mark.parametrize("cells", [8, 16])
def test_a_mesh_does_not_make_an_instability(cells: int) -> None:
    """In a thin blade on cells longer than its width the compression across it at the clamp is too long and buckles.

    On cells as short as the zone in which that dies away, 0.1 m, nothing grows; bending is at Ω, torsion at Ω √2.
    """
    structure = {**FILM, "length": 10.0, "width": 0.2, "thickness": 1e-4}
    tables = {"structure": structure, "motion": {"type": "constant", "speed": 10.0}, "output": {"error": False}}
    tables |= {"mesh": {"elements": [cells, max(1, cells // 8)]}, "model": {"theory": "consistent_linear"}}
    found = rotfem.modes({**tables, "modes": {"count": 3}})
    assert found.summary["stability"]["stable"] is None
    assert any("unresolved equilibrium" in warning for warning in found.warnings)
    rows = {row["label"].split(" ")[1]: row["frequency"] / 10.0 for row in found.rows}
    assert rows["bending"] == pytest.approx(1.0, rel=1e-3)
    assert rows["torsion"] == pytest.approx(np.sqrt(2.0), rel=0.06)


@pytest.mark.parametrize(("cells", "shown"), [(8, False), (64, True)])
def test_fibres_that_nothing_joins(cells: int, shown: bool) -> None:
    """Strips along fibres bend in the plane, ρ ω² = √(E_1 E_2) (1.8751/L)²: they are there, or said to be missing."""
    moduli = {"E1": 1.2e7, "E2": 0.12, "nu12": 0.0, "G12": 1.2e7, "rho": 100.0}
    structure = {"type": "plate", "length": 1.0, "width": 1.0, "thickness": 0.01, **moduli}
    tables = {"structure": structure, "motion": {"type": "constant", "speed": 0.0}, "modes": {"count": 3}}
    found = rotfem.modes({**tables, "mesh": {"elements": [8, cells]}, "output": {"error": False}})
    assert ("in-plane" in found.labels[1]) == shown
    assert any("from about 6.5 rad/s" in warning for warning in found.warnings) != shown
    if shown:
        assert found.frequencies[1] == pytest.approx(1.8751 * np.sqrt(12.0), rel=2e-2)
