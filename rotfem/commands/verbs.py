"""The verbs on a scene, as a script calls them; `rotfem.commands.cli` makes a command of each, with the same keywords.

A keyword is an option of the same name, its help is what the docstring says of it. FEniCSx is imported when a verb is
called.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from inspect import Parameter, getdoc, signature
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, TypeVar, Unpack

from rotfem.commands.console import Job, Session
from rotfem.errors import ComputationError, InputError, SceneError, Stopped, input_of
from rotfem.listeners import Hint, Progress, silent
from rotfem.scene import Scene
from rotfem.scene.scene import as_scene
from rotfem.units import seconds_of, split_unit

if TYPE_CHECKING:
    from mpi4py import MPI

    from rotfem.commands.cost import CostResult
    from rotfem.mechanics.effects import Work
    from rotfem.mechanics.problem import Functional
    from rotfem.results.campbell import CampbellResult
    from rotfem.results.modes import ModesResult, ResponseResult
    from rotfem.results.of_scene import CheckResult, ExplainResult
    from rotfem.results.result_set import Writer
    from rotfem.results.run import RunResult
    from rotfem.results.unbalance import UnbalanceResult

F = TypeVar("F", bound=Callable[..., Any])
AnyScene = Scene | str | Path | Mapping[str, Any]

#: Name ↦ verb, in the order of the help.
VERBS: dict[str, Callable[..., Any]] = {}

#: Keywords of a script alone.
OF_SCRIPTS = ("comm", "session", "progress", "hint", "terms", "outputs")

#: Defaults of common keywords that are not None, or False of a yes or no.
DEFAULTS = {"plots": True, "hint": silent}


class Common(TypedDict, total=False):
    """Keywords of all verbs on a scene.

    Args:
        folder: result folder; of a command results/<scene name>/<command>, of a script none.
        plots: write figures into the folder.
        report: write report.html, a page that shows all of it.
        trust: let the scene run the Python files it names.
        comm: MPI communicator; every rank gets the whole result.
        session: of the command line, which prints.
    """

    folder: str | Path | None
    plots: bool
    report: bool
    trust: bool
    comm: MPI.Comm | None
    session: Session | None


class Computing(Common, total=False):
    """Keywords of verbs that compute what a scene asks for.

    Args:
        accuracy: relative error wanted: the rest follows from it.
        budget: CPU time that an accuracy may take: 60s, 2min, 1h.
        hint: called with every line of advice before the computation starts; None asks for none.
        terms: further terms of the residual by name, (mechanics, variation) ↦ UFL form (see `rotfem.Effect`).
    """

    accuracy: float | None
    budget: float | str | None
    hint: Hint | None
    terms: Mapping[str, Work] | None


def verb(function: F) -> F:
    """Make a verb of a function: its signature shows the common keywords, too."""
    *own, last = signature(function).parameters.values()
    shared = Computing if "Computing" in last.annotation else Common
    kinds = {name: getattr(kind, "__forward_arg__", kind) for name, kind in shared.__annotations__.items()}
    defaults = {name: DEFAULTS.get(name, False if kind == "bool" else None) for name, kind in kinds.items()}
    common = [Parameter(n, Parameter.KEYWORD_ONLY, default=defaults[n], annotation=kind) for n, kind in kinds.items()]
    vars(function)["__signature__"] = signature(function).replace(parameters=[*own, *common])
    VERBS[function.__name__] = function
    return function


def described(function: Callable[..., Any]) -> dict[str, str]:
    """Return keyword of a verb ↦ what its docstring says of it."""
    texts = [getdoc(part) or "" for part in (Common, Computing, function)]
    found = [entry for text in texts for entry in re.findall(r"^    (\w+): (.*(?:\n {8}.*)*)", text, re.MULTILINE)]
    return {name: " ".join(said.split()) for name, said in found}


def asked(accuracy: float | None, budget: float | str | None, error: bool | str) -> dict[str, Any]:
    """Return the changes of a scene that keywords ask for."""
    given = {
        "accuracy": accuracy,
        "accuracy_budget": None if budget is None else seconds_of(budget, "command line", "--budget"),
        "output.error": None if error else False,
    }
    return {key: value for key, value in given.items() if value is not None}


@contextmanager
def begun(name: str, scene: AnyScene, common: Computing | Common, error: bool | str = True) -> Iterator[Job]:
    """Give a verb its scene, with what its keywords change, and its folder, into which results of a failure go."""
    given: Computing = {**common}
    job: Job | None = given.get("session")
    if job is None:
        job = Job(given.get("comm"), given.get("plots", True), given.get("report", False))
        job.scene = as_scene(scene, given.get("trust", False))
        if changes := asked(given.get("accuracy"), given.get("budget"), error):
            job.scene = job.scene.replace(changes)
        if (folder := given.get("folder")) is not None:
            job.open(Path(folder), name)
        elif job.report:
            raise InputError("folder", None, "must be given, for report.html")
    try:
        yield job
    except BaseException as failure:
        if isinstance(failure, ComputationError | Stopped) and failure.result is not None:
            job.finish(failure.result)
        job.close(failure)
        raise
    job.close(None)


# --- the verbs --------------------------------------------------------------------------------------------------------


@verb
def run(
    scene: AnyScene,
    *,
    checkpoint: str | int | None = None,
    resume: bool = False,
    error: bool | str = True,
    progress: Progress | None = None,
    outputs: Mapping[str, Functional] | None = None,
    **common: Unpack[Computing],
) -> RunResult:
    """Compute the steady state or the time history of a scene.

    It is the steady state where the spin is constant and [time] absent.

    Args:
        scene: scene, path of a scene file, or nested tables.
        checkpoint: write checkpoints into the folder: every 30s, or 500 steps.
        resume: go on from the checkpoint in the result folder.
        error: estimate errors, as output.error has it; "parts": those of steps and mesh one by one.
        progress: called with the share of the work done, between 0 and 1.
        outputs: functionals to record, by name, mechanics ↦ UFL form; columns of the history.

    Raises:
        SceneError: the scene is not valid or cannot be run, or a checkpoint that is none of this run.
        ComputationError: it failed; its attribute `result` holds what was computed until then.
        OutputError: the folder cannot be written.
    """
    if error not in (True, False, "parts"):
        raise SceneError("command line", "--error", error, 'must be "parts"')
    with begun("run", scene, common, error) as job:
        from rotfem.commands.run import simulate
        from rotfem.commands.run_store import RunStore, interval

        store = RunStore(job.comm, job.results, None if checkpoint is None else interval(checkpoint), resume)
        shown, parts, hint = partial(job.finish, last=False), error == "parts", common.get("hint", silent)
        return job.finish(
            simulate(job.scene, store, progress, hint, common.get("terms"), outputs, shown=shown, parts=parts)
        )


@verb
def modes(
    scene: AnyScene,
    *,
    speed: float | str | None = None,
    sensitivities: bool = False,
    state_space: bool = False,
    matrices: bool = False,
    blade_tables: bool = False,
    participation: bool = False,
    animate: int | None = None,
    error: bool = True,
    **common: Unpack[Computing],
) -> ModesResult:
    """Compute natural frequencies, damping and mode shapes of a scene.

    They are those at its final speed: that of a spin-up, at the end of [time], or the constant one.

    Args:
        scene: scene, path of a scene file, or nested tables.
        speed: of the hub, in the place of the final one, rad/s or as 12.1rpm.
        sensitivities: derivatives of all eigenvalues to section, hub and speed.
        state_space: write the modal model state_space.npz into the folder.
        matrices: write M, C, K as Matrix Market and npz into the folder.
        blade_tables: mode polynomials for ElastoDyn and a table of modes over the span.
        participation: modal masses and effective masses (see `rotfem.analysis.modal`).
        animate: number of a mode to draw in space, mode_N.gif in the folder.
        error: estimate errors, as output.error has it.

    Raises:
        SceneError: the scene is not valid.
        ComputationError: no equilibrium, or eigenpairs that fail the check of their backward error.
    """
    with begun("modes", scene, common, error) as job:
        from rotfem.commands.modes import analysed, at_speed, models

        if speed is not None:
            job.scene = at_speed(job.scene, listed("--speed", speed, 1)[0])
        count = job.scene.modes.count
        if animate is not None and not 1 <= animate <= count:
            raise SceneError("command line", "--animate", animate, f"must be from 1 to modes.count, {count}")
        hint, terms = common.get("hint", silent), common.get("terms")
        result = analysed(job.scene, job.comm, sensitivities, blade_tables, participation, hint, terms)
        further: list[Writer] = []
        if job.results is None and (state_space or matrices or animate is not None):
            raise InputError("folder", None, "must be given, for what state_space, matrices and animate write")
        if job.results is not None:
            further += models(job.scene, result, state_space, matrices)
        if animate is not None:
            from rotfem.results.surfaces import animate as draw

            further.append(lambda folder: draw(result, animate, folder))
        return job.finish(result, further)


@verb
def campbell(
    scene: AnyScene,
    speeds: Sequence[float] | str,
    *,
    per_rev: int | None = None,
    orders: int | Sequence[int] | str | None = None,
    rated: float | str | None = None,
    operating: Sequence[float | str] | str | None = None,
    only: bool = False,
    map: Mapping[str, Sequence[float]] | str | None = None,
    error: bool = True,
    progress: Progress | None = None,
    **common: Unpack[Computing],
) -> CampbellResult:
    """Compute the Campbell diagram and critical speeds of a scene.

    Its own speed is not used. Of a diagram that was interrupted the finished speeds are kept in the folder; the same
    command goes on from there.

    Args:
        scene: scene, path of a scene file, or nested tables.
        speeds: first:last:number or s1,s2,… in rad/s, or as 0:15:31rpm; increasing.
        per_rev: number of the lines 1Ω … NΩ to cross.
        orders: k of the lines kΩ to cross, as 1,3,6,9, in a script their number, too; by default those of the scene, or
            as many as meet a branch in the range, at most 4.
        rated: rated speed to mark, rad/s or as 12.1rpm.
        operating: operating range to mark, as 6.9:12.1rpm.
        only: solve no other speeds; critical speeds are interpolated between them.
        map: critical speeds over a scene key, as structure.supports.*.stiffness=1e6:1e9:20, spaced evenly on a
            logarithmic scale: the synchronous ones of a shaft, without damping and unsymmetric stiffnesses.
        error: estimate errors, as output.error has it.
        progress: called with the share of the speeds done, between 0 and 1.

    Raises:
        SceneError: the scene or the speeds are not valid.
        ComputationError: no equilibrium at a speed, or eigenpairs that fail their check; its attribute `result` holds
            the diagram of the speeds before it.
        Stopped: it was interrupted; likewise.
    """
    if isinstance(rated, str):
        (rated,) = listed("--rated", rated, 1)
    if isinstance(orders, str):
        orders = listed("--orders", orders, kind=int)
    with begun("campbell", scene, common, error) as job:
        from rotfem.commands.campbell import campbell_of

        number = per_rev if orders is None else orders
        marks = {
            "modes.orders": list(range(1, 1 + number)) if isinstance(number, int) else number,
            "modes.rated": rated,
            "modes.operating": ranged(operating),
        }
        kept = None if job.results is None else job.results.path
        hint, terms = common.get("hint", silent), common.get("terms")
        return job.finish(campbell_of(job.scene, speeds, marks, only, map, job.comm, kept, progress, hint, terms))


@verb
def response(
    scene: AnyScene,
    low: float | str | None = None,
    high: float | str | None = None,
    *,
    number: int = 200,
    per_rev: Sequence[float] | str = (),
    **common: Unpack[Common],
) -> ResponseResult:
    """Compute amplitudes and phases of a scene under harmonic loads.

    Args:
        scene: scene, path of a scene file, or nested tables; of its first `modes.count` modes the peaks are resolved.
        low: lowest frequency, rad/s or with a unit as 0.1Hz; by default 0, or half a free hub's first.
        high: highest frequency; by default beyond the highest of modes.count.
        number: of frequencies, at equal distances; those that show peaks and smooth curves come on top.
        per_rev: multiples of the speed, as 1,2,3: frequencies that are taken alone without lowest and highest.

    Raises:
        SceneError: the scene is not valid, or has no harmonic load, no steady state or a free hub.
        ComputationError: no equilibrium, eigenpairs that fail their check, or a frequency of a mode without damping.
    """
    lines = listed("--per-rev", per_rev) if isinstance(per_rev, str) else per_rev
    with begun("response", scene, common) as job:
        from rotfem.commands.response import response_of

        return job.finish(response_of(job.scene, low, high, number, lines, job.comm))


@verb
def unbalance(
    scene: AnyScene,
    speeds: Sequence[float] | str,
    *,
    probes: Sequence[tuple[float, float] | str] = (),
    operating: Sequence[float | str] | str | None = None,
    **common: Unpack[Common],
) -> UnbalanceResult:
    """Compute the whirl of a shaft, a scene, under its unbalances.

    It is that over the speed. Peaks are sought between the speeds. Their amplification factor is N_c/(N₂ − N₁), N₁ and
    N₂ the speeds at which the larger semi-axis is 0.707 of that at the peak N_c; the separation margin is the distance
    of N_c from the operating range, in parts of the nearer end of it (API 617, 8th edition, 1-2.6).

    Args:
        scene: scene, path of a scene file, or nested tables; its unbalances are `loads.unbalance` and masses off
            the axis.
        speeds: first:last:number in rad/s, or as 0:12000:200rpm; increasing.
        probes: a probe x:angle, place (m) and angle (°) from direction 2 towards 3; in a script pairs in m and rad.
        operating: operating range, as 3000:3600rpm.

    Raises:
        SceneError: the scene is not valid, is no round shaft, or has no unbalance.
        ComputationError: no equilibrium.
    """
    with begun("unbalance", scene, common) as job:
        from rotfem.commands.unbalance import probe_of, whirl

        looking = [probe_of(probe) if isinstance(probe, str) else probe for probe in probes]
        return job.finish(whirl(job.scene, speeds, looking, ranged(operating), job.comm))


@verb
def check(scene: AnyScene, **common: Unpack[Common]) -> CheckResult:
    """Show mass, centre of mass and inertias of a scene, and draw it.

    No motion is computed. Of a result folder the command says how the computation ended. Integrals are those of the
    bodies that the equations are made of, on the scene's mesh, with all mass that there is.

    Args:
        scene: scene, path of a scene file, or nested tables.

    Raises:
        SceneError: the scene is not valid, or a mesh or a section that cannot be computed with.
    """
    with begun("check", scene, common) as job:
        from rotfem.commands.check import weighed

        return job.finish(weighed(job.scene, job.comm))


@verb
def explain(
    scene: AnyScene,
    *,
    accuracy: float | None = None,
    write: str | Path | None = None,
    progress: Progress | None = None,
    terms: Mapping[str, Work] | None = None,
    **common: Unpack[Common],
) -> ExplainResult:
    """Show how much each effect and each theory changes in a scene.

    It ends with the model that the scene calls for.

    Args:
        scene: scene, path of a scene file, or nested tables.
        accuracy: relative error that the model is for, 1e-2 by default.
        write: file that the scene is written to with what it needs.
        progress: called with the share of the work done, between 0 and 1.
        terms: further terms of the residual by name, in every model, (mechanics, variation) ↦ UFL form.

    Raises:
        SceneError: the scene is not valid.
    """
    with begun("explain", scene, common) as job:
        from rotfem.commands.explain import Explanation

        job.check_writable("--write", write, job.scene.inputs)
        given = job.scene if accuracy is None else job.scene.replace({"accuracy": accuracy})
        with input_of(given.file):
            found = Explanation(given, terms or {}, job.comm).result(progress or silent)
        result = job.finish(found)
        if write is not None and job.first:
            within = result.summary["needed"]["accuracy"]
            remark = f"# {given.name} with the theory and the effects that it needs for {within:g}.\n\n"
            job.scene.replace(result.needed).write(write, remark)
            job.say(f"scene with what it needs in {write}")
        return result


@verb
def cost(
    scene: AnyScene,
    *,
    quick: bool = False,
    accuracy: float = 1e-4,
    write: str | Path | None = None,
    of: str | None = None,
    theories: Sequence[str] | str | None = None,
    schemes: Sequence[str] | str | None = None,
    budget: float | str | None = None,
    progress: Progress | None = None,
    **common: Unpack[Common],
) -> CostResult:
    """Measure error against computing time of a scene over settings.

    Each theory and scheme has a ladder of settings, each about twice as dear as the last.

    Args:
        scene: scene, path of a scene file, or nested tables.
        quick: few theories, and the scheme of the reference and the scene's own.
        accuracy: relative error, that of the model included, for which a setting is recommended.
        write: file that the scene is written to with that setting.
        of: tip (displacements, relative to the largest), frequencies (eigenvalues, each relative to itself) or campbell
            (eigenvalues at nine speeds from rest to the scene's); by default what the scene computes.
        theories: those to try, as A,B; by default those that the structure has.
        schemes: time-stepping schemes to try, as A,B; by default all.
        budget: CPU time of the study, s, or as 60s, 2min; two minutes for a quick one, else twenty.
        progress: called with the share of the work done, between 0 and 1.

    Raises:
        SceneError: the scene, or a choice, is not valid.
        ComputationError: not one setting could be computed.
        Stopped: it was interrupted; its attribute `result` holds what was measured.
    """
    with begun("cost", scene, common) as job:
        from rotfem.commands.cost import studied

        job.check_writable("--write", write, job.scene.inputs)
        few, ways = (x.split(",") if isinstance(x, str) else x for x in (theories, schemes))
        result = job.finish(studied(job.scene, quick, accuracy, of, budget, few, ways, job.comm, progress))
        if write is not None and job.first and result.summary["recommended"] is not None:
            result.write_tuned(write)
            job.say(f"tuned scene in {write}")
        return result


def listed(
    option: str, given: float | str, count: int | None = None, kind: type[int] | type[float] = float
) -> list[Any]:
    """Return the numbers of an option such as "1,2" or, in rad/s, "6.9,12.1rpm"."""
    with suppress(ValueError):
        numbers, unit = split_unit(str(given))
        found = [kind(part) * kind(unit) for part in numbers.split(",")]
        if count in (None, len(found)):
            return found
    what = {1: "a speed, rad/s or as 12.1rpm", 2: "two speeds low:high, rad/s or as 6.9:12.1rpm"}
    raise SceneError("command line", option, given, f"must be {what.get(count or 0, 'numbers separated by commas')}")


def ranged(operating: Sequence[float | str] | str | None) -> Any:
    """Return an operating range as two numbers (rad/s), or as it is where it is no text."""
    return listed("--operating", operating.replace(":", ","), 2) if isinstance(operating, str) else operating
