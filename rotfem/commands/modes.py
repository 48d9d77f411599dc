"""`rotfem modes`: gyroscopic eigenmodes of the spinning structure, named and checked.

Small motions e^{λt} x about an equilibrium q̄ at constant speed satisfy (λ² M + λ C + K) x = 0 with M = ∂F/∂a,
C = ∂F/∂v, K = ∂F/∂q at (q̄, 0, 0).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.analysis.equilibrium import check_steady, critical_speed
from rotfem.analysis.modal import PURE, ModalAnalysis, Spinning, stability
from rotfem.analysis.mode_checks import self_checks
from rotfem.commands.problem import Problem, case_of
from rotfem.commands.summary import modal_summary
from rotfem.errors import input_of
from rotfem.listeners import Hint, silent
from rotfem.mechanics.effects import Work
from rotfem.mechanics.problem import Problem as ProblemData
from rotfem.mechanics.theories import richest
from rotfem.numerics.newton import Newton
from rotfem.results import ModesResult
from rotfem.scene import Scene, as_scene
from rotfem.scene.advice import advise
from rotfem.selection.distance import MODES
from rotfem.selection.model_choice import choose
from rotfem.structures.paraview import writer

Array = npt.NDArray[Any]


def modes(
    scene: Scene | str | Path | Mapping[str, Any],
    *,
    comm: MPI.Comm = MPI.COMM_WORLD,
    sensitivities: bool = False,
    hint: Hint | None = silent,
    terms: Mapping[str, Work] | None = None,
) -> ModesResult:
    """Return the modes of a scene at its final speed: that of a spin-up, at the end of [time], or the constant one.

    Args:
        scene: scene, path of a scene file, or nested tables.
        comm: MPI communicator; every rank gets the whole result.
        sensitivities: also compute the derivatives of all eigenvalues to the scene's parameters.
        hint: called with every line of advice before the computation starts; None asks for none.
        terms: further terms of the residual by name, (mechanics, variation) ↦ UFL form (see `rotfem.Effect`).

    Raises:
        SceneError: the scene is not valid, or has no steady state.
        ComputationError: no equilibrium, or eigenpairs that fail the check of their backward error.
    """
    started = perf_counter()
    scene = as_scene(scene)
    with input_of(scene.file):
        return _modes(scene, Problem.of(scene, terms=terms), comm, sensitivities, (hint, started))


def _modes(
    scene: Scene, problem: ProblemData, comm: MPI.Comm, sensitivities: bool, around: tuple[Hint | None, float]
) -> ModesResult:
    (hint, started), choice = around, None
    if scene.modes.about == "steady":
        check_steady(problem)
    if scene.model.tolerance is not None:
        choice = choose(case_of(scene).replace(problem=problem), (MODES,), comm=comm)
        problem = choice.applied(problem)
    analysis = analysis_of(scene, problem, comm)
    speed = problem.motion.final_speed(scene.time.end if scene.time is not None else 0.0)
    hints = hints_of(analysis, scene, "modes", hint, speed)
    spinning = analysis.at(speed, scene.modes.count, keep=False)
    flexible = scene.modes.count - int(spinning.rigid)
    spinning.pairs = spinning.pairs.select(np.arange(min(flexible, len(spinning.pairs.values))))
    rows = mode_rows(analysis, spinning)
    checks = self_checks(analysis, spinning)
    warnings = [] if choice is not None else advice(analysis, speed)
    warnings += [*unstiffened(analysis, speed, rows), *instabilities(rows)]
    rows = [{**row, "mode": row["mode"] + spinning.rigid} for row in rows]
    shapes = {f"mode {row['mode']}: {row['label']}": scaled_shape(analysis, spinning, i) for i, row in enumerate(rows)}
    if spinning.rigid:
        rows = [rigid_row(rows), *rows]
    summary = {
        **modal_summary("modes", analysis, scene, choice, started),
        "speed": speed,
        "modes": rows,
        "checks": checks,
        "warnings": warnings,
        "advice": hints,
    }
    structure, right = analysis.structure, spinning.pairs.right
    result = ModesResult(summary, rows, shapes, triangles=structure.surface(), analysis=analysis, spinning=spinning)
    if result.triangles is not None:
        first = 1 + int(spinning.rigid)
        states = [(float(first + i), scaled(comm, right[:, i])) for i in range(right.shape[1])]
        result.fields = writer(analysis.system.V, "modes", states)
    if sensitivities:
        from rotfem.analysis.sensitivity import sensitivities as derivatives

        result.sensitivities = derivatives(analysis, spinning)
    return result


def analysis_of(scene: Scene, problem: ProblemData, comm: MPI.Comm) -> ModalAnalysis:
    """Return the modal analysis that a scene asks for.

    Raises:
        InputError: more modes are asked for than there are unknowns, or a mesh that cannot be computed with.
    """
    analysis = ModalAnalysis(problem, scene.modes.about, Newton.of(scene.solver), comm)
    if "count" in scene.modes.model_fields_set:  # what was not asked for is only an upper limit
        analysis.check_count(scene.modes.count)
    return analysis


def hints_of(analysis: ModalAnalysis, scene: Scene, command: str, hint: Hint | None, speed: float) -> list[str]:
    """Return hints about the computation ahead, up to a speed (rad/s), and hand them on."""
    theory, critical = analysis.problem.theory, None
    if hint is not None and theory.linear and not theory.prestress:
        critical = critical_speed(analysis.system)
    return advise(scene, command, hint, speed, critical)


def mode_rows(analysis: ModalAnalysis, spinning: Spinning) -> list[dict[str, Any]]:
    """Return one row a mode: frequency (rad/s, Hz), damping ratio, growth (1/s), label, shares, backward error."""
    shares, names, turning = analysis.shares(spinning), analysis.names(spinning), analysis.turning(spinning)
    rows = []
    for i, (lam, error) in enumerate(zip(spinning.pairs.values, spinning.pairs.errors, strict=True)):
        size = abs(lam)
        rows.append(
            {
                "mode": i + 1,
                "label": names[i],
                "frequency": float(lam.imag),
                "frequency_hz": float(lam.imag / (2 * np.pi)),
                "damping": float(-lam.real / size) if size > 0 else 0.0,
                "growth": float(lam.real),
                "stability": stability(lam),
                **{f"share_{name}": float(share[i]) for name, share in shares.items()},
                **({"turning": turning[i]} if turning else {}),
                "residual": float(error),
            }
        )
    return rows


def rigid_row(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the row of the rigid-body mode: hub and structure turn together, λ = 0."""
    row: dict[str, Any] = dict.fromkeys(rows[0] if rows else (), 0.0)
    return {**row, "mode": 1, "label": "rigid body", "stability": "neutral", "share_hub": 1.0}


