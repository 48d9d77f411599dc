"""`rotfem explain`: which effects and which theory a scene calls for, and what each of them changes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from mpi4py import MPI

from rotfem.analysis.fixed_frame import check_rotating
from rotfem.analysis.march import Steps
from rotfem.commands.advice import frozen_inputs
from rotfem.commands.first_state import first_state
from rotfem.commands.modes import modes
from rotfem.commands.problem import Problem, scheme_of
from rotfem.commands.processes import communicator, summary
from rotfem.commands.run import run
from rotfem.errors import ComputationError, SceneError, input_of
from rotfem.listeners import Progress
from rotfem.mechanics.effects import Effect, Work
from rotfem.mechanics.theories import Theory
from rotfem.numerics import forms
from rotfem.numerics.eigenproblem import Pencil
from rotfem.numerics.newton import Newton
from rotfem.refinement.distance import distance, distance_each, of_columns
from rotfem.refinement.explain import MODES, RESOLVED, Case, Change, Explanation
from rotfem.results import ExplainResult
from rotfem.scene import Scene, as_scene

Array = npt.NDArray[np.float64]

#: What follows from the size of a change: for an effect or a richer theory, and for a poorer theory.
NEEDED = {"negligible": "not needed", "noticeable": "needed where {:.1%} matters", "large": "needed"}
ENOUGH = {"negligible": "good enough", "noticeable": "good to {:.1%}", "large": "not good enough"}

#: The same of steps.
FINE = {"negligible": "fine enough", "noticeable": "in error by {:.1%}", "large": "too coarse: in error by {:.1%}"}

#: What the notes of a check are marked with.
FULL = " of the full model"


def explain(
    scene: Scene | str | Path | Mapping[str, Any],
    *,
    check: bool = False,
    comm: MPI.Comm = MPI.COMM_WORLD,
    progress: Progress | None = None,
    terms: Mapping[str, Work] | None = None,
) -> ExplainResult:
    """Return how much every effect and every theory changes the outputs of a scene.

    Args:
        scene: scene, path of a scene file, or nested tables.
        check: also run the full models of every row, so that the true change stands next to the estimate.
        comm: MPI communicator; every rank gets the whole result.
        progress: called with the share of the work done, between 0 and 1.
        terms: further terms of the residual by name, in every model, (mechanics, variation) ↦ UFL form.

    Raises:
        SceneError: the scene is not valid, or a check is asked for with terms that are not registered.
    """
    scene = as_scene(scene)
    if check and terms:
        raise SceneError(scene.file, "--check", None, "runs the scene's own models; register the terms as effects")
    with input_of(scene.file):
        case = case_of(scene, terms)
        of = Explanation(case, communicator(case.problem, comm))
        return _explained(scene, of, check, progress or (lambda share: None), comm)


def case_of(scene: Scene, terms: Mapping[str, Work] | None = None) -> Case:
    """Return the case of a scene: its problem, and what is to be computed of it."""
    time, unsteady = scene.time, ""
    try:
        scene.check_run()
    except SceneError as error:
        unsteady = str(error)

    def first(system: Any) -> tuple[Any, Any]:
        start = first_state(scene, system.model.problem, system, judged=False)
        return start.q, start.v

    problem = Problem.of(scene, terms=terms)
    check_rotating(problem, "explain")
    return Case(
        problem=problem,
        steps=None if time is None else Steps.of(time),
        scheme=None if time is None else scheme_of(time),
        first=first,
        mode_count=scene.modes.count,
        about=scene.modes.about,
        newton=lambda: Newton.of(scene.solver),
        unsteady=unsteady,
    )


def _explained(scene: Scene, of: Explanation, check: bool, progress: Progress, comm: MPI.Comm) -> ExplainResult:
    started, theory = perf_counter(), of.problem.theory
    changes = of.all()
    spent = {"estimate": perf_counter() - started, "check": 0.0}
    if check:
        check_changes(scene, of, changes, progress)
        spent["check"] = perf_counter() - started - spent["estimate"]
    numbers = groups(of)
    rows = [{**item.row(), "why": why(item, theory)} for item in changes]
    result: dict[str, Any] = {
        **summary("explain", scene, comm, of.system.comm),
        "theory": theory.name,
        "effects": list(of.own),
        "groups": numbers,
        "meaning": {name: MEANING[name] for name in numbers},
        "outputs": list(of.wanted),
        "resolution": RESOLVED,
        "absent_outputs": of.absent,
        "absent_effects": {e.name: e.reasons[1] for e in Effect.registry if e.name not in of.effects},
        "rows": rows,
        "speeds": [of.speed],
        "warnings": doubts(scene, of),
        "timings": {**spent, "total": sum(spent.values())},
    }
    return ExplainResult(result, rows)


def doubts(scene: Scene, of: Explanation) -> list[str]:
    """Return warnings about what the estimates are of."""
    out = [f"{name} of {of.problem.theory.name} cannot be computed: {what}" for name, what in of.failed.items()]
    if MODES in of.wanted:
        out += [f"modes: {line}" for line in frozen_inputs(of.problem)]
    if scene.model.frame == "inertial":
        out.append("estimates are of the rotating frame, where the same physics is a sum of effects")
    return out


def why(item: Change, own: Theory) -> str:
    """Return in a few words why an effect or theory is in a model or not, and whether it has to be.

    Args:
        item: the change it makes.
        own: theory of the model.
    """
    failed = "".join(f"; {name}: {text}" for name, text in item.notes.items() if FULL not in name)
    if item.verdict == "unknown":
        return ("the error is unknown" if item.kind == "discretisation" else "these steps do not show it") + failed
    if item.kind == "effect":
        reason = Effect.registry[item.name].reasons[0]
        if not item.included:
            reason += ", but it is not in model.effects"
        return f"{reason}; {NEEDED[item.verdict].format(item.worst)}{failed}"
    if item.kind == "discretisation":
        return FINE[item.verdict].format(item.worst)
    poorer = Theory.registry[item.name].rank < own.rank
    return (ENOUGH if poorer else NEEDED)[item.verdict].format(item.worst) + failed


# --- the truth ------------------------------------------------------------------------------------------------------


def check_changes(scene: Scene, of: Explanation, changes: list[Change], progress: Progress) -> None:
    """Write the true change into every row: both models run as the scene says, on its own mesh with its own steps.

    Args:
        scene: as it was given; it runs in the rotating frame with the model of each row.
        of: the changes.
        changes: the rows.
        progress: called with the share of the rows that are done.
    """
    increment = min(1e-10, scene.solver.increment_tolerance)  # small differences are wanted
    exact = {"model.frame": "rotating", "solver.increment_tolerance": increment}
    scene = scene.replace({**exact, "model.effects": list(of.own), "output.error": False})
    own, own_notes = full_outputs(scene, of)
    for i, item in enumerate(changes, start=1):
        if item.name == "time.tolerance":
            continue  # adaptive steps have no common times
        if item.kind == "discretisation":
            other = finer(scene, item.name)
        elif item.kind == "effect":
            kept = set(of.own) ^ {item.name}
            other = scene.replace({"model.effects": [name for name in of.effects if name in kept]})
        else:
            prestress = scene.model.prestress if Theory.registry[item.name].prestress else None
            other = scene.replace({"model.theory": item.name, "model.prestress": prestress})
        there, notes = full_outputs(other, of)
        for name, x in own.items():
            apart = distance_each if name == MODES else distance
            item.truth[name] = np.inf if x is None or there[name] is None else apart(x, there[name])
        item.notes |= {f"{name}{FULL}": text for name, text in (own_notes | notes).items()}
        progress(i / len(changes))


def finer(scene: Scene, name: str) -> Scene:
    """Return a scene with shorter steps and rows where they were, or on a finer mesh; of a file, of a higher degree."""
    time = scene.time
    if name == "time.step" and time is not None and time.step is not None:
        return scene.replace({"time.step": time.step / 4, "time.output_every": time.output_every * 4})
    if scene.structure.mesh_file is not None:
        return scene.replace({"mesh.degree": scene.mesh.degree + 1})
    elements = scene.mesh.elements
    return scene.replace({"mesh.elements": [2 * n for n in elements] if isinstance(elements, tuple) else 2 * elements})


def full_outputs(scene: Scene, of: Explanation) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the outputs of a scene as `rotfem run` and `rotfem modes` give them, None of what fails, and why.

    Modes are those at the speed of the explanation.
    """
    comm, out, notes = of.system.comm, dict[str, Any](), dict[str, str]()
    turning = scene.replace({"motion.speed": of.speed}) if of.problem.motion.hub is not None else scene
    for name in of.wanted:
        try:
            if name == MODES:
                rows = modes(turning, comm=comm).rows  # no rigid body, of an overdamped mode the slow one
                kept = [r for r in rows if r["label"] != "rigid body" and not r["label"].endswith(", fast")]
                out[name] = np.array([complex(row["growth"], row["frequency"]) for row in kept])
            else:
                history = run(scene, comm=comm).history
                out[name] = of_columns("tip", history, of.system.structure)
        except ComputationError as error:
            out[name], notes[name] = None, error.what
    return out, notes


