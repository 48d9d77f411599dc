"""What the commands say of the error of their results: shares put together, and when they are worth a warning."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from rotfem.analysis.error_estimate import ErrorEstimate, percent
from rotfem.analysis.error_watch import ErrorWatch
from rotfem.analysis.shape_error import ShapeError
from rotfem.analysis.theory_error import TheoryError
from rotfem.commands.ahead import sampled
from rotfem.scene import Scene
from rotfem.selection.mesh_ahead import MeshAhead
from rotfem.selection.model_choice import Choice

if TYPE_CHECKING:
    from rotfem.commands.simulation import Simulation

#: Share that the steps are to have after the change that a warning advises, and the part of it that is aimed at.
WANTED, AIM = 0.01, 0.5

#: Tolerances that adaptive steps are taken to hold.
HELD = 2.0

#: Largest share of the steps: two motions of one size are no farther apart, however many phases are lost.
APART = 2.0

#: Part of the sum from which a share is told.
TELLING = 0.1


def error_of_run(run: Simulation) -> ErrorEstimate | None:
    """Return the error of a run so far; None where it is not wanted, or nothing was computed."""
    if not run.scene.output.error or not len(run.record.history):
        return None
    model = model_share(run.theory_error, run.choice)
    if run.reduced is not None:
        _, _, farthest = run.farthest.seen
        held = run.system.held
        shape = ShapeError(held).of_shape(farthest[: len(held.zeros())])
        time = run.reduced.time_error + run.reduced.projection_error
        return ErrorEstimate({"time": time, "space": max(shape, _of_mesh(run)), "model": model})
    assert run.last is not None
    watch = run.watch or ErrorWatch(run.system)
    tip = watch.errors(run.last, 0.0 if run.theory_error is None else run.theory_error.lacking)
    if model is not None:  # of a shape, and of the phases that vibrations lose
        model += _relative(tip.model[0], tip.scale)
    shares = {
        "time": None if tip.time is None else _of_steps(run.scene, _relative(tip.time[0], tip.scale)),
        "space": min(1.0, tip.shape + _relative(tip.space[0], tip.scale)),
        "model": model,
    }
    found: dict[str, Any] = {"scale": tip.scale}
    if tip.time is not None and run.watch is not None:
        found["time_at"] = tip.time[1]
    if tip.burst is not None:
        found["burst"] = {"at": tip.burst.t, "growth": tip.burst.growth}
    return ErrorEstimate(shares, found)


def _of_mesh(run: Simulation) -> float:
    """Return what the mesh has put off the vibrations of a reduced model by the end, as its spectrum tells it."""
    assert run.reduced is not None
    ahead = MeshAhead.of(run.reduced, run.scene.mesh.elements, run.scene.mesh.degree)
    if ahead is None:
        return 0.0
    motion = sampled(run.reduced, ahead.structure)
    return ahead.error(motion) if motion.tells else 0.0


def _of_steps(scene: Scene, share: float) -> float:
    """Return the share of the steps: of adaptive ones at most HELD tolerances, as they judge every step themselves."""
    share = min(share, APART)
    tolerance = None if scene.time is None else scene.time.tolerance
    return share if tolerance is None else min(share, HELD * tolerance)


def _relative(size: float, scale: float) -> float:
    return size / scale if scale > 0.0 else 0.0


def model_share(theory: TheoryError | None, choice: Choice | None) -> float | None:
    """Return what the theory and the effects that a choice has left out may put off; None where that is unknown."""
    own = None if theory is None else theory.estimate
    if choice is None or choice.full:
        return own
    return max(own or 0.0, choice.estimated_error)


def error_of_modes(rows: Iterable[Mapping[str, Any]], theory: TheoryError) -> ErrorEstimate:
    """Return the largest relative error of the frequencies of rows."""
    flexible = [row for row in rows if row.get("stability") != "neutral"]
    space, bound = (max((row[key] for row in flexible), default=0.0) for key in ("mesh_error", "error_bound"))
    return ErrorEstimate({"space": float(space), "model": theory.estimate, "round_off": float(bound)})


def warnings_of_run(run: Simulation, error: ErrorEstimate) -> list[str]:
    """Return what is to be said of the error of a run; nothing where that is small, asked for, or said already."""
    scene = run.scene
    tolerance = None if scene.time is None else scene.time.tolerance
    if scene.accuracy is not None:  # what asked for it says what was reached
        return []
    if not error.exceeds(max(WANTED, scene.model.tolerance or 0.0, tolerance or 0.0)):
        return []
    steps, mesh, model = (error.shares[name] or 0.0 for name in ("time", "space", "model"))
    if steps + mesh <= WANTED and run.theory_error is not None and run.theory_error.warning():
        return []
    cures = []
    if steps >= WANTED / 2 and run.stepper is not None:
        cures.append(finer_steps(scene, run.stepper, steps))
    if mesh >= WANTED / 2:
        cures.append("more mesh.elements")
    if model >= WANTED / 2:
        cures.append("a richer theory")
    shares = {"steps": steps, "mesh": mesh, "model": model}
    telling = [f"{percent(share)} by the {n}" for n, share in shares.items() if share > TELLING * sum(shares.values())]
    off = f"the tip may be off by {percent(error.total)} of its largest displacement (estimated: {', '.join(telling)})"
    return [f"{off}: {', '.join(cures)}" if cures else off, *_of_burst(error)]


def _of_burst(error: ErrorEstimate) -> list[str]:
    """Return what is to be said of a burst of the motion."""
    if (burst := error.found.get("burst")) is None:
        return []
    quick = f"around t = {burst['at']:.4g} s the structure turns {burst['growth']:.2g} times as quickly as before"
    return [f"{quick}: the error of the steps is told as much larger, but may be several times that, or less"]


def finer_steps(scene: Scene, stepper: Any, share: float) -> str:
    """Return which steps would have a share of the error that is not noticed."""
    time = scene.time
    assert time is not None
    factor = min(1.0, AIM * WANTED / share)
    if time.tolerance is not None:
        return f"time.tolerance = {time.tolerance * factor:.1g}"
    return f"time.step = {time.step * factor ** (1 / stepper.scheme.order):.1g} or shorter"
