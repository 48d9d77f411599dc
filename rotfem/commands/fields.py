"""Fields over a structure: its properties along the span, and what is written for ParaView, in XDMF.

That is the moving structure, its modes and stress resultants.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.equations.system import System
from rotfem.results.files import whole_hdf5, write_text
from rotfem.results.modes import ModesResult
from rotfem.results.surfaces import HALF_WIDTH, Surface
from rotfem.scene.values import evaluate

Array = npt.NDArray[np.float64]
Writer = Callable[[Path], list[Path]]


#: Most snapshots of a history that are kept.
MOST_STATES = 200


class Snapshots:
    """States of a history at ever wider intervals, so that there are never more than MOST_STATES."""

    def __init__(self, structure: Any):
        self._total, self.kept = structure.total, list[tuple[float, Array, Array | None]]()
        self._every, self._count = 1, 0

    def add(self, t: float, q: Array, more: Array | None = None) -> None:
        """Keep a copy of the local dof array q at time t (s), and more values (nodes, names), or pass it by.

        Its rotations are counted from the undeformed structure then.
        """
        if self._count % self._every == 0:
            self.kept.append((t, self._total(q).copy(), more))
            if len(self.kept) > MOST_STATES:
                self.kept, self._every = self.kept[::2], 2 * self._every
        self._count += 1


def fields_writer(system: System, snapshots: Snapshots, names: tuple[str, ...]) -> Writer:
    """Return what writes the surface of a run over time as fields.xdmf into a folder, on all ranks together.

    Names are those of the further values of its snapshots.
    """
    structure = system.structure

    def write(folder: Path) -> list[Path]:
        """Gather the unknowns, and write the displacements of the surface in the turning frame on rank 0."""
        surface, frames = surface_of(structure, structure.nodes(system.zeros())[0]), []
        for t, q, more in snapshots.kept:
            coordinates, values = structure.nodes(q[: len(system.zeros())])
            seen = system.seen_from_hub(values, coordinates["x"], t)
            fields = {"displacement": surface.displaced(dict(zip(structure.components, seen.T, strict=False)))}
            frames.append((t, fields if more is None else fields | dict(zip(names, more.T, strict=True))))
        if system.comm.rank != 0:
            return []
        return write_xdmf(folder / "fields.xdmf", surface.points, surface.triangles, frames)

    return write


# --- along the span ---------------------------------------------------------------------------------------------------

#: Places from one row of the tables to the next.
BETWEEN = 4


def central_properties(stiffness: Array, mass: Array) -> dict[str, Array]:
    """Return the section properties about the section's own centres of matrices (n, 6, 6) about the reference line.

    They are `EA` (N), `EI2`, `EI3` (N·m²) about the tension centre; `GA2`, `GA3` (N), `GJ` (N·m²) about the shear one;
    `mass_per_length` (kg/m), `rotary_inertia2`, `rotary_inertia3` (kg·m) about the mass centre; `tension_center_y`,
    `tension_center_z` (m) and those of the others. Couplings that no centre takes away are left out.
    """
    K, M = stiffness, mass
    EA, m = K[:, 0, 0], M[:, 0, 0]
    across = K[:, 1:3, 1:3]
    arm = np.linalg.solve(across, K[:, 1:3, 3, None])[..., 0]  # (−z, y) of the shear centre
    y, z = M[:, 2, 3] / m, M[:, 0, 4] / m
    return {
        "mass_per_length": m,
        "EA": EA,
        "GA2": K[:, 1, 1],
        "GA3": K[:, 2, 2],
        "GJ": K[:, 3, 3] - np.einsum("ni,ni->n", arm, K[:, 1:3, 3]),
        "EI2": K[:, 4, 4] - K[:, 0, 4] ** 2 / EA,
        "EI3": K[:, 5, 5] - K[:, 0, 5] ** 2 / EA,
        "rotary_inertia2": M[:, 4, 4] - m * z**2,
        "rotary_inertia3": M[:, 5, 5] - m * y**2,
        "mass_center_y": y,
        "mass_center_z": z,
        "tension_center_y": -K[:, 0, 5] / EA,
        "tension_center_z": K[:, 0, 4] / EA,
        "shear_center_y": arm[:, 1],
        "shear_center_z": -arm[:, 0],
    }


def axes_along(beam: Any, x: Array, root: Any) -> Array:
    """Return the section axes of a beam's data as columns, (n, 3, 3), in the frame in which its root is turned so."""
    from scipy.spatial.transform import Rotation  # slow to load, and only beams in space need it

    line = beam.reference_line
    chi, zeta = line.angles(x) if line is not None else np.zeros((2, len(x)))
    turned = Rotation.from_euler("ZYX", np.column_stack([chi, -zeta, evaluate(beam.pretwist, x)]))
    return np.asarray(root @ turned.as_matrix())


