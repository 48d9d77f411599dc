"""Surfaces of structures, which modes and histories move, and animations of modes by PyVista.

A surface is the mid-surface of a plate, or a beam as wide and as thick as its sections.

A point of a section follows its centre and turns with it: u + θ × r in a mode, r from the centre to the point, and
u + exp(θ) r − r in a history.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.errors import OutputError, SceneError
from rotfem.results.columns import ShownUnits
from rotfem.results.files import writing

Array = npt.NDArray[Any]

#: A section is drawn as the rectangle of its radii of gyration: half its width is √3 of one.
HALF_WIDTH = np.sqrt(3.0)

#: Least half width of the broader side of a section, part of the length, so that one sees it turn.
LEAST = 0.012

#: Largest displacement of a mode in a picture, part of the size of the structure.
WARP = 0.15


@dataclass(frozen=True)
class Surface:
    """A surface and what moves it.

    Attributes:
        points: where its points are in the frame, (k, 3), m.
        triangles: numbers of points, (m, 3).
        nodes: for each point the node of the structure that carries it, (k,).
        arms: from there to the point, (k, 3), m.
        length: of the structure, by which rotations of shapes are multiplied, m.
    """

    points: Array
    triangles: npt.NDArray[np.int64]
    nodes: npt.NDArray[np.int64]
    arms: Array
    length: float

    @classmethod
    def of_beam(cls, places: Array, sides: tuple[Array, Array], length: float) -> Surface:
        """Return the four sides and both ends of a beam with rectangular sections.

        Places are those of the nodes on the axis; sides half the widths and half the heights as vectors, (n, 3), m.
        """
        n, (a, b) = len(places), sides
        sizes = [np.linalg.norm(side, axis=1) for side in sides]
        grown = np.maximum(1.0, LEAST * length / np.maximum(*sizes))[:, None]
        arms = np.stack([a + b, a - b, -a - b, -a + b], axis=1) * grown[:, None]
        ring = 4 * np.arange(n - 1)[:, None] + np.arange(4)
        following = 4 * np.arange(n - 1)[:, None] + (np.arange(4) + 1) % 4
        walls = [np.stack(t, axis=-1) for t in ((ring, following, ring + 4), (following, following + 4, ring + 4))]
        ends = np.array([[0, 2, 1], [0, 3, 2]])
        triangles = np.concatenate([*(wall.reshape(-1, 3) for wall in walls), ends, 4 * (n - 1) + ends[:, ::-1]])
        nodes = np.repeat(np.arange(n), 4)
        return cls((places[:, None] + arms).reshape(-1, 3), triangles, nodes, arms.reshape(-1, 3), length)

    def moved(self, shape: Mapping[str, Array]) -> Array:
        """Return the complex displacements (k, 3) of the points in a mode (columns of `ModesResult.shapes`)."""
        whole = {name: real + 1j * shape.get(f"{name}_imag", 0.0) for name, real in shape.items()}
        u, turns = self._at_points(whole)
        return np.asarray(u + np.cross(turns / self.length, self.arms))

    @property
    def size(self) -> float:
        """Diagonal of the box around the surface, m."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    def scale(self, shape: Mapping[str, Array]) -> float:
        """Return what a mode is multiplied by in pictures (m): `WARP` of the size, or a turn of 1 rad, the lesser one.

        Displacements by larger turns, as of a thin shaft in torsion, are not linear.
        """
        turns = [np.abs(values) / self.length for name, values in shape.items() if name.startswith(("theta", "alpha"))]
        return 1.0 / float(max(np.max(np.abs(self.moved(shape))) / (WARP * self.size), np.max(turns, initial=1e-300)))

    def displaced(self, columns: Mapping[str, Array]) -> Array:
        """Return the displacements (k, 3), m, of the points by components at the nodes: u1, … (m), theta1, … (rad)."""
        u, turns = self._at_points(columns)
        angle = np.linalg.norm(turns, axis=1, keepdims=True)
        e = turns / np.where(angle > 0.0, angle, 1.0)  # Rodrigues' formula; scipy's takes 0.15 s to load
        return np.asarray(
            u + np.sin(angle) * np.cross(e, self.arms) + (1 - np.cos(angle)) * np.cross(e, np.cross(e, self.arms))
        )

    def _at_points(self, columns: Mapping[str, Array]) -> tuple[Array, Array]:
        """Return displacements and rotations (k, 3) of what carries the points."""
        names = ("u1", "u2", "u3"), ("theta1", "theta2", "theta3" if "theta3" in columns else "alpha")
        zero = np.zeros_like(columns["u1"])
        u, turns = (np.column_stack([columns.get(name, zero) for name in of])[self.nodes] for of in names)
        return u, turns


