"""Thickness and plane-stress moduli of a plate as constants or fields of the forms."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import ufl
from dolfinx import fem

from rotfem.structures.meshes.plate_mesh import PlateGrid


def constants(data: Any) -> dict[str, float]:
    """Return name ↦ value of the material: moduli (Pa), Poisson's ratio, density (kg/m³), shear correction."""
    names = ("E1", "E2", "nu12", "G12", "G13", "G23") if data.is_orthotropic else ("E", "nu")
    values: dict[str, Any] = {name: getattr(data, name) for name in (*names, "rho", "shear_correction")}
    return {name: values["G12"] if value is None else value for name, value in values.items()}


def thickness_field(data: Any, grid: PlateGrid) -> fem.Function:
    """Return the thickness (m) given by region, or along x; of a rectangle exactly, as the knots are mesh lines."""
    if isinstance(data.thickness, dict):
        h = fem.Function(fem.functionspace(grid.mesh, ("DG", 0)), name="thickness")
        for name, value in data.thickness.items():
            h.x.array[grid.regions.find(grid.region_names[name])] = value
        h.x.scatter_forward()
        return h
    h = fem.Function(fem.functionspace(grid.mesh, ("DG", 1)), name="thickness")
    h.interpolate(lambda x: data.thickness_at(x[0]))
    return h


def plane_stress(p: Mapping[str, Any]) -> Any:
    """Return Q of σ = Q (ε_11, ε_22, 2ε_12), shape (3, 3), Pa, from the material's constants."""
    if "E" in p:
        E, nu = p["E"], p["nu"]
        return E / (1 - nu**2) * ufl.as_matrix([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]])
    E1, E2, nu12 = p["E1"], p["E2"], p["nu12"]
    both = 1 - nu12**2 * E2 / E1
    coupling = nu12 * E2 / both
    return ufl.as_matrix([[E1 / both, coupling, 0], [coupling, E2 / both, 0], [0, 0, p["G12"]]])


def shear_moduli(p: Mapping[str, Any]) -> Any:
    """Return k G of the transverse shear stresses, shape (2, 2), Pa."""
    if "E" in p:
        return p["shear_correction"] * p["E"] / (2 * (1 + p["nu"])) * ufl.Identity(2)
    return p["shear_correction"] * ufl.as_matrix([[p["G13"], 0], [0, p["G23"]]])
