"""What is written for ParaView is what was computed: read by pyvista, with the reader that ParaView has."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rotfem
from tests.beams import SPIN_UP, STRUCTURE

pyvista = pytest.importorskip("pyvista")


def last(path: Path) -> tuple[Any, list[float]]:
    """Return the mesh of the last time in an XDMF file, and all times."""
    reader = pyvista.get_reader(str(path))
    times = [float(t) for t in reader.time_values]
    reader.set_active_time_value(times[-1])
    return reader.read(), times


def test_a_beam_and_its_section_forces(tmp_path: Path) -> None:
    scene = {
        **SPIN_UP,
        "structure": {**STRUCTURE, "hub_radius": 0.5},
        "time": {"end": 0.5, "step": 0.02},
        "output": {"stations": 5, "fields": ["xdmf", "vtx"], "error": False},
    }
    rotfem.run(scene, folder=tmp_path)
    assert (tmp_path / "fields.bp").exists()
    result = rotfem.run(scene)
    whole, times = last(tmp_path / "fields.xdmf")
    np.testing.assert_allclose(times, result.t, rtol=1e-12)
    np.testing.assert_allclose(whole.points[:, 0], 0.5 + result.shape["x"], rtol=1e-6)  # ParaView's points are floats
    np.testing.assert_allclose(whole["displacement"][:, :2], np.column_stack([result.shape["u1"], result.shape["u2"]]))
    line, _ = last(tmp_path / "stations_line.xdmf")
    assert result.stations is not None
    np.testing.assert_allclose(line["M"], result.stations["M"][-1])
    np.testing.assert_allclose(line["displacement"][-1, 1], result.history["tip_u2"][-1])


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
    np.testing.assert_allclose(mesh.points[-1], tip, rtol=1e-6)


def test_formats_that_are_none_are_refused() -> None:
    with pytest.raises(rotfem.SceneError, match="output.fields"):
        rotfem.Scene.from_dict({**SPIN_UP, "output": {"fields": ["stl"]}})
