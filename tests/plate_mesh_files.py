"""Small gmsh files (format 2.2) for tests, written without gmsh, and a scene for them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

#: gmsh's number of a cell by its nodes, and the dimension of its group.
KINDS = {2: (1, 1), 3: (2, 2), 4: (3, 2), 8: (5, 3)}

#: A spinning plate under a tip force; shape and mesh are to be filled in.
PLATE_SCENE = """\
[structure]
type = "plate"
{shape}
thickness = 0.02
E = 70.0e9
nu = 0.3
rho = 2700.0
hub_radius = 0.5
[motion]
type = "constant"
speed = 60.0
axis = [0.2, 1.0, 0.5]
[mesh]
{mesh}
[modes]
count = 5
[loads]
tip_force = [0, 0, 300.0]
[output]
error = false
"""


def write_msh(
    path: Path, points: npt.ArrayLike, groups: Mapping[str, Sequence[Sequence[int]]], dimension: int | None = None
) -> Path:
    """Write nodes (n, 2 or 3) and cells by group name (node numbers from 0) as a .msh file; return its path.

    Cells of the name "" are in no physical group.
    """
    x = np.asarray(points, dtype=float)
    x = np.column_stack([x, np.zeros((len(x), 3 - x.shape[1]))])
    names, cells = [], []
    for tag, (name, members) in enumerate(groups.items(), start=1):
        size = dimension or (KINDS[len(members[0])][1] if members else 2)
        if name:
            names.append(f'{size} {tag} "{name}"')
        cells += [(KINDS[len(c)][0], tag if name else 0, tag, c) for c in members]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names)), *names]
    lines += ["$EndPhysicalNames", "$Nodes", str(len(x))]
    lines += [f"{i} {a!r} {b!r} {c!r}" for i, (a, b, c) in enumerate(x.tolist(), start=1)]
    lines += ["$EndNodes", "$Elements", str(len(cells))]
    for i, (kind, group, tag, nodes) in enumerate(cells, start=1):
        lines.append(f"{i} {kind} 2 {group} {tag} " + " ".join(str(n + 1) for n in nodes))
    path.write_text("\n".join([*lines, "$EndElements", ""]))
    return path


def grid(nx: int, ny: int, length: float = 1.0, width: float = 1.0) -> tuple[npt.NDArray[np.float64], dict[str, list]]:
    """Return the nodes and groups of a rectangle 0 ≤ x ≤ length, |y| ≤ width/2 of quadrilaterals."""
    x, y = np.meshgrid(np.linspace(0, length, nx + 1), np.linspace(-width / 2, width / 2, ny + 1), indexing="ij")

    def node(i: int, j: int) -> int:
        return i * (ny + 1) + j

    plate = [[node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)] for i in range(nx) for j in range(ny)]
    clamped = [[node(0, j), node(0, j + 1)] for j in range(ny)]
    tip = [[node(nx, j), node(nx, j + 1)] for j in range(ny)]
    return np.column_stack([x.ravel(), y.ravel()]), {"plate": plate, "clamped": clamped, "tip": tip}
