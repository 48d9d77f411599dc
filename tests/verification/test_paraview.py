"""What is written for ParaView is what was computed: read by pyvista, with the reader that ParaView has."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rotfem
from rotfem.results.surfaces import FRAMES, animate
from tests.beams import SPIN_UP, STRUCTURE

pyvista = pytest.importorskip("pyvista")


def last(path: Path) -> tuple[Any, list[float]]:
    """Return the mesh of the last time in an XDMF file, and all times."""
    reader = pyvista.get_reader(str(path))
    times = [float(t) for t in reader.time_values]
    reader.set_active_time_value(times[-1])
    return reader.read(), times


def test_a_beam_that_moves(tmp_path: Path) -> None:
    scene = {
        **SPIN_UP,
        "structure": {**STRUCTURE, "hub_radius": 0.5},
        "time": {"end": 0.5, "step": 0.02},
        "output": {"fields": ["xdmf"], "error": False},
    }
    rotfem.run(scene, folder=tmp_path)
    result = rotfem.run(scene)
    whole, times = last(tmp_path / "fields.xdmf")
    np.testing.assert_allclose(times, result.t, rtol=1e-12)
    points, moves = (np.reshape(part, (-1, 4, 3)) for part in (whole.points, whole["displacement"]))
    np.testing.assert_allclose(points.mean(axis=1)[:, 0], 0.5 + result.shape["x"], rtol=1e-6)  # points are floats
    expected = np.column_stack([result.shape["u1"], result.shape["u2"]])
    np.testing.assert_allclose(moves.mean(axis=1)[:, :2], expected, atol=1e-12)
    arms, angle = points - points.mean(axis=1, keepdims=True), result.shape["alpha"]
    turned = np.cos(angle)[:, None] * arms[..., 0] - np.sin(angle)[:, None] * arms[..., 1]
    np.testing.assert_allclose((arms + moves)[..., 0] - expected[:, :1], turned, atol=1e-6)
    rotfem.run({**scene, "output": {"fields": [], "error": False}}, folder=tmp_path)
    assert not list(tmp_path.glob("*.xdmf"))


def test_a_line_in_space_is_where_it_is(tmp_path: Path) -> None:
    """A beam with precone, swept by a constant angle: the tip is at root + L (cos χ e₁ + sin χ e₂)."""
    cone, sweep = 0.2, 0.3
    section = {"shape": "rectangle", "width": 0.05, "height": 0.02, "E": 7e10, "nu": 0.3, "rho": 2700.0}
    beam = {"type": "spatial_beam", "length": 2.0, "hub_offset": [0.3, 0.1, -0.2], "precone": cone, "sweep": sweep}
    still = {"motion": {"type": "constant", "speed": 0.0}, "model": {"theory": "linear"}, "mesh": {"elements": 2}}
    rotfem.run({"structure": {**beam, "section": section}, **still}, folder=tmp_path)
    mesh, _ = last(tmp_path / "fields.xdmf")
    e_1, e_2 = np.array([np.cos(cone), 0.0, np.sin(cone)]), np.array([0.0, 1.0, 0.0])
    tip = [0.3, 0.1, -0.2] + 2.0 * (np.cos(sweep) * e_1 + np.sin(sweep) * e_2)
    np.testing.assert_allclose(mesh.points[-4:].mean(axis=0), tip, rtol=1e-6)


BLADE = {
    "structure": {
        **{"type": "spatial_beam", "length": 2.0, "pretwist": [[0.0, 0.0], [2.0, 0.5]]},
        "section": {"shape": "rectangle", "width": 0.2, "height": 0.02, "E": 7e10, "nu": 0.3, "rho": 2700.0},
    },
    "motion": {"type": "constant", "speed": 6.0, "axis": [0, 0, 1]},
    "model": {"theory": "consistent_linear"},
    "mesh": {"elements": 4},
    "modes": {"count": 5},
    "output": {"error": False, "speed": "rpm", "frequency": "Hz"},
}


def test_modes_of_a_beam_have_width_and_turn(tmp_path: Path) -> None:
    """√3 of the radii of gyration of a rectangle are its own half width and height: the surface is the blade itself.

    In torsion, the fourth mode here, the corners of the tip move by θ₁ times their distance, about the axis.
    """
    result = rotfem.modes(BLADE)
    assert result.fields is not None
    result.fields(tmp_path)
    mesh, times = last(tmp_path / "modes.xdmf")
    assert times == [1.0, 2.0, 3.0, 4.0, 5.0]
    tip = mesh.points[-4:] - [2.0, 0.0, 0.0]
    np.testing.assert_allclose(np.linalg.norm(tip, axis=1), np.hypot(0.1, 0.01), rtol=1e-6)
    axis = np.array([0.0, np.cos(0.5), np.sin(0.5)])  # of the width, at the tip
    np.testing.assert_allclose(np.abs(tip @ axis), 0.1, rtol=1e-6)
    (torsion,) = [i for i, label in enumerate(result.labels) if label == "1st torsion"]
    reader = pyvista.get_reader(str(tmp_path / "modes.xdmf"))
    reader.set_active_time_value(times[torsion])
    moved = reader.read()["displacement"][-4:]
    columns = list(result.shapes.values())[torsion]
    rigid = [columns[f"u{i}"][-1] for i in (1, 2, 3)]
    turn = [columns[f"theta{i}"][-1] / 2.0 for i in (1, 2, 3)]
    np.testing.assert_allclose(moved, rigid + np.cross(turn, tip), atol=1e-6 * np.max(np.abs(moved)))
    assert np.ptp(moved @ np.cross([1.0, 0.0, 0.0], axis)) > 0.1 * abs(turn[0]), "both edges move apart"


def test_a_mode_of_a_beam_is_animated(tmp_path: Path) -> None:
    from PIL import Image

    result = rotfem.modes(BLADE)
    paths = animate(result, 2, tmp_path)
    assert [path.name for path in paths] == ["mode_2.png", "mode_2.gif"]
    with Image.open(paths[1]) as gif:
        assert getattr(gif, "n_frames", 1) == FRAMES
        first = np.asarray(gif.convert("L"), dtype=float)
        gif.seek(FRAMES // 2)
        assert np.mean(np.abs(np.asarray(gif.convert("L"), dtype=float) - first) > 20.0) > 0.01, "it moves"
    with pytest.raises(rotfem.SceneError, match="must be a mode from 1 to 5"):
        animate(result, 6, tmp_path)


def test_plates_write_xdmf_too(tmp_path: Path) -> None:
    plate = {"type": "plate", "length": 1.0, "width": 0.4, "thickness": 0.01, "E": 7e10, "nu": 0.3, "rho": 2700.0}
    scene = {"structure": plate, "motion": {"type": "constant", "speed": 5.0}, "mesh": {"elements": [4, 2]}}
    scene |= {"model": {"theory": "consistent_linear"}, "modes": {"count": 2}, "output": {"error": False}}
    result = rotfem.modes(scene)
    assert result.fields is not None
    result.fields(tmp_path)
    mesh, times = last(tmp_path / "modes.xdmf")
    columns = list(result.shapes.values())[-1]
    assert times == [1.0, 2.0]
    np.testing.assert_allclose(mesh.points[:, 1], columns["y"], atol=1e-7)
    np.testing.assert_allclose(mesh["displacement"][:, 2], columns["u3"], atol=1e-7)
