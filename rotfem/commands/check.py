"""`rotfem check`: what a scene's structure is, before anything is computed with it."""

from __future__ import annotations

from collections.abc import Mapping
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from rotfem.commands.fields import BETWEEN, columns_of, surface_of
from rotfem.commands.problem import Problem
from rotfem.commands.processes import communicator, summary
from rotfem.equations.model import Model, rigid_body
from rotfem.errors import input_of
from rotfem.mechanics.effects import Effect
from rotfem.mechanics.theories import Theory
from rotfem.results.of_scene import CheckResult
from rotfem.results.result import Array
from rotfem.scene import Scene


def weighed(scene: Scene, comm: MPI.Comm) -> CheckResult:
    """Return mass, inertias and properties of the structure of a scene (see `rotfem.check`)."""
    started = perf_counter()
    with input_of(scene.file):
        bringing = [effect.name for effect in Effect.registry if effect.name in ("rotary_inertia", "tip_mass")]
        problem = Problem.of(scene).turning().replace(effects=tuple(bringing))
        linear = [theory for theory in Theory.registry if theory.linear and theory.holds_for(scene.structure.type)]
        if linear:  # at rest all are the same, and the forms of these are small
            problem = problem.replace(theory=min(linear, key=lambda theory: theory.rank).name)
        model = Model(problem, communicator(problem, comm))
        body = rigid_body(model)
        structure = scene.structure
        root = np.array(getattr(structure, "root_position", (structure.hub_radius, 0.0, 0.0)))
        axis = np.array(scene.motion.axis) / np.linalg.norm(scene.motion.axis)
        center = np.array(body.first_moment / (body.mass or 1.0))
        columns = columns_of(model.structure)
        found: dict[str, Any] = {
            **summary("check", scene, comm, model.structure.mesh.comm),
            "type": structure.type,
            "frame": "fixed" if problem.frame == "fixed" else "rotating",
            "length": model.structure.length,
            "mass": body.mass,
            "center_of_mass": center.tolist(),
            "root": root.tolist(),
            "first_moment_root": (body.first_moment - body.mass * root).tolist(),
            "inertia_root": body.about(root).tolist(),
            "inertia_center": body.about(center).tolist(),
            "inertia_axis": float(axis @ body.about(np.zeros(3)) @ axis),
            "elements": int(model.structure.mesh.topology.index_map(model.structure.mesh.topology.dim).size_global),
            "warnings": doubts(columns),
            "timings": {"total": perf_counter() - started},
        }
        coordinates, _ = model.structure.nodes(model.structure.k.functions[0].x.array)
        return CheckResult(found, columns, coordinates, surface_of(model.structure, coordinates))


def doubts(columns: Mapping[str, Array]) -> list[str]:
    """Return what looks like a slip: degrees for radians, another unit, a point that is missing.

    It is a pretwist above 2 rad, a property that changes 30 times from row to row, radii of gyration of stiffness and
    mass 10 times apart, or a centre 4 radii of gyration away.
    """
    x = columns.get("x", np.zeros(0))
    found: list[tuple[Array, Array, float, str]] = []  # places, values, the largest that is none, and what they are
    if "pretwist" in columns:
        found.append((x, np.abs(columns["pretwist"]), 2.0, "the pretwist is {:.4g} rad"))
    for name in columns.keys() & {"EA", "GJ", "EI", "EI2", "EI3", "GA", "GA2", "GA3", "mass_per_length"}:
        rows = columns[name][::BETWEEN]
        if np.all(rows > 0.0):
            times = np.exp(np.abs(np.diff(np.log(rows))))
            found.append((x[::BETWEEN], times, 30.0, f"{name} changes {{:.3g}} times to the next row"))
    for axis, other in (("2", "z"), ("3", "y")):
        if f"EI{axis}" not in columns:
            continue
        stiff = np.sqrt(columns[f"EI{axis}"] / columns["EA"])
        heavy = np.sqrt(np.abs(columns[f"rotary_inertia{axis}"]) / np.maximum(columns["mass_per_length"], 1e-300))
        apart = np.exp(np.abs(np.log(np.where(heavy > 0.0, heavy / stiff, 1.0))))
        what = f"radii of gyration about axis {axis} of stiffness and mass differ {{:.3g}} times"
        found.append((x, apart, 10.0, what))
        for center in ("mass_center", "tension_center", "shear_center"):
            away = np.abs(columns[f"{center}_{other}"]) / stiff
            found.append((x, away, 4.0, f"{center} lies {{:.3g}} radii of gyration from the axis in {other}"))
    worst = [(where, y, int(np.argmax(y)), what) for where, y, limit, what in found if np.max(y, initial=0.0) > limit]
    return sorted(f"{what.format(y[i])} at x = {where[i]:.4g} m" for where, y, i, what in worst)
