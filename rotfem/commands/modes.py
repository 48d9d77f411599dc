"""`rotfem modes`: gyroscopic eigenmodes of the spinning structure, named and checked.

Small motions e^{λt} x about an equilibrium q̄ at constant speed satisfy (λ² M + λ C + K) x = 0 with M = ∂F/∂a,
C = ∂F/∂v, K = ∂F/∂q at (q̄, 0, 0).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar

from mpi4py import MPI

from rotfem.analysis.modal import ModalAnalysis, Spinning, self_checks
from rotfem.analysis.modal import participation as masses_of
from rotfem.analysis.stability import critical_speed, stability_of_pencil
from rotfem.analysis.theory_error import TheoryError, error_under_load
from rotfem.commands.accuracy import changes_of, first_setting, refuse, to_accuracy
from rotfem.commands.advice import advise, frozen_inputs
from rotfem.commands.error_report import error_of_modes, richer_problem
from rotfem.commands.mode_tables import mode_tables
from rotfem.commands.problem import Problem
from rotfem.commands.processes import communicator, modal_summary
from rotfem.commands.recorder import check_rows
from rotfem.errors import ComputationError, SceneError, input_of
from rotfem.listeners import Hint, silent
from rotfem.mechanics.effects import Work
from rotfem.mechanics.problem import Problem as ProblemData
from rotfem.numerics.newton import Newton
from rotfem.refinement.frequencies import FrequencyErrors
from rotfem.refinement.refine import Clock, Setting
from rotfem.results import ModesResult
from rotfem.results.result import Result
from rotfem.scene import Scene, as_scene

R = TypeVar("R", bound=Result)


def modes(
    scene: Scene | str | Path | Mapping[str, Any],
    *,
    comm: MPI.Comm = MPI.COMM_WORLD,
    sensitivities: bool = False,
    blade_tables: bool = False,
    participation: bool = False,
    hint: Hint | None = silent,
    terms: Mapping[str, Work] | None = None,
) -> ModesResult:
    """Return the modes of a scene at its final speed: that of a spin-up, at the end of [time], or the constant one.

    Args:
        scene: scene, path of a scene file, or nested tables.
        comm: MPI communicator; every rank gets the whole result.
        sensitivities: also compute the derivatives of all eigenvalues to the scene's parameters.
        blade_tables: also write polynomials and tables of the modes of a beam over its span.
        participation: also say modal and effective masses (see `rotfem.analysis.modal`).
        hint: called with every line of advice before the computation starts; None asks for none.
        terms: further terms of the residual by name, (mechanics, variation) ↦ UFL form (see `rotfem.Effect`).

    Raises:
        SceneError: the scene is not valid.
        ComputationError: no equilibrium, or eigenpairs that fail the check of their backward error.
    """
    scene = as_scene(scene)
    if blade_tables and scene.structure.type == "plate":
        raise SceneError(scene.file, "structure.type", "plate", "mode polynomials and tables are those of beams")

    def compute(variant: Scene) -> ModesResult:
        found = _modes(variant, Problem.of(variant, terms=terms), comm, sensitivities, hint)
        found.blade_tables = blade_tables
        if participation:
            masses, found.summary["mass"] = masses_of(found.analysis, found.spinning)
            for row, mass in zip(found.rows[len(found.rows) - len(masses) :], masses, strict=True):
                row |= mass
        return found

    return answered(scene, compute, comm, "modes")


def answered(scene: Scene, compute: Callable[[Scene], R], comm: MPI.Comm, command: str) -> R:
    """Return what a command computes of the modes of a scene, to its accuracy if it has one.

    Args:
        scene: as it was given.
        compute: variant of the scene ↦ result.
        comm: MPI communicator.
        command: the verb.

    Raises:
        SceneError: the scene is not valid for the command.
        ComputationError: see `modes`.
    """

    def attempt(setting: Setting) -> R:
        return compute(scene.replace(changes_of(scene, setting)))

    scene.check_tables("what modes are about" if scene.time is None else "")
    with input_of(scene.file):
        if scene.accuracy is None:
            return compute(scene)
        refuse(scene, ("frequencies",), command)
        return to_accuracy(scene, first_setting(scene, scene.modes.count), attempt, Clock(scene.accuracy_budget, comm))


def _modes(scene: Scene, problem: ProblemData, comm: MPI.Comm, sensitivities: bool, hint: Hint | None) -> ModesResult:
    started = perf_counter()
    analysis = analysis_of(scene, problem, comm)
    speed = problem.motion.final_speed(scene.time.end if scene.time is not None else 0.0)
    hints = hints_of(analysis, scene, hint, speed)
    found = mode_tables(analysis, speed, scene.modes.count, keep=False, formats=scene.output.fields)
    check_rows(found.rows)
    spinning = found.spinning
    stability, off = stability_of_pencil(spinning.pencil, spinning.clamped), theory_error(analysis, spinning)
    warnings = [*frozen_inputs(problem), *analysis.notes, *found.warnings]
    # An instability that grows by more than those of the modes that are asked for is none of them.
    known = 1.001 * max((row["growth"] for row in found.rows if row["stability"] != "neutral"), default=0.0)
    if stability.stable is None or stability.held_by_spin or stability.growth > max(known, 0.0):
        warnings.append(stability.warning())
    warnings += [off.warning()] if off and off.warning() else []
    found.summary = {
        **modal_summary("modes", analysis, scene, started, off),
        "speed": speed,
        "stability": stability.summary(),
        **({"error": error_of_modes(found.rows, off).summary()} if scene.output.error else {}),
        **{name: found.summary[name] for name in ("modes", "shapes")},
        "checks": self_checks(analysis, spinning),
        "warnings": warnings,
        "advice": hints,
    }
    if sensitivities:
        from rotfem.analysis.sensitivity import sensitivities as derivatives

        found.sensitivities = derivatives(analysis, spinning)
    return found


def theory_error(analysis: ModalAnalysis, spinning: Spinning) -> TheoryError | None:
    """Return the error of the frequencies at one speed by the theory; None where it is not known, or not wanted."""
    richer, motion = richer_problem(analysis.problem), analysis.system.held.motion.at_speed(spinning.speed)
    if richer is None:
        return error_under_load(analysis.system.held, motion, spinning.clamped.factor)
    if not analysis.estimates:
        return None
    errors = FrequencyErrors(analysis, richer)
    differences = [error for error in errors(spinning) if error is not None]
    if errors.there is None or len(differences) < len(spinning.pairs.values):
        return None
    own = error_under_load(errors.there.system.held, motion)
    return own.of_poorer(analysis.problem.theory, max(differences, default=0.0), {})


def analysis_of(scene: Scene, problem: ProblemData, comm: MPI.Comm) -> ModalAnalysis:
    """Return the modal analysis that a scene asks for, of a small system each process for itself.

    Raises:
        InputError: more modes are asked for than there are unknowns, or a mesh that cannot be computed with.
    """
    analysis = ModalAnalysis(problem, scene.modes.about, Newton.of(scene.solver), communicator(problem, comm))
    analysis.everyone = comm
    analysis.estimates = scene.output.error
    if "count" in scene.modes.model_fields_set:  # what was not asked for is only an upper limit
        analysis.check_count(scene.modes.count)
    return analysis


def hints_of(analysis: ModalAnalysis, scene: Scene, hint: Hint | None, speed: float) -> list[str]:
    """Return hints about the computation ahead, up to a speed (rad/s), and hand them on."""
    theory, critical = analysis.problem.theory, None
    if hint is not None and theory.linear and not theory.prestress:
        with suppress(ComputationError):  # a hint is worth no failure
            critical = critical_speed(analysis.system)
    return advise(scene, hint, speed, critical)
