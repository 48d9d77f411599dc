"""Figures of plates: fields over the mid-surface by Matplotlib, pictures and animations in space by PyVista."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from rotfem.errors import OutputError, SceneError
from rotfem.results.columns import label
from rotfem.results.units import ShownUnits

if TYPE_CHECKING:
    from rotfem.results.modes import ModesResult
    from rotfem.results.run import RunResult

Array = npt.NDArray[Any]

#: Largest displacement in a picture, part of the plate's size; frames of an animation and their number a second.
WARP, FRAMES, RATE = 0.15, 24, 24

#: Displacements below this part of the largest are round-off, not to be coloured as if they were something.
ROUND_OFF = 1e-12


def panels(count: int, aspect: float) -> tuple[Figure, list[Any]]:
    """Return a figure and its `count` axes, for maps whose height is `aspect` times their width."""
    columns = min(count, 3 if aspect > 0.4 else 1)
    rows = -(-count // columns)
    width = 10.0 / columns
    height = float(np.clip((0.55 if columns > 1 else 0.9) * width * aspect, 0.9, 6.0)) + 0.9  # bars take room
    figure = Figure(figsize=(10.0, rows * height), layout="constrained")
    return figure, [figure.add_subplot(rows, columns, i + 1) for i in range(count)]


def map_of(axis: Any, mesh: Triangulation, values: Array, title: str, unit: str, floor: float = 0.0) -> None:
    """Draw a field over the mid-surface with its nodal lines and a colour bar; below the floor it has no colour."""
    peak = max(float(np.max(np.abs(values))), floor, 1e-300)
    drawn = axis.tripcolor(mesh, values, shading="gouraud", cmap="RdBu_r", norm=Normalize(-peak, peak))
    if np.min(values) < -1e-9 * peak and np.max(values) > 1e-9 * peak:
        axis.tricontour(mesh, values, levels=[0.0], colors="0.2", linewidths=0.8)
    axis.set(xlim=(mesh.x.min(), mesh.x.max()), ylim=(mesh.y.min(), mesh.y.max()), aspect="equal")
    axis.set_title(title, fontsize=9)
    axis.set_xlabel("x (m)", fontsize=8)
    axis.set_ylabel("y (m)", fontsize=8)
    axis.tick_params(labelsize=7)
    bar = axis.figure.colorbar(drawn, ax=axis, shrink=0.8)
    bar.set_label(unit, fontsize=8)
    bar.ax.tick_params(labelsize=7)
    bar.ax.yaxis.get_offset_text().set_size(7)


def leading(columns: dict[str, Array]) -> str:
    """Return which displacement of a shape is the largest."""
    sizes = {n: float(np.max(np.hypot(columns[n], columns.get(f"{n}_imag", 0.0)))) for n in ("u1", "u2", "u3")}
    return max(sizes, key=lambda name: sizes[name])


def modes_figure(result: ModesResult) -> Figure:
    """Return a map of the leading displacement of every mode, the largest translation 1."""
    shapes, triangles = result.shapes, result.triangles
    rows = result.rows[len(result.rows) - len(shapes) :]
    first = next(iter(shapes.values()))
    mesh = Triangulation(first["x"], first["y"], triangles)
    aspect = float(np.ptp(first["y"]) / np.ptp(first["x"]))
    figure, axes = panels(len(shapes), aspect)
    units = ShownUnits.of(result.summary)
    for axis, (title, columns), row in zip(axes, shapes.items(), rows, strict=True):
        name = leading(columns)
        caption = f"{title}\n{units.frequencies(row['frequency']):.5g} {units.frequency}"
        map_of(axis, mesh, columns[name], caption, f"{name} (–)")
    return figure


def shape_figure(result: RunResult) -> Figure:
    """Return maps of the displacements of the final shape."""
    s = result.shape
    mesh = Triangulation(s["x"], s["y"], result.triangles)
    floor = ROUND_OFF * max(float(np.max(np.abs(s[name]))) for name in ("u1", "u2", "u3"))
    figure, axes = panels(3, float(np.ptp(s["y"]) / np.ptp(s["x"])))
    for axis, name in zip(axes, ("u1", "u2", "u3"), strict=True):
        map_of(axis, mesh, s[name], name, f"{name} (m)", floor)
    figure.suptitle(result.title + ", final shape", fontsize=10)
    return figure


def resultants_figure(result: RunResult) -> Figure:
    """Return maps of the stress resultants at the end."""
    r = result.resultants
    mesh = Triangulation(r["x"], r["y"], result.triangles)
    names = [name for name in r if name not in ("x", "y")]
    figure, axes = panels(len(names), float(np.ptp(r["y"]) / np.ptp(r["x"])))
    for axis, name in zip(axes, names, strict=True):
        map_of(axis, mesh, r[name], name, label(name))
    figure.suptitle(result.title + ", final stress resultants", fontsize=10)
    return figure


def surface(columns: dict[str, Array], triangles: Array) -> Any:
    """Return the undeformed mid-surface as a PyVista mesh."""
    import pyvista

    points = np.column_stack([columns["x"], columns["y"], np.zeros_like(columns["x"])])
    faces = np.column_stack([np.full(len(triangles), 3), triangles]).ravel()
    return pyvista.PolyData(points, faces)


def animate(result: ModesResult, mode: int, folder: Path) -> list[Path]:
    """Write mode_N.png and mode_N.gif: a mode at its largest and through one period, in space; return their paths.

    Args:
        result: modes of a plate.
        mode: number of the mode, 1 for the first.
        folder: where the files go.

    Raises:
        SceneError: there is no such mode, or the structure is no plate.
        OutputError: PyVista is not installed, or a file cannot be written.
    """
    if result.triangles is None:
        raise SceneError("command line", "--animate", mode, 'needs structure.type = "plate"')
    titles = list(result.shapes)
    if not 1 <= mode <= len(titles):
        raise SceneError("command line", "--animate", mode, f"must be a mode from 1 to {len(titles)}")
    title, columns = titles[mode - 1], result.shapes[titles[mode - 1]]
    try:
        import pyvista  # noqa: F401
        from PIL import Image
    except ImportError:
        raise OutputError(folder / f"mode_{mode}.gif", "PyVista is not installed (pip install rotfem[plots])") from None
    moving = Moving(surface(columns, result.triangles), columns)
    paths = [folder / f"mode_{mode}.png", folder / f"mode_{mode}.gif"]
    plotter = moving.plotter(title)
    try:
        plotter.screenshot(str(paths[0]))
        frames = []
        for turn in np.linspace(0.0, 2 * np.pi, FRAMES, endpoint=False):
            moving.show(turn)
            plotter.render()
            frames.append(Image.fromarray(plotter.screenshot(return_img=True)).quantize(64))
        frames[0].save(paths[1], save_all=True, append_images=frames[1:], duration=1000 // RATE, loop=0)
    except OSError as error:
        raise OutputError(paths[1], error.strerror or str(error)) from None
    finally:
        plotter.close()
    return paths


class Moving:
    """A mid-surface in a mode, coloured by its leading displacement.

    Args:
        rest: the undeformed surface, a PyVista mesh.
        columns: the shape, of which the surface shows `WARP` of its own size.
    """

    def __init__(self, rest: Any, columns: dict[str, Array]):
        self._rest, self._moving, names = rest, rest.copy(), ("u1", "u2", "u3")
        self._z = np.column_stack([columns[n] + 1j * columns[f"{n}_imag"] for n in names])
        self._size = float(np.max(np.ptp(rest.points, axis=0)))
        self._scale = WARP * self._size / float(np.max(np.linalg.norm(np.abs(self._z), axis=1)))
        self._name = leading(columns)
        self._leading, self._peak = names.index(self._name), float(np.max(np.abs(columns[self._name])))
        self.show(0.0)

    def show(self, turn: float) -> None:
        """Move and colour the surface as it is at a phase of the period, rad."""
        now = np.real(self._z * np.exp(1j * turn))
        self._moving.points = self._rest.points + self._scale * now
        self._moving[self._name] = now[:, self._leading]

    def plotter(self, title: str) -> Any:
        """Return a PyVista plotter with the surface, its place at rest and a colour bar."""
        import pyvista

        size, bar = self._size, {"title": f"{self._name} (–)", "n_labels": 3}
        plotter = pyvista.Plotter(off_screen=True, window_size=(800, 600))
        plotter.add_mesh(self._rest, style="wireframe", color="lightgray", opacity=0.3)
        limits = -self._peak, self._peak
        plotter.add_mesh(self._moving, scalars=self._name, cmap="RdBu_r", clim=limits, scalar_bar_args=bar)
        plotter.add_text(title, font_size=10)
        plotter.show_bounds(grid="back", xtitle="x (m)", ytitle="y (m)", ztitle=" ", font_size=9, show_zlabels=False)
        plotter.camera_position = [(1.6 * size, -1.8 * size, 1.3 * size), self._rest.center, (0, 0, 1)]
        plotter.reset_camera(bounds=np.array(self._rest.bounds) + WARP * size * np.array([-1, 1] * 3))
        plotter.camera.zoom(1.3)
        return plotter
