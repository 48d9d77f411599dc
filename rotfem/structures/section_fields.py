"""Tables over x as fields on the elements of beams and plates, which need not have a node at every row.

A property c is what its table says at the nodes of a field where no row lies inside an element. In an element with rows
inside it is the projection P c on polynomials of degree k, that of the unknowns:

    ∫ P c p dx = ∫ c p dx  for all p of degree k,

with integrals from row to row. Forms hold ∫ c f dx, f made of shape functions, and ∫ P c f dx differs from that by
∫ (c − P c)(f − P f) dx. Masses, first moments and dead loads are exact; what is stored and what moves is so to the
order of the elements themselves. Legendre's polynomial of degree k vanishes at the k Gauss points of the reduced rule,
so that this rule sees the projection on degree k − 1, which is that of strains.

In a cell of a plate the polynomials are such of x, too, and integrals are over the cell: b(x) dx in the place of dx,
with its breadth b between straight edges.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from numpy.polynomial import legendre

from rotfem.along import ONE

Array = npt.NDArray[np.float64]

#: Whether values (n, …) at points of an element can be those of a property.
Valid = Callable[[Array], bool]

#: Corners of a cell one after the other, as the mesh numbers them.
AROUND = {"interval": [0, 1], "triangle": [0, 1, 2], "quadrilateral": [0, 1, 3, 2]}

#: Points and weights of the Gauss rule with so many points on −1 … 1.
leggauss = cache(legendre.leggauss)


def field_values(
    at: Callable[[Array, Array], Any], rows: Array, degree: int, space: fem.FunctionSpace, valid: Valid | None = None
) -> Array:
    """Return the values of a property at(x, near) at the nodes of a discontinuous space, (nodes, components).

    `near` are places on the side of x that counts at a jump; rows (m) increase. Where a projection is not `valid`, as
    where stiffness falls by orders of magnitude within an element, the mean takes its place.
    """
    dofmap, x = space.dofmap.list, space.tabulate_dof_coordinates()[:, 0]
    middle = np.empty_like(x)
    middle[dofmap] = x[dofmap].mean(axis=1)[:, None]
    values = np.array(at(x, middle), dtype=np.float64).reshape(len(x), -1)
    corners = space.mesh.geometry.x[space.mesh.geometry.dofmap[:, AROUND[space.mesh.topology.cell_name()]]]
    ends = np.stack([corners[..., 0].min(axis=1), corners[..., 0].max(axis=1)], axis=1)
    near = ONE * float(np.abs(ends).max(initial=0.0))
    first, last = (np.searchsorted(rows, end) for end in (ends[:, 0] + near, ends[:, 1] - near))
    xi, w = leggauss(5)  # exact for a taper of fourth degree times the fifth of polynomials
    inner = np.concatenate([leggauss(degree + i)[0] for i in (0, 1)])
    for cell in np.flatnonzero(last > first):
        (a, b), dofs = ends[cell], dofmap[cell]
        cuts = np.unique([*corners[cell, :, 0], *rows[first[cell] : last[cell]]])
        half = np.diff(cuts)[:, None] / 2
        places = (cuts[:-1, None] + half * (1.0 + xi)).ravel()
        samples = np.asarray(at(places, np.full_like(places, (a + b) / 2))).reshape(len(places), -1)
        basis = legendre.legvander(2.0 * (places - a) / (b - a) - 1.0, degree)
        weights = np.sqrt((half * w).ravel() * breadth(corners[cell], places))[:, None]
        c = np.linalg.lstsq(weights * basis, weights * samples, rcond=None)[0]
        if valid is not None and valid(samples) and not valid(legendre.legvander(inner, degree) @ c):
            c[0], c[1:] = np.sum(weights**2 * samples, axis=0) / np.sum(weights**2), 0.0
        values[dofs] = legendre.legvander(2.0 * (x[dofs] - a) / (b - a) - 1.0, degree) @ c
    return values


def breadth(corners: Array, x: Array) -> Array:
    """Return the breadth (n,) at places x (m) of a cell with corners (corners, 3), one after the other; 1 of two."""
    if len(corners) == 2:
        return np.ones(len(x))
    first, second = corners, np.roll(corners, -1, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (x[:, None] - first[:, 0]) / (second[:, 0] - first[:, 0])
        y = np.where((share >= 0.0) & (share <= 1.0), first[:, 1] + share * (second[:, 1] - first[:, 1]), np.nan)
    return np.asarray(np.nanmax(y, axis=1) - np.nanmin(y, axis=1))


def not_negative(values: Array) -> bool:
    """Return whether no value is negative."""
    return bool(np.all(values >= 0.0))


def positive_matrices(definite: bool) -> Valid:
    """Return whether upper triangles (n, 21) are those of positive (semi)definite matrices, scaled by their mean."""
    rows, columns = np.triu_indices(6)

    def valid(values: Array) -> bool:
        M = np.zeros((len(values), 6, 6))
        M[:, rows, columns] = M[:, columns, rows] = values
        diagonal = np.abs(np.einsum("nii->i", M)) / len(M)
        scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        least = np.linalg.eigvalsh(M / np.outer(scale, scale))[:, 0]
        return bool(np.all(least > 0.0 if definite else least > -1e-12))

    return valid
