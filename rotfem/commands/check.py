"""`rotfem check`: what a scene's structure is, before anything is computed with it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from rotfem.commands.problem import Problem
from rotfem.commands.summary import summary
from rotfem.equations.functionals import rigid_body
from rotfem.equations.model import Model
from rotfem.errors import input_of
from rotfem.mechanics.effects import Effect
from rotfem.mechanics.theories import Theory
from rotfem.results.check import CheckResult
from rotfem.scene import Scene, as_scene
from rotfem.scene.blade_profile import columns_of, doubts


def check(scene: Scene | str | Path | Mapping[str, Any], *, comm: MPI.Comm = MPI.COMM_WORLD) -> CheckResult:
    """Return what the structure of a scene is: mass, centre of mass, moments, inertias, and its properties along it.

    Integrals are those of the bodies that the equations are made of, on the scene's mesh, with all mass that there is,
    whatever effects the scene lists.

    Args:
        scene: scene, path of a scene file, or nested tables.
        comm: MPI communicator; every rank gets the whole result.

    Raises:
        SceneError: the scene is not valid, or a mesh or a section that cannot be computed with.
    """
    started = perf_counter()
    scene = as_scene(scene)
    with input_of(scene.file):
        bringing = [effect.name for effect in Effect.registry if effect.name in ("rotary_inertia", "tip_mass")]
        problem = Problem.of(scene).replace(frame="rotating", effects=tuple(bringing))
        linear = [theory for theory in Theory.registry if theory.linear and theory.holds_for(scene.structure.type)]
        if linear:  # at rest all are the same, and the forms of these are small
            problem = problem.replace(theory=min(linear, key=lambda theory: theory.rank).name)
        model = Model(problem, comm)
        body = rigid_body(model)
        structure = scene.structure
        root = np.array(getattr(structure, "root_position", (structure.hub_radius, 0.0, 0.0)))
        axis = np.array(scene.motion.axis) / np.linalg.norm(scene.motion.axis)
        center = np.array(body.first_moment / body.mass)
        columns = columns_of(structure)
        found: dict[str, Any] = {
            **summary("check", scene, comm),
            "type": structure.type,
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
        return CheckResult(found, columns, coordinates, model.structure.surface())