def columns_of(beam: Any, at: Array | None = None) -> dict[str, Array]:
    """Return columns over `x` (m) of a discretised beam, at places (m) or the rows of its tables; none of others.

    Of a spatial beam `axis_1` … `axis_3` say where its axis runs in the frame (m), `t1_1` … `t3_3` are components of
    the section axes there, `pretwist` is their angle (rad), and the rest is `central_properties`; of a planar beam they
    are its section.
    """
    structure = beam.data
    section = getattr(structure, "section", None)
    if section is None:
        return {}
    if at is None:  # the rows, and places between them
        ends = np.array([0.0, *structure.knots, structure.length])
        steps = np.linspace(0.0, 1.0, BETWEEN, endpoint=False)
        at = np.append((ends[:-1, None] + np.diff(ends)[:, None] * steps).ravel(), structure.length)
    x = at
    if structure.is_planar:
        return {"x": x, **section.at(x)}
    r, T = beam.places({"x": x}), axes_along(structure, x, beam.root_turned)
    matrices = section.at(x)
    return {
        "x": x,
        **{f"axis_{i + 1}": r[:, i] for i in range(3)},
        **{f"t{j + 1}_{i + 1}": T[:, i, j] for j in range(3) for i in range(3)},
        "pretwist": evaluate(structure.pretwist, x),
        **central_properties(matrices["stiffness"], matrices["mass"]),
    }


# --- modes ------------------------------------------------------------------------------------------------------------


def surface_of(structure: Any, shape: dict[str, Array]) -> Surface:
    """Return the surface of a structure, through nodes of coordinates such as those of a mode shape.

    The sections of a beam are drawn as the rectangles of their radii of gyration; those of a planar one are square.
    """
    points, triangles = structure.places(shape), structure.surface()
    if triangles is not None:
        return Surface(points, triangles, np.arange(len(points)), np.zeros_like(points), structure.length)
    c = columns_of(structure, shape["x"])
    stiffnesses = ("EI", "EI") if structure.data.is_planar else ("EI3", "EI2")
    halves = [HALF_WIDTH * np.sqrt(np.abs(c[EI] / c["EA"]))[:, None] for EI in stiffnesses]
    axes = [
        np.eye(3)[k - 1] if structure.data.is_planar else np.column_stack([c[f"t{k}_{i}"] for i in (1, 2, 3)])
        for k in (2, 3)
    ]
    return Surface.of_beam(points, (halves[0] * axes[0], halves[1] * axes[1]), structure.length)


def modes_writer(analysis: Any, result: ModesResult) -> Writer:
    """Return what writes the surface of modes as modes.xdmf; the time is the number of the mode."""
    surface = result.surface
    assert surface is not None

    def write(folder: Path) -> list[Path]:
        if analysis.comm.rank != 0:
            return []
        moved = ((row["mode"], surface.moved(shape)) for row, shape, _ in result.with_shapes())
        frames = ((number, {"displacement": z.real, "displacement_imag": z.imag}) for number, z in moved)
        return write_xdmf(folder / "modes.xdmf", surface.points, surface.triangles, frames)

    return write


# --- XDMF: an XML file that refers to an HDF5 file beside it -----------------------------------------------------


def write_xdmf(
    path: Path, points: Array, triangles: npt.NDArray[np.int64], frames: Iterable[tuple[float, Mapping[str, Array]]]
) -> list[Path]:
    """Write point data over time as path (.xdmf) and, beside it, .h5; return both paths.

    Points (n, 3) are in m; triangles have the numbers of theirs, (m, 3); frames are times (s) with values (n,) or
    (n, 3) by name, the same names at all times.
    """
    heavy = path.with_suffix(".h5")
    text = [
        '<Xdmf Version="3.0"><Domain>',
        f'<Grid Name="{path.stem}" GridType="Collection" CollectionType="Temporal">',
    ]
    with whole_hdf5(heavy) as file:

        def item(name: str, values: npt.NDArray[Any]) -> str:
            """Return where in the HDF5 file values are, which are written there if they are not yet."""
            if name not in file:
                file[name] = values
            number, shape = "Int" if values.dtype.kind == "i" else "Float", " ".join(map(str, values.shape))
            head = f'<DataItem Dimensions="{shape}" NumberType="{number}" Precision="8" Format="HDF">'
            return f"{head}{heavy.name}:/{name}</DataItem>"

        for number, (t, fields) in enumerate(frames):
            text.append(f'<Grid Name="{path.stem}" GridType="Uniform"><Time Value="{float(t)!r}"/>')
            topology = f'<Topology TopologyType="Triangle" NodesPerElement="3" NumberOfElements="{len(triangles)}">'
            text.append(f"{topology}{item('cells', triangles)}</Topology>")
            text.append(f'<Geometry GeometryType="XYZ">{item("points", points)}</Geometry>')
            for name, values in fields.items():
                what = "Vector" if values.ndim > 1 else "Scalar"
                head = f'<Attribute Name="{name}" AttributeType="{what}" Center="Node">'
                text.append(f"{head}{item(f'{name}/{number}', values)}</Attribute>")
            text.append("</Grid>")
    write_text(path, "\n".join([*text, "</Grid></Domain></Xdmf>", ""]))
    return [path, heavy]