# --- dimensionless numbers --------------------------------------------------------------------------------------------

#: What each number is, in words and symbols.
MEANING = {
    "speed_ratio": "Ω/ω₁, largest speed to first frequency at rest",
    "slenderness": "L/r, length to radius of gyration of the section at the clamp",
    "deflection": "largest tip displacement/L",
    "rotation": "largest displacement/L or rotation in rad",
    "hub_ratio": "R/L, hub radius to length",
    "spin_rate_change": "largest |dΩ/dt|/ω₁²",
    "damping": "ζ, damping ratio of the first mode",
    "tip_mass_ratio": "tip (or other added) mass/mass of the structure",
    "steps_per_period": "time steps per period of the last of modes.count modes",
}


def groups(of: Explanation) -> dict[str, float]:
    """Return name ↦ number, those that a case has; `MEANING` says what they are.

    Args:
        of: its changes, which were computed.
    """
    case, system = of.case, of.system
    structure, values = case.problem.structure, of.values
    # Neither a mesh file's plate nor any other structure need have a length of its own.
    length = float(getattr(structure, "length", None) or system.structure.length)
    at_rest = _frequencies_at_rest(of)
    first = float(at_rest[0]) if at_rest.size else 0.0
    speeds, rates = _turning(case, system)
    out = {"speed_ratio": float(np.abs(speeds).max()) / first} if first > 0.0 else {}
    if system.structure.radius > 0.0:
        out["slenderness"] = length / system.structure.radius
    if of.size > 0.0:
        out |= {"deflection": of.scale / length, "rotation": of.size}
    root = getattr(structure, "root_position", structure.hub_radius)
    out["hub_ratio"] = float(np.linalg.norm(root)) / length
    if first > 0.0:
        out["spin_rate_change"] = float(np.abs(rates).max()) / first**2
    if np.any(values[:1]) and not structure.damping.is_zero:
        out["damping"] = float(-values[0].real / abs(values[0]))
    if structure.has_tip_mass:
        out["tip_mass_ratio"] = _added_mass(system, "tip_mass")
    if case.steps is not None and case.steps.step is not None and (at_rest.size or len(values)):
        fastest = float(np.abs(values).max()) if len(values) else float(at_rest[-1])
        out["steps_per_period"] = 2 * np.pi / fastest / case.steps.step
    return out


