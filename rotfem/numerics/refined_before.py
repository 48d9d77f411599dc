"""Refined meshes of before, for programs that compute one structure many times: cells and nodes are what takes long.

A load, a stiffness or a motion is none of the mesh, so that runs of a study mostly share it.
"""

from __future__ import annotations

from typing import Any

from dolfinx import fem

from rotfem.numerics.refinement import Refinement

#: How many are kept, and the most nodes of the cells that are refined: of larger ones matrices take longer by far.
KEPT, MOST = 4, 2000

_made: dict[Any, Refinement] = {}


def refinement(V: fem.FunctionSpace) -> Refinement:
    """Return the refinement of a space: that of before if there is one of the same cells and nodes.

    Raises:
        NotRefined: see `Refinement`.
    """
    mesh = V.mesh
    geometry = mesh.geometry
    if mesh.comm.size > 1 or len(geometry.x) > MOST:
        return Refinement(V)
    arrays = (geometry.x, geometry.dofmap, geometry.input_global_indices, V.dofmap.list)
    key = (V.ufl_element(), geometry.cmap.degree, *(x.tobytes() for x in arrays))
    found = _made.pop(key, None) or Refinement(V)
    _made[key] = found
    while len(_made) > KEPT:
        _made.pop(next(iter(_made)))
    return found.of(V)
