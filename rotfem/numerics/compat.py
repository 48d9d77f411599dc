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


def form_of(code: Any, module: Any, V: Any, functions: list[Any], constants: list[Any], data: Any) -> Any:
    """Return a form of code that FFCx has compiled, on the mesh of a space (0.9 wants a pointer, 0.11 a list)."""
    regions = {}
    for kind in (getattr(fem.IntegralType, name) for name in data):
        begin, end = (code.form_integral_offsets[kind.value + i] for i in (0, 1))
        ids = {code.form_integral_ids[i] for i in range(begin, end)} - {-1}  # -1 is everywhere
        regions[kind] = fem.forms.get_integration_domains(kind, data[kind.name][0], sorted(ids))
    objects = [[x._cpp_object for x in each] for each in ([V] * code.rank, functions, constants)]
    make, mesh = fem.forms.form_cpp_class(PETSc.ScalarType), V.mesh.ufl_domain().ufl_cargo()
    pointer = int(module.ffi.cast("uintptr_t", module.ffi.addressof(code)))
    try:
        made = make([pointer], *objects, regions, [], mesh)
    except TypeError:
        made = make(pointer, *objects, regions, {}, mesh)
    return fem.Form(made, code, None, module)


def model_to_mesh(model: Any, comm: Any) -> tuple[Any, Any, Any]:
    """Return (mesh in the plane, cell tags, edge tags) of a gmsh model that rank 0 holds."""
    try:
        from dolfinx.io import gmsh as gmshio
    except ImportError:
        from dolfinx.io import gmshio
    out = gmshio.model_to_mesh(model, comm, 0, gdim=2)
    return (out.mesh, out.cell_tags, out.facet_tags) if hasattr(out, "mesh") else out[:3]
