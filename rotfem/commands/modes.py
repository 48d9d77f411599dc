"""`rotfem modes`: gyroscopic eigenmodes of the spinning structure, named and checked.

Small motions e^{λt} x about an equilibrium q̄ at constant speed satisfy (λ² M + λ C + K) x = 0 with M = ∂F/∂a,
C = ∂F/∂v, K = ∂F/∂q at (q̄, 0, 0).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from time import perf_counter
from typing import TypeVar

from mpi4py import MPI

from rotfem.accuracy.answer import Setting
from rotfem.accuracy.errors import Errors, warnings_of
from rotfem.accuracy.modes import Modes, modal_answers, modal_errors
from rotfem.analysis.modal import ModalAnalysis, self_checks
from rotfem.analysis.modal import participation as masses_of
from rotfem.analysis.stability import critical_speed
from rotfem.commands.advice import advise, beyond, frozen_inputs
from rotfem.commands.answers import check_of, clock_of, to_accuracy
from rotfem.commands.mode_tables import doubtful, mode_tables
from rotfem.commands.problem import Problem
from rotfem.commands.processes import communicator, modal_summary
from rotfem.commands.recorder import check_rows
from rotfem.errors import ComputationError, SceneError, input_of
from rotfem.listeners import Compiling, Hint, cpu_time, silent
from rotfem.mechanics.effects import Work
from rotfem.mechanics.problem import Problem as ProblemData
from rotfem.numerics.newton import Newton
from rotfem.results.modes import WORST_FIT, ModesResult
from rotfem.results.result import Result
from rotfem.results.result_set import Writer
from rotfem.scene import Scene

R = TypeVar("R", bound=Result)


def analysed(
    scene: Scene,
    comm: MPI.Comm,
    sensitivities: bool = False,
    blade_tables: bool = False,
    participation: bool = False,
    hint: Hint | None = silent,
    terms: Mapping[str, Work] | None = None,
) -> ModesResult:
    """Return the modes of a scene (see `rotfem.modes`)."""
    if blade_tables and scene.structure.type == "plate":
        raise SceneError(scene.file, "structure.type", "plate", "mode polynomials and tables are those of beams")

    def compute(variant: Scene, errors: Errors | None = None, known: Modes | None = None) -> ModesResult:
        found = _modes(variant, Problem.of(variant, terms=terms), comm, hint, errors, known)
        found.blade_tables = blade_tables
        if blade_tables:
            fitted = {row["mode"] for row in found.mode_polynomials()}
            if names := ", ".join(row["label"] for row in found.rows if row["mode"] not in fitted):
                why = f"none of degree 6 is within {100 * WORST_FIT:g} % of its flap, lag or twist"
                found.summary["warnings"].append(f"no mode polynomial of {names}: {why}")
        if sensitivities:
            from rotfem.analysis.sensitivity import sensitivities as derivatives

            found.sensitivities = derivatives(found.analysis, found.spinning)
        if participation:
            masses, found.summary["mass"] = masses_of(found.analysis, found.spinning)
            for row, mass in zip(found.rows[len(found.rows) - len(masses) :], masses, strict=True):
                row |= mass
        return found

    return answered(scene, compute, comm, terms)


def at_speed(scene: Scene, speed: float) -> Scene:
    """Return a scene whose modes are those at a speed, rad/s."""
    if scene.motion.type in ("constant", "spin_up"):
        return scene.replace({"motion.speed": speed})
    if scene.motion.is_free:
        raise SceneError(scene.file, "motion.type", scene.motion.type, "has no speed that could be given")
    kept = {
        name: scene.tables["motion"][name] for name in ("axis", "base_acceleration") if name in scene.tables["motion"]
    }
    return scene.replace({"motion": {"type": "constant", "speed": speed, **kept}})


def models(scene: Scene, result: ModesResult, state_space: bool, matrices: bool) -> list[Writer]:
    """Return what writes the modal model and the matrices of modes."""
    from rotfem.analysis.state_space import serial, write_matrices
    from rotfem.analysis.state_space import state_space as reduced

    further: list[Writer] = []
    with input_of(scene.file):
        if state_space:
            model = reduced(result.analysis, result.spinning, scene.modes.count)
            further.append(lambda folder: model.write(folder / "state_space.npz"))
        if matrices:
            serial(result.analysis, "the export of matrices")
            further.append(lambda folder: write_matrices(result.analysis, result.spinning, folder))
    return further


def final_speed(scene: Scene, problem: ProblemData) -> float:
    """Return the speed of the modes and the response of a scene, rad/s."""
    return problem.motion.final_speed(scene.time.end if scene.time is not None else 0.0)


def answered(
    scene: Scene, compute: Callable[..., R], comm: MPI.Comm, terms: Mapping[str, Work] | None, top: bool = False
) -> R:
    """Return what a command computes of a scene, with the setting that its accuracy leads to if it has one.

    Args:
        scene: of modes.
        compute: (scene) ↦ result; or (scene, errors, modes) of a setting that was found to be within the accuracy.
        comm: processes.
        terms: see `rotfem.modes`.
        top: whether the accuracy is that of the modes at the highest speed, or else at the final one.
    """
    with input_of(scene.file):
        if scene.accuracy is None:
            return compute(scene)
        check_of(scene, ("frequencies",), "modes and campbell")
        problem = Problem.of(scene, terms=terms)
        end = None if scene.time is None else scene.time.end
        speed = problem.motion.top_speed(end) if top else final_speed(scene, problem)
        answers = modal_answers(scene, analysis_of(scene, problem.spinning() if top else problem, comm, False), speed)

        def finish(found: Modes, errors: Errors) -> R:
            problem = found.analysis.problem
            elements = None if problem.structure.mesh_file else problem.mesh.elements
            setting = Setting(problem.theory.name, elements, problem.mesh.degree)
            return compute(answers.variant(setting).replace({"output.error": None}), errors, found)

        return to_accuracy(answers, "frequencies", clock_of(scene, comm), comm, finish)


def _modes(
    scene: Scene,
    problem: ProblemData,
    comm: MPI.Comm,
    hint: Hint | None,
    errors: Errors | None = None,
    known: Modes | None = None,
) -> ModesResult:
    started, began = perf_counter(), cpu_time() - Compiling.seconds
    analysis = analysis_of(scene, problem, comm) if known is None else known.analysis
    speed = final_speed(scene, problem)
    hints = hints_of(analysis, scene, hint, speed)
    spinning = analysis.at(speed, scene.modes.count) if known is None else known.spinning
    # matrices last where other modes are computed after these
    found = mode_tables(spinning, scene.modes.count, formats=scene.output.fields)
    seconds = cpu_time() - Compiling.seconds - began
    check_rows(found.rows)
    held = beyond(problem, [speed], [row["frequency"] for row in found.rows])
    warnings = [*frozen_inputs(problem), *held, *found.summary["warnings"]]
    if scene.output.error and errors is None:
        errors = modal_errors(scene, analysis, found.spinning, seconds=seconds)
    if errors is not None:
        rigid = len(found.rows) - len(found.spinning.pairs.values)
        for row, error in zip(found.rows, [*[0.0] * rigid, *errors.each], strict=False):
            row["mesh_error"] = error
        if known is None:
            warnings += warnings_of(errors, Setting.of(scene, moving=False), scene)
        found.summary |= {"error": errors.summary(), "settings": errors.rows}
    found.summary |= {
        **modal_summary("modes", analysis, scene, started),
        "checks": self_checks(found.spinning),
        "warnings": warnings + doubtful(found.rows),
        "advice": hints,
    }
    return found


def analysis_of(scene: Scene, problem: ProblemData, comm: MPI.Comm, counted: bool = True) -> ModalAnalysis:
    """Return the modal analysis that a scene asks for, of a small system each process for itself."""
    analysis = ModalAnalysis(problem, scene.modes.about, Newton.of(scene.solver), communicator(problem, comm))
    analysis.everyone = comm
    if counted and "count" in scene.modes.model_fields_set:  # what was not asked for is only an upper limit
        analysis.check_count(scene.modes.count)
    return analysis


def hints_of(analysis: ModalAnalysis, scene: Scene, hint: Hint | None, speed: float) -> list[str]:
    """Return hints about the computation ahead, up to a speed (rad/s), and hand them on."""
    theory, critical = analysis.problem.theory, None
    if hint is not None and theory.linear and not theory.prestress:
        with suppress(ComputationError):  # a hint is worth no failure
            critical = critical_speed(analysis.system)
    return advise(scene, hint, speed, critical)
