"""Pictures and animations of modes in space, by PyVista."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rotfem.errors import OutputError, SceneError
from rotfem.results.files import writing
from rotfem.results.surfaces import Surface
from rotfem.results.units import ShownUnits

if TYPE_CHECKING:
    from rotfem.results.modes import ModesResult

Array = npt.NDArray[Any]

#: Largest displacement in a picture, part of the structure's size; frames of an animation and their number a second.
WARP, FRAMES, RATE = 0.15, 24, 24


def animate(result: ModesResult, mode: int, folder: Path) -> list[Path]:
    """Write mode_N.png and mode_N.gif: a mode at its largest and through one period, in space; return their paths.

    Mode 1 is the first that is none of a rigid body.

    Raises:
        SceneError: there is no such mode.
        OutputError: PyVista is not installed, or a file cannot be written.
    """
    surface, there = result.surface, len(result.shapes)
    if surface is None or not 1 <= mode <= there:
        raise SceneError("command line", "--animate", mode, f"must be a mode from 1 to {there}")
    try:
        import pyvista  # noqa: F401
        from PIL import Image
    except ImportError:
        raise OutputError(folder / f"mode_{mode}.gif", "PyVista is not installed (pip install rotfem[plots])") from None
    (row, shape, frequency), units = result.with_shapes()[mode - 1], ShownUnits.of(result.summary)
    moving = Moving(surface, shape)
    paths = [folder / f"mode_{mode}.png", folder / f"mode_{mode}.gif"]
    speed = f"{units.speeds(result.speed):.5g} {units.speed}"
    plotter = moving.plotter(f"mode {row['mode']}: {row['name']}, {frequency} at {speed}")
    with closing(plotter), writing(paths[1]):
        plotter.screenshot(str(paths[0]))
        frames = []
        for turn in np.linspace(0.0, 2 * np.pi, FRAMES, endpoint=False):
            moving.show(turn)
            plotter.render()
            frames.append(Image.fromarray(plotter.screenshot(return_img=True)).quantize(64))
        frames[0].save(paths[1], save_all=True, append_images=frames[1:], duration=1000 // RATE, loop=0)
    return paths


class Moving:
    """A surface in a mode, moved by `WARP` of its own size and coloured by its leading displacement."""

    def __init__(self, surface: Surface, shape: Mapping[str, Array]):
        import pyvista

        faces = np.column_stack([np.full(len(surface.triangles), 3), surface.triangles]).ravel()
        self._rest, self._z = pyvista.PolyData(surface.points, faces), surface.moved(shape)
        self.mesh = self._rest.copy()
        self._size = float(np.max(np.ptp(surface.points, axis=0)))
        self._scale = WARP * self._size / float(np.max(np.linalg.norm(np.abs(self._z), axis=1)))
        self._leading = int(np.argmax(np.max(np.abs(self._z), axis=0)))
        self._name, self._peak = f"u{self._leading + 1}", float(np.max(np.abs(self._z[:, self._leading])))
        self.show(0.0)

    def show(self, turn: float) -> None:
        """Move and colour the surface as it is at a phase of the period, rad."""
        now = np.real(self._z * np.exp(1j * turn))
        self.mesh.points = self._rest.points + self._scale * now
        self.mesh[self._name] = now[:, self._leading]

    def plotter(self, title: str) -> Any:
        """Return a PyVista plotter with the surface, its place at rest, the axes and a colour bar."""
        import pyvista

        bar = {"title": f"{self._name} (–)", "n_labels": 2, "title_font_size": 14}
        bar |= {"label_font_size": 14, "position_x": 0.3, "width": 0.4, "height": 0.06}
        plotter = pyvista.Plotter(off_screen=True, window_size=(900, 600))
        plotter.add_mesh(self._rest.extract_feature_edges(30.0), color="gray", line_width=1)
        limits = -self._peak, self._peak
        plotter.add_mesh(self.mesh, scalars=self._name, cmap="RdBu_r", clim=limits, scalar_bar_args=bar)
        plotter.add_text(title, font_size=11, position="upper_edge")
        plotter.add_axes(xlabel="1", ylabel="2", zlabel="3")
        centre = np.array(self._rest.center)
        plotter.camera_position = [centre + self._size * np.array([0.7, -1.6, 1.0]), centre, (0, 0, 1)]
        plotter.reset_camera(bounds=np.array(self._rest.bounds) + WARP * self._size * np.array([-1, 1] * 3))
        plotter.camera.zoom(1.8)
        return plotter
