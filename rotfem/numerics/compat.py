"""The few places where dolfinx 0.9, 0.10 and 0.11 spell the same thing differently."""

from __future__ import annotations

from typing import Any

from dolfinx import fem, la
from petsc4py import PETSc

ADD, REVERSE = PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE


def create_vector(V: fem.FunctionSpace) -> Any:
    """Return a ghosted PETSc vector for the dofs of V (0.9 wants a form, 0.11 a space)."""
    index_map, bs = V.dofmap.index_map, V.dofmap.index_map_bs
    ghosts = index_map.ghosts.astype(PETSc.IntType)
    return PETSc.Vec().createGhost(
        ghosts, size=(index_map.size_local * bs, index_map.size_global * bs), bsize=bs, comm=V.mesh.comm
    )


def wrap(x: la.Vector) -> Any:
    """Return a PETSc vector that shares the memory of a dolfinx vector."""
    if hasattr(la, "create_petsc_vector_wrap"):
        return la.create_petsc_vector_wrap(x)
    import dolfinx.la.petsc

    return dolfinx.la.petsc.create_vector_wrap(x)


def _gmshio() -> Any:
    try:
        from dolfinx.io import gmsh as gmshio
    except ImportError:
        from dolfinx.io import gmshio
    return gmshio


def extract(model: Any) -> None:
    """Do once what `model_to_mesh` does on rank 0 alone, to see it fail there where no other rank waits for it."""
    _gmshio().extract_geometry(model)
    _gmshio().extract_topology_and_markers(model)


def model_to_mesh(model: Any, comm: Any) -> tuple[Any, Any, Any]:
    """Return (mesh in the plane, cell tags, edge tags) of a gmsh model that rank 0 holds."""
    out = _gmshio().model_to_mesh(model, comm, 0, gdim=2)
    return (out.mesh, out.cell_tags, out.facet_tags) if hasattr(out, "mesh") else out[:3]