def _frequencies_at_rest(of: Explanation) -> Array:
    """Return the frequencies (rad/s) of the resting structure, its hub held; none where they cannot be computed."""
    held = of.system.held
    held.set_time(0.0, of.problem.motion.at_speed(0.0))
    held.set_state(held.zeros())
    try:
        return np.sort(np.abs(Pencil(*held.mass_damping_stiffness()).solve(max(2, of.case.mode_count)).resolved))
    except ComputationError:
        return np.empty(0)


def _turning(case: Case, system: Any) -> tuple[Array, Array]:
    """Return Ω and dΩ/dt at some times of the motion; of a free hub those of the rigid structure."""
    motion, end = case.problem.motion, case.steps.end if case.steps is not None else 0.0
    times = np.linspace(0.0, max(end, motion.settled), 401)
    if motion.hub is None:
        return np.array([motion.speed(t) for t in times]), np.array([motion.rate(t) for t in times])
    speeds = motion.hub.rigid_speeds(np.asarray(times), system.row.rest_inertia())
    return speeds, np.gradient(speeds, times) if end else np.zeros(len(times))


def _added_mass(system: Any, effect: str) -> float:
    """Return the masses that an effect brings, as a share of the mass of the structure without them."""
    switch = system.structure.constant(1.0)
    bodies = [b for b in system.structure.bodies((effect,)) if b.is_position]
    mass = forms.form(sum((switch if b.effect == effect else 1.0) * b.density * b.measure for b in bodies), once=True)

    def total() -> float:
        return float(system.comm.allreduce(float(fem.assemble_scalar(mass))))

    whole = total()
    switch.value = 0.0
    return whole / total() - 1.0
