"""`rotfem check`: what a scene's structure is, before anything is computed with it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI
from scipy.spatial.transform import Rotation

from rotfem.commands.problem import Problem
from rotfem.commands.processes import communicator
from rotfem.commands.summary import summary
from rotfem.equations.functionals import rigid_body
from rotfem.equations.model import Model
from rotfem.errors import input_of
from rotfem.mechanics.effects import Effect
from rotfem.mechanics.theories import Theory
from rotfem.results import CheckResult
from rotfem.scene import Scene, as_scene
from rotfem.scene.values import Array, evaluate


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
        model = Model(problem, communicator(problem, comm))
        body = rigid_body(model)
        structure = scene.structure
        root = np.array(getattr(structure, "root_position", (structure.hub_radius, 0.0, 0.0)))
        axis = np.array(scene.motion.axis) / np.linalg.norm(scene.motion.axis)
        center = np.array(body.first_moment / body.mass)
        columns = columns_of(structure)
        found: dict[str, Any] = {
            **summary("check", scene, comm, model.structure.mesh.comm),
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


def axes_along(beam: Any, x: Array) -> tuple[Array, Array]:
    """Return (r, T) in the frame: position of the axis (m), (n, 3), and the section axes as columns, (n, 3, 3)."""
    coned = Rotation.from_euler("Y", -beam.precone)
    line = beam.reference_line
    if line is not None:
        position, (chi, zeta) = line.at(x)[0], line.angles(x)
    else:
        chi = zeta = np.zeros(len(x))
        position = x[:, None] * np.eye(3)[0]
    turned = Rotation.from_euler("ZYX", np.column_stack([chi, -zeta, evaluate(beam.pretwist, x)]))
    return np.array(beam.root_position) + coned.apply(position), (coned * turned).as_matrix()


def columns_of(structure: Any, at: Array | None = None) -> dict[str, Array]:
    """Return columns over `x` (m) of a beam, at places (m) or the rows of its tables; none of another structure.

    Of a spatial beam `axis_1` … `axis_3` say where its axis runs in the frame (m), `t1_1` … `t3_3` are components of
    the section axes there, `pretwist` is their angle (rad), and the rest is `central_properties`; of a planar beam they
    are its section.
    """
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
    r, T = axes_along(structure, x)
    matrices = section.at(x)
    return {
        "x": x,
        **{f"axis_{i + 1}": r[:, i] for i in range(3)},
        **{f"t{j + 1}_{i + 1}": T[:, i, j] for j in range(3) for i in range(3)},
        "pretwist": evaluate(structure.pretwist, x),
        **central_properties(matrices["stiffness"], matrices["mass"]),
    }


def doubts(columns: Mapping[str, Array]) -> list[str]:
    """Return what looks like a slip: degrees for radians, another unit, a point that is missing.

    It is a pretwist above 2 rad, a property that changes 30 times from row to row, radii of gyration of stiffness and
    mass 10 times apart, or a centre 4 radii of gyration away.
    """
    out = []
    x = columns.get("x", np.zeros(0))
    if "pretwist" in columns and (most := np.max(np.abs(columns["pretwist"]))) > 2.0:
        out.append(f"the pretwist reaches {most:.4g} rad at x = {x[np.argmax(np.abs(columns['pretwist']))]:.4g} m")
    for name in columns.keys() & {"EA", "GJ", "EI", "EI2", "EI3", "GA", "GA2", "GA3", "mass_per_length"}:
        rows, values = x[::BETWEEN], columns[name][::BETWEEN]
        ratio = np.abs(np.log(values[1:] / values[:-1])) if np.all(values > 0.0) else np.zeros(0)
        if ratio.size and (most := float(np.exp(ratio.max()))) > 30.0:
            i = int(np.argmax(ratio))
            out.append(f"{name} changes {most:.3g} times from x = {rows[i]:.4g} to {rows[i + 1]:.4g} m")
    for axis, other in (("2", "z"), ("3", "y")):
        if f"EI{axis}" not in columns:
            continue
        stiff = np.sqrt(columns[f"EI{axis}"] / columns["EA"])
        heavy = np.sqrt(np.abs(columns[f"rotary_inertia{axis}"]) / columns["mass_per_length"])
        far = np.where(heavy > 0.0, np.maximum(heavy / stiff, stiff / np.where(heavy > 0.0, heavy, 1.0)), 1.0)
        if np.max(far) > 10.0:
            i = int(np.argmax(far))
            out.append(
                f"at x = {x[i]:.4g} m the radius of gyration about axis {axis} is {stiff[i]:.3g} m of the stiffness, "
                f"{heavy[i]:.3g} m of the mass"
            )
        for center in ("mass_center", "tension_center", "shear_center"):
            away = np.abs(columns[f"{center}_{other}"]) / stiff
            if np.max(away) > 4.0:
                i = int(np.argmax(away))
                out.append(
                    f"at x = {x[i]:.4g} m {center} lies {away[i]:.3g} radii of gyration from the axis in {other}"
                )
    return sorted(out)