# --- animations -------------------------------------------------------------------------------------------------------

#: Frames of an animation, which takes a second.
FRAMES = 24


def animate(result: Any, mode: int, folder: Path) -> list[Path]:
    """Write mode_N.png and mode_N.gif of a `ModesResult`: a mode at its largest and through one period, in space.

    Mode 1 is the first that is none of a rigid body. The paths are returned.
    """
    surface, there = result.surface, len(result.shapes)
    if surface is None or not 1 <= mode <= there:
        raise SceneError("command line", "--animate", mode, f"must be a mode from 1 to {there}")
    try:
        import pyvista
        from PIL import Image
    except ImportError:
        raise OutputError(folder / f"mode_{mode}.gif", "PyVista is not installed (pip install rotfem[plots])") from None
    (row, shape, frequency), units = result.with_shapes()[mode - 1], ShownUnits.of(result.summary)
    paths = [folder / f"mode_{mode}.png", folder / f"mode_{mode}.gif"]
    speed = f"{units.speeds(result.speed):.5g} {units.speed}"
    faces = np.column_stack([np.full(len(surface.triangles), 3), surface.triangles]).ravel()
    rest, z = pyvista.PolyData(surface.points, faces), surface.moved(shape)
    moving, size, scale = rest.copy(), surface.size, surface.scale(shape)
    leading = int(np.argmax(np.max(np.abs(z), axis=0)))
    name, peak = f"u{leading + 1}", float(np.max(np.abs(z[:, leading])))

    def show(turn: float) -> None:  # at a phase of the period, rad
        now = np.real(z * np.exp(1j * turn))
        moving.points = rest.points + scale * now
        moving[name] = now[:, leading]

    show(0.0)
    plotter, centre = pyvista.Plotter(off_screen=True, window_size=(900, 600)), np.array(rest.center)
    with closing(plotter), writing(paths[1]):
        bar = {"title": f"{name} (–)", "n_labels": 2, "title_font_size": 14}
        bar |= {"label_font_size": 14, "position_x": 0.3, "width": 0.4, "height": 0.06}
        plotter.add_mesh(rest.extract_feature_edges(30.0), color="gray", line_width=1)
        plotter.add_mesh(moving, scalars=name, cmap="RdBu_r", clim=(-peak, peak), scalar_bar_args=bar)
        title = f"mode {row['mode']}: {row['label']}, {frequency} at {speed}"
        plotter.add_text(title, font_size=11, position="upper_edge")
        plotter.add_axes(xlabel="1", ylabel="2", zlabel="3")
        plotter.camera_position = [centre + size * np.array([0.7, -1.6, 1.0]), centre, (0, 0, 1)]
        plotter.reset_camera(bounds=np.array(rest.bounds) + WARP * size * np.array([-1, 1] * 3))
        plotter.camera.zoom(1.8)
        plotter.screenshot(str(paths[0]))
        frames = []
        for turn in np.linspace(0.0, 2 * np.pi, FRAMES, endpoint=False):
            show(turn)
            plotter.render()
            frames.append(Image.fromarray(plotter.screenshot(return_img=True)).quantize(64))
        frames[0].save(paths[1], save_all=True, append_images=frames[1:], duration=1000 // 24, loop=0)
    return paths