def instabilities(rows: list[dict[str, Any]]) -> list[str]:
    """Return a warning for every unstable mode."""
    return [
        f"{row['stability']}: {row['label']} grows as exp({row['growth']:.6g} t)"
        for row in rows
        if row["stability"] not in ("stable", "neutral")
    ]


def advice(analysis: ModalAnalysis, speed: float) -> list[str]:
    """Return warnings about the model: a rotating-frame frequency without Coriolis forces is not one."""
    if speed != 0.0 and "coriolis" not in analysis.model.effects:
        return [
            "coriolis is not among model.effects: frequencies in the rotating frame are wrong without it, and ω² can "
            "come out negative"
        ]
    return []


def unstiffened(analysis: ModalAnalysis, speed: float, rows: list[dict[str, Any]]) -> list[str]:
    """Return a warning if modes are among the rows whose stiffening by the spin the theory does not hold."""
    families, theory = analysis.structure.unstiffened, analysis.problem.theory
    found = sorted({row["label"] for row in rows for f in families if row.get(f"share_{f}", 0.0) > PURE})
    if speed == 0.0 or theory.exact or not found:
        return []
    return [
        f"{', '.join(found)}: the strains of {theory.name} for this structure leave out the stiffening of such modes "
        f'by the spin, so their frequencies are too low; model.theory = "{richest().name}" has it'
    ]


def scaled(comm: MPI.Comm, x: Array) -> Array:
    """Return an eigenvector (owned unknowns) whose largest entry, over all ranks, is 1."""
    largest = x[np.argmax(np.abs(x))] if x.size else 0.0
    return np.asarray(x / max(comm.allgather(complex(largest)), key=abs))


def scaled_shape(analysis: ModalAnalysis, spinning: Spinning, i: int) -> dict[str, Array]:
    """Return a mode shape along the structure: x (m) and the real and imaginary part of each component, largest 1."""
    coordinates, values = analysis.shape(spinning.pairs.right[:, i])
    peak = values.ravel()[np.argmax(np.abs(values))]
    values = values / peak
    columns: dict[str, Array] = dict(coordinates)
    for c, name in enumerate(analysis.structure.components):
        columns[name], columns[f"{name}_imag"] = values[:, c].real, values[:, c].imag
    return columns
