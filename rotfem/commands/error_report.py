"""What the commands report of the error of their results: its contributions, and when they are worth a warning."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.equilibrium import steady_state
from rotfem.analysis.reduced.response import reduced_response
from rotfem.analysis.reduced.tips import largest as largest_of
from rotfem.analysis.schemes import State
from rotfem.analysis.stability import stability_of
from rotfem.analysis.theory_error import RESOLVED, TheoryError
from rotfem.commands.reduced_history import accuracy_of
from rotfem.equations.compiled import compile_system
from rotfem.errors import ComputationError, InputError
from rotfem.mechanics.problem import Problem
from rotfem.numerics.newton import Newton
from rotfem.refinement.coarser import by_itself, on_other_mesh
from rotfem.refinement.discretisation import error_by_cells, error_of_shape, richer_problem
from rotfem.refinement.distance import COLUMNS, OUTPUTS, largest, tip
from rotfem.refinement.estimate import ErrorEstimate, percent
from rotfem.scene import Scene
from rotfem.selection.model_choice import Choice

if TYPE_CHECKING:
    from rotfem.commands.simulation import Simulation

Array = npt.NDArray[np.float64]

#: Contribution to an error below which no warning is given, and the part of it that advised steps aim at.
WANTED, AIM = 0.01, 0.5

#: What the contributions are called that a warning says to be unknown.
UNKNOWN = {"time": "steps", "space": "mesh", "model": "theory"}

#: Part of the sum from which a contribution is named.
NAMED = 0.1


def error_wanted(run: Simulation) -> bool:
    """Return whether a run is to say its error."""
    return run.scene.output.error or run.setting is not None


def error_of_run(run: Simulation) -> ErrorEstimate | None:
    """Return the error of a run so far, relative to the largest displacement of its tip, or what `accuracy_of` names.

    None where it is not wanted, or nothing was computed.
    """
    if not error_wanted(run) or not len(run.record.history):
        return None
    of = output_of(run.scene)
    columns = [values for name, values in run.record.history.arrays().items() if name.startswith(COLUMNS[of])]
    scale = largest(np.column_stack(columns))
    shares: dict[str, float | None] = {"time": None, "space": None}
    found: dict[str, Any] = {"scale": scale}
    if run.reduced is not None:
        shares = {"time": run.reduced.time_error + run.reduced.projection_error, "space": _of_reduced(run, scale)}
    elif run.scene.time is None:
        assert run.last is not None
        space = error_of_shape(run.problem, run.system, run.last.q, lambda s: _resting(run, s), OUTPUTS[of])
        shares = {"time": 0.0, "space": space}
    elif run.companions is not None:
        shares = run.companions.errors(scale)
        found["time_at"] = run.companions.steps.difference[1]
    return ErrorEstimate({**shares, "model": model_share(run.theory_error, run.choice)}, found)


def output_of(scene: Scene) -> str:
    """Return the name of the output whose error a run of a scene estimates."""
    return scene.accuracy_of if scene.accuracy_of in OUTPUTS else "tip"


def _resting(run: Simulation, system: Any) -> Any:
    """Return the equilibrium of a run on another mesh."""
    solver = run.scene.solver
    return steady_state(system, run.problem.motion.speed(0.0), Newton.of(solver), past_limits=solver.past_limits)


def _of_reduced(run: Simulation, scale: float) -> float | None:
    """Return the error of a reduced answer by the mesh: its difference to a reduced answer on another one."""
    own, other = run.reduced, on_other_mesh(run.problem, run.system)
    if not scale > 0.0:
        return 0.0  # nothing moves it, on no mesh
    if own is None or other is None:
        return None
    system, ratio = other
    try:
        start, _ = run.start_of(system)
        there = reduced_response(system, own.times, start, accuracy_of(run.scene))
    except ComputationError:
        return None
    return error_by_cells(largest_of(own.model, there.tips - own.tips) / scale, ratio)


def theory_error_of_run(run: Simulation, history: Mapping[str, Array]) -> TheoryError | None:
    """Return the error of the theory in what was computed so far; None where it is not known, or not wanted.

    Args:
        run: what is computed.
        history: its columns so far.
    """
    if run.foreshortened is not None:
        return run.foreshortened.theory_error()
    if not len(run.record.history):
        return None
    names = run.system.structure.components
    tips = np.array([np.max(np.abs(history[f"tip_{name}"])) for name in names])
    richer = richer_problem(run.problem)
    if richer is None:
        return run.farthest.error(run.system, tips)
    if not error_wanted(run):
        return None
    moves = [i for i, name in enumerate(names) if name.startswith("u")]
    scale = largest(np.column_stack([history[f"tip_{names[i]}"] for i in moves]))
    try:
        found = _apart(run, richer, scale)
    except (ComputationError, InputError):
        return None
    if found is None:
        return None
    system, apart, components = found
    if run.scene.time is None and _buckles(run, system):
        return TheoryError(1.0, "it is above a buckling load that it does not see", run.problem.theory.name)
    base = run.farthest.error(system, tips)
    if base is None:
        return None
    sizes = tips[moves]
    resolved = sizes > RESOLVED * np.max(sizes, initial=0.0)
    own = {f"tip_{names[i]}": d / s for i, d, s, known in zip(moves, components, sizes, resolved, strict=True) if known}
    return base.of_poorer(run.problem.theory, apart, own)


def _apart(run: Simulation, richer: Problem, scale: float) -> tuple[Any, float, Array] | None:
    """Return the system of a richer theory, how far its tip is from the run's, relative, and that by components, m.

    None where that is not known. The difference of equilibria is relative to the smaller displacement.

    Args:
        run: what is computed.
        richer: its problem in the richer theory.
        scale: largest displacement of the run's tip, m.

    Raises:
        ComputationError: there is no answer in that theory.
        InputError: it cannot have what the problem has.
    """
    if run.companions is not None:
        run.companions.steps.finish()
        companion = run.companions.theory
        if companion is None or not companion.sound or not run.companions.steps.sound:
            return None
        return companion.system, _relative(companion.difference[0], scale), np.array(companion.components or ())
    system = compile_system(by_itself(richer), run.system.comm, moving=run.scene.time is not None)
    if run.reduced is not None:
        start, _ = run.start_of(system)
        response = reduced_response(system, run.reduced.times, start, accuracy_of(run.scene))
        moves = [i for i, name in enumerate(run.system.structure.components) if name.startswith("u")]
        differences = (response.tips - run.reduced.tips)[:, moves]
        return system, _relative(largest(differences), scale), np.abs(differences).max(axis=0)
    assert run.last is not None
    own, there = tip(run.system, run.last), tip(system, State.at_rest(system, *system.start(_resting(run, system))))
    smaller = min(float(np.linalg.norm(there)), scale)
    return system, _relative(float(np.linalg.norm(there - own)), smaller), np.abs(there - own)


def _relative(apart: float, scale: float) -> float:
    """Return a difference relative to a scale; all of it where there is no scale."""
    if apart == 0.0:
        return 0.0
    return apart / scale if scale > 0.0 else 1.0


def _buckles(run: Simulation, system: Any) -> bool:
    """Return whether a richer theory has no stable equilibrium where that of a run says it has; its state is set."""
    speed = run.problem.motion.speed(0.0)
    there = stability_of(system, system.held.q.x.array.copy(), speed)
    return there.stable is False and run.stability is not None and run.stability.stable is True


def model_share(theory: TheoryError | None, choice: Choice | None) -> float | None:
    """Return the error by the theory and the effects that a choice has left out; None where it is unknown."""
    own = None if theory is None else theory.estimate
    if choice is None or choice.full:
        return own
    return max(own or 0.0, choice.estimated_error)


def error_of_modes(rows: Iterable[Mapping[str, Any]], theory: TheoryError | None) -> ErrorEstimate:
    """Return the largest relative error of the frequencies of rows."""
    flexible = [row for row in rows if row.get("stability") != "neutral"]
    mesh = [row["mesh_error"] for row in flexible]
    bound = float(max((row["error_bound"] for row in flexible), default=0.0))
    space = None if None in mesh else float(max(mesh, default=0.0))
    return ErrorEstimate({"space": space, "model": None if theory is None else theory.estimate, "round_off": bound})


def warnings_of_run(run: Simulation, error: ErrorEstimate) -> list[str]:
    """Return what is to be said of the error of a run; nothing where that is small, asked for, or said already."""
    scene = run.scene
    tolerance = None if scene.time is None else scene.time.tolerance
    if scene.accuracy is not None:  # what asked for it says what was reached
        return []
    unknown = [word for name, word in UNKNOWN.items() if error.shares[name] is None]
    said = [f"the error by the {' and the '.join(unknown)} is unknown: {_why_unknown(run, error)}"] if unknown else []
    if not error.exceeds(max(WANTED, scene.model.tolerance or 0.0, tolerance or 0.0)):
        return said
    steps, mesh, model = (error.shares[name] or 0.0 for name in ("time", "space", "model"))
    if steps + mesh <= WANTED and run.theory_error is not None and run.theory_error.warning():
        return said
    cures = []
    if steps >= WANTED / 2 and run.stepper is not None:
        cures.append(finer_steps(scene, run.stepper, steps))
    if mesh >= WANTED / 2:
        cures.append("a higher mesh.degree" if scene.structure.mesh_file else "more mesh.elements")
    if model >= WANTED / 2:
        cures.append("a richer theory")
    shares = {"steps": steps, "mesh": mesh, "model": model}
    named = [f"{percent(share)} by the {n}" for n, share in shares.items() if share > NAMED * sum(shares.values())]
    off = f"the tip may be off by {percent(error.total)} of its largest displacement (estimated: {', '.join(named)})"
    return [f"{off}: {', '.join(cures)}" if cures else off, *said]


def _why_unknown(run: Simulation, error: ErrorEstimate) -> str:
    if run.companions is None and error.shares["space"] is None:
        return "there is no other mesh to compare with"
    if run.companions is None or error.shares["time"] is not None:
        return "the same in a richer theory fails"
    if run.companions.steps.sound:
        return "what is prescribed leaves no room for steps of twice the length"
    return "steps of twice the length fail, so that these are hardly short enough"


def finer_steps(scene: Scene, stepper: Any, share: float) -> str:
    """Return which steps would have a contribution that is not noticed."""
    time = scene.time
    assert time is not None
    factor = min(1.0, AIM * WANTED / share)
    if time.tolerance is not None:
        return f"time.tolerance = {time.tolerance * factor:.1g}"
    return f"time.step = {time.step * factor ** (1 / stepper.scheme.order):.1g} or shorter"
