"""Displacement fields in files for ParaView, written by all ranks together."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from basix.ufl import element
from dolfinx import fem, io

from rotfem.errors import OutputError

Array = npt.NDArray[Any]

#: Most snapshots of a history that are kept.
MOST = 200


class Snapshots:
    """States of a history at ever wider intervals, so that there are never more than MOST."""

    def __init__(self) -> None:
        self.kept: list[tuple[float, Array]] = []
        self._every, self._count = 1, 0

    def add(self, t: float, q: Array) -> None:
        """Keep a copy of the local dof array q at time t (s), or pass it by."""
        if self._count % self._every == 0:
            self.kept.append((t, q.copy()))
            if len(self.kept) > MOST:
                self.kept, self._every = self.kept[::2], 2 * self._every
        self._count += 1

    def put_back(self, known: dict[str, Any], count: int) -> None:
        """Take all attributes that there were after so many states.

        Raises:
            ValueError: it is not what there is after so many.
        """
        kept, every = known["kept"], known["_every"]
        due = count if every == 1 else 1 + (count - 1) // every
        if known["_count"] != count or len(kept) != due or not 0 < len(kept) <= MOST or set(known) != set(vars(self)):
            raise ValueError(f"{len(kept)} snapshots after {count} states")
        self.kept, self._every, self._count = [(float(t), np.asarray(x)) for t, x in kept], every, count


def writer(structure: Any, name: str, states: Iterable[tuple[float, Array]]) -> Any:
    """Return the function that writes displacement fields of a structure into a folder (see `write`)."""
    return partial(write, structure, name, list(states))


def size_of_one(W: fem.FunctionSpace, fields: int) -> int:
    """Return about how many bytes a snapshot of so many fields takes, not less: its mesh is written with it."""
    cells, nodes = W.mesh.topology.index_map(W.mesh.topology.dim), W.dofmap.index_map
    points, cell_count = nodes.size_local + nodes.num_ghosts, cells.size_local + cells.num_ghosts
    here = 8 * (points * (3 * fields + 5) + cell_count * (2 + W.dofmap.dof_layout.num_dofs))
    blocks = 2 + here // 4096  # whole blocks of bytes for each process, and what describes them
    return int(W.mesh.comm.allreduce(blocks)) * 4096


def reserve(comm: Any, path: Path, size: int) -> None:
    """See that a file of this size (bytes) can be written, as ADIOS2 ends the program where it cannot.

    Raises:
        OutputError: on every rank; the disk is full, or a quota or a limit of the size of files is in the way.
    """
    problem = None
    if comm.rank == 0:
        try:
            with tempfile.TemporaryFile(dir=path.parent) as file:
                os.posix_fallocate(file.fileno(), 0, size)
        except OSError as error:
            problem = OutputError(path, error.strerror or str(error))
    problem = comm.bcast(problem)
    if problem is not None:
        raise problem


def write(structure: Any, name: str, states: list[tuple[float, Array]], folder: Path) -> list[Path]:
    """Write the displacements of local dof arrays as name.bp (VTX), or name.xdmf without ADIOS2; return the path.

    Args:
        structure: whose mesh and unknowns it has.
        name: of the file, without ending.
        states: (time in s or number of the mode, dof array); a complex one gives the fields of both its parts.
        folder: where the file goes.

    Raises:
        OutputError: it cannot be written.
    """
    V = structure.V
    mesh, degree, vtx = V.mesh, V.element.basix_element.degree, hasattr(io, "VTXWriter")
    W = fem.functionspace(mesh, element("Lagrange", mesh.basix_cell(), degree if vtx else 1, shape=(3,)))
    full = fem.functionspace(mesh, element("Lagrange", mesh.basix_cell(), degree, shape=(3,)))
    size = V.dofmap.index_map.size_local * V.dofmap.index_map_bs
    parts = [np.real, np.imag] if any(np.iscomplexobj(q) for _, q in states) else [np.real]
    names = ["displacement", "displacement_imag"][: len(parts)]
    out = [fem.Function(W, name=n) for n in names]
    whole = fem.Function(full)
    path = folder / f"{name}.{'bp' if vtx else 'xdmf'}"
    reserve(mesh.comm, path, len(states) * size_of_one(W, len(parts)))
    try:
        if vtx:
            if mesh.comm.rank == 0 and path.exists():
                shutil.rmtree(path, ignore_errors=True)
            mesh.comm.barrier()
            file = io.VTXWriter(mesh.comm, path, out)
        else:
            file = io.XDMFFile(mesh.comm, path, "w")
            file.write_mesh(mesh)
        with file:
            for t, q in states:
                for f, part in zip(out, parts, strict=True):
                    nodal = structure.whole_values(part(q[:size]).reshape(-1, V.dofmap.index_map_bs))
                    own = _displacements(structure, nodal).ravel()
                    whole.x.array[: len(own)] = own
                    whole.x.scatter_forward()
                    f.interpolate(whole)
                    if not vtx:
                        file.write_function(f, t)
                if vtx:
                    file.write(t)
    except (OSError, RuntimeError) as error:
        raise OutputError(path, str(error).splitlines()[0]) from None
    return [path]


def _displacements(structure: Any, nodal: Array) -> Array:
    """Return u1, u2, u3 of all components at nodes, (n, 3); zero where there is none."""
    at = {name: i for i, name in enumerate(structure.components)}
    zero = np.zeros(len(nodal))
    return np.column_stack([nodal[:, at[name]] if name in at else zero for name in ("u1", "u2", "u3")])
