"""The verbs on a scene, with their options: each makes a result of the scene of a session."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from importlib.util import find_spec
from inspect import Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from rotfem.commands.console import Session
from rotfem.errors import ComputationError, InputError, SceneError, Stopped, input_of
from rotfem.units import seconds_of, split_unit
from rotfem.version import __version__

if TYPE_CHECKING:
    from rotfem.results.result_set import Writer

app = typer.Typer(
    name="rotfem",
    help="Rotating beams and plates with FEniCSx. SCENE is a TOML file, described in docs/scene.md.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def as_path(text: str) -> Path:
    """Return the path that an option gives."""
    if not text or "\0" in text:
        raise typer.BadParameter("must be a path, not an empty text")
    return Path(text)


#: Options that several commands have.
SceneFile = Annotated[
    Path, typer.Argument(metavar="SCENE", parser=as_path, help="scene file (TOML)", show_default=False)
]
Json = Annotated[bool, typer.Option("--json", help="print the summary as JSON, and nothing else, on stdout")]
NoPlots = Annotated[bool, typer.Option("--no-plots", help="write no figures")]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="print errors only")]
Debug = Annotated[bool, typer.Option("--debug", help="show the traceback of an error")]


def folder_option(default: str) -> Any:
    """Return the option -o of a folder."""
    return typer.Option("-o", "--output", metavar="DIR", parser=as_path, help=f"result folder [{default}]")


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", help="print the version", callback=lambda wanted: _version(wanted))
    ] = False,
    files: Annotated[
        list[Path] | None,
        typer.Option("--load", metavar="FILE", parser=as_path, help="Python file that registers what scenes name"),
    ] = None,
) -> None:
    """Rotating beams and plates with FEniCSx."""
    if files:
        from rotfem.scene.extensions import load

        with Session():
            for path in files:
                load(str(path), path, "command line", "--load")


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"rotfem {__version__}")
        raise typer.Exit


# --- what all verbs have in common ------------------------------------------------------------------------------------


@contextmanager
def verb_on(
    verb: str,
    *,
    scene: SceneFile,
    output: Annotated[Path | None, folder_option("results/<scene name>/<command>")] = None,
    overrides: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="change a scene key, repeatable")
    ] = None,
    accuracy: Annotated[
        float | None, typer.Option("--accuracy", metavar="E", help="relative error wanted: the rest follows from it")
    ] = None,
    budget: Annotated[
        str | None, typer.Option("--budget", metavar="TIME", help="that an accuracy may take: 60s, 2min, 1h")
    ] = None,
    as_json: Json = False,
    no_error: Annotated[
        bool, typer.Option("--no-error", help="estimate no errors, as output.error = false does")
    ] = False,
    no_plots: NoPlots = False,
    report: Annotated[bool, typer.Option("--report", help="write report.html, a page that shows all of it")] = False,
    trust: Annotated[bool, typer.Option("--trust", help="let SCENE run the Python files it names")] = False,
    no_advice: Annotated[bool, typer.Option("--no-advice", help="give no hints at the start")] = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> Iterator[Session]:
    """Give a verb the session of its scene; these are, but for its name, the options of all verbs."""
    from rotfem.scene import load_scene
    from rotfem.scene.extensions import Untrusted

    with Session(as_json, quiet, debug, no_plots) as session:
        if verb == "check" and scene.is_dir():
            from rotfem.results.result_set import read_summary, said_of

            found(session, said_of(scene), read_summary(scene))
        wanted = [] if accuracy is None else [f"accuracy={accuracy!r}"]
        if budget is not None:
            wanted.append(f"accuracy_budget={seconds_of(budget, 'command line', '--budget')!r}")
        if no_error:
            wanted.append("output.error=false")
        changes = [*(overrides or ()), *wanted]
        try:
            loaded = load_scene(scene, changes, trust)
        except Untrusted as error:
            if not (sys.stdin.isatty() and sys.stderr.isatty()) or not typer.confirm(f"{error}\nRun it?", err=True):
                raise
            loaded = load_scene(scene, changes, True)
        session.scene = loaded
        modules = ("mpi4py", "petsc4py", "slepc4py", "dolfinx")
        if absent := next((name for name in modules if find_spec(name) is None), ""):
            lacking = f"FEniCSx is not here (there is no module {absent}); see docs/installation.md"
            if verb != "check":
                raise InputError("", None, lacking)
            found(session, f"{scene} is a valid scene; for more, {lacking}", {"command": "check", "name": loaded.name})
        session.start(f"{loaded.name}: {verb}", loaded.output.speed)
        if output is None and loaded.name in ("", ".", ".."):
            raise SceneError("command line", "-o", None, f'must be given for a scene of the name "{loaded.name}"')
        import rotfem.numerics.forms  # noqa: F401  PETSc first, which dolfinx would start in its own way

        session.folder(output or Path("results", loaded.name, verb), verb, loaded.inputs)
        session.hint = None if no_advice or quiet else session.advise
        session.report = report
        if report and find_spec("bokeh") is None:
            raise InputError("--report", None, "needs bokeh, which is not installed: pip install bokeh")
        try:
            yield session
        except (ComputationError, Stopped) as error:
            if error.result is not None:
                session.finish(error.result)
            raise


def found(session: Session, said: str, summary: dict[str, Any]) -> NoReturn:
    """Say what `check` finds without a computation, and end it."""
    session.print_json({**summary, "found": said})
    session.say(said)
    raise SystemExit(0)


#: Options of verbs that compute what a scene asks for.
OF_COMPUTING = ("accuracy", "budget", "no_error", "no_advice")


def verb(computes: bool = True) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Make a command of a function of a session and its own options: it has those of all verbs, too."""

    def decorate(work: Callable[..., None]) -> Callable[..., None]:
        own = [p.replace(kind=p.KEYWORD_ONLY) for p in list(signature(work, eval_str=True).parameters.values())[1:]]
        scene, *shared = list(signature(verb_on, eval_str=True).parameters.values())[1:]
        shared = [p for p in shared if computes or p.name not in OF_COMPUTING]

        def call(**given: Any) -> None:
            options = {p.name: given.pop(p.name) for p in own}
            with verb_on(work.__name__, **given) as session:
                work(session, **options)

        call.__name__, call.__doc__ = work.__name__, work.__doc__
        vars(call)["__signature__"] = Signature([scene, *own, *shared])
        app.command()(call)
        return work

    return decorate


# --- the verbs --------------------------------------------------------------------------------------------------------


@verb()
def run(
    session: Session,
    checkpoint: Annotated[
        str | None, typer.Option("--checkpoint", metavar="EVERY", help="write checkpoints: every 30s, or 500 steps")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="go on from the checkpoint in the result folder")] = False,
    error: Annotated[
        str | None, typer.Option("--error", metavar="parts", help="errors of steps and mesh one by one")
    ] = None,
) -> None:
    """Compute the steady state or the time history of SCENE."""
    from rotfem.commands.run import simulate
    from rotfem.commands.run_store import RunStore, interval

    if error not in (None, "parts"):
        raise SceneError("command line", "--error", error, 'must be "parts"')
    every = None if checkpoint is None else interval(checkpoint)
    store = RunStore(session.comm, session.results, every, resume)
    shown, parts = partial(session.finish, last=False), error is not None
    session.finish(simulate(session.scene, store, session.bar, session.hint, shown=shown, parts=parts))


@verb()
def modes(
    session: Session,
    sensitivities: Annotated[
        bool, typer.Option("--sensitivities", help="derivatives to section, hub and speed")
    ] = False,
    state_space: Annotated[bool, typer.Option("--state-space", help="write the modal model state_space.npz")] = False,
    matrices: Annotated[bool, typer.Option("--matrices", help="write M, C, K as Matrix Market and npz")] = False,
    blade_tables: Annotated[
        bool, typer.Option("--blade-tables", help="mode polynomials for ElastoDyn and a table of modes over the span")
    ] = False,
    participation: Annotated[bool, typer.Option("--participation", help="modal masses and effective masses")] = False,
    animate: Annotated[
        int | None, typer.Option("--animate", metavar="MODE", help="draw a mode in space: mode_N.gif")
    ] = None,
) -> None:
    """Compute natural frequencies, damping and mode shapes of SCENE."""
    from rotfem.commands.modes import modes as analyse

    count = session.scene.modes.count
    if animate is not None and not 1 <= animate <= count:
        raise SceneError("command line", "--animate", animate, f"must be from 1 to modes.count, {count}")
    result = analyse(
        session.scene,
        sensitivities=sensitivities,
        blade_tables=blade_tables,
        participation=participation,
        comm=session.comm,
        hint=session.hint,
    )
    further: list[Writer] = []
    if state_space or matrices:
        from rotfem.analysis.state_space import serial, write_matrices
        from rotfem.analysis.state_space import state_space as reduce

        with input_of(session.scene.file):
            if state_space:
                model = reduce(result.analysis, result.spinning, session.scene.modes.count)
                further.append(lambda folder: model.write(folder / "state_space.npz"))
            if matrices:
                serial(result.analysis, "the export of matrices")
                further.append(lambda folder: write_matrices(result.analysis, result.spinning, folder))
    if animate is not None:
        from rotfem.results.surfaces import animate as draw

        further.append(lambda folder: draw(result, animate, folder))
    session.finish(result, further)


@verb()
def campbell(
    session: Session,
    speeds: Annotated[
        str, typer.Option("--speeds", metavar="RANGE", help="first:last:number or s1,s2,… in rad/s, or as 0:15:31rpm")
    ],
    per_rev: Annotated[int | None, typer.Option("--per-rev", min=0, help="lines 1Ω … NΩ to cross")] = None,
    orders: Annotated[str | None, typer.Option("--orders", metavar="K,…", help="lines kΩ to cross: 1,3,6,9")] = None,
    rated: Annotated[str | None, typer.Option("--rated", metavar="SPEED", help="rated speed to mark: 12.1rpm")] = None,
    operating: Annotated[
        str | None, typer.Option("--operating", metavar="LOW:HIGH", help="operating range to mark: 6.9:12.1rpm")
    ] = None,
    only: Annotated[
        bool, typer.Option("--only", help="solve no other speeds; critical speeds are interpolated between them")
    ] = False,
    over: Annotated[
        str | None,
        typer.Option(
            "--map", metavar="KEY=RANGE", help="critical speeds over structure.supports.*.stiffness=1e6:1e9:20"
        ),
    ] = None,
) -> None:
    """Compute the Campbell diagram and critical speeds of SCENE.

    Of one that was interrupted the finished speeds are kept; the same command goes on from there.
    """
    from rotfem.commands.campbell import campbell as sweep

    result = sweep(
        session.scene,
        speeds,
        comm=session.comm,
        orders=per_rev if orders is None else listed("--orders", orders, int),
        rated=None if rated is None else listed("--rated", rated, float, 1)[0],
        operating=None if operating is None else listed("--operating", operating.replace(":", ","), float, 2),
        only=only,
        map=over,
        folder=session.results.path,
        progress=session.bar,
        hint=session.hint,
    )
    session.finish(result)


@verb(computes=False)
def response(
    session: Session,
    low: Annotated[
        str | None,
        typer.Option(
            "--from", metavar="FREQUENCY", help="lowest, rad/s or with a unit: 0.1Hz [0, or half a free hub's first]"
        ),
    ] = None,
    high: Annotated[
        str | None, typer.Option("--to", metavar="FREQUENCY", help="highest [beyond the highest of modes.count]")
    ] = None,
    number: Annotated[int, typer.Option("--number", help="frequencies, those that show peaks on top")] = 200,
    per_rev: Annotated[str | None, typer.Option("--per-rev", metavar="K,…", help="multiples of the speed")] = None,
) -> None:
    """Compute amplitudes and phases of SCENE under harmonic loads."""
    from rotfem.commands.response import response as answers

    orders = () if per_rev is None else listed("--per-rev", per_rev)
    result = answers(session.scene, low, high, number=number, per_rev=orders, comm=session.comm)
    session.finish(result)


@verb(computes=False)
def unbalance(
    session: Session,
    speeds: Annotated[
        str, typer.Option("--speeds", metavar="RANGE", help="first:last:number in rad/s, or as 0:12000:200rpm")
    ],
    probe: Annotated[
        list[str] | None,
        typer.Option("--probe", metavar="X:ANGLE", help="a probe: place (m) and angle (°), repeatable"),
    ] = None,
    operating: Annotated[
        str | None, typer.Option("--operating", metavar="LOW:HIGH", help="operating range: 3000:3600rpm")
    ] = None,
) -> None:
    """Compute the whirl of a shaft, SCENE, under its unbalances."""
    from rotfem.commands.unbalance import probe_of
    from rotfem.commands.unbalance import unbalance as answers

    result = answers(
        session.scene,
        speeds,
        probes=[probe_of(text) for text in probe or ()],
        operating=None if operating is None else listed("--operating", operating.replace(":", ","), float, 2),
        comm=session.comm,
    )
    session.finish(result)


@verb(computes=False)
def check(session: Session) -> None:
    """Show mass, centre of mass and inertias of SCENE, and draw it.

    No motion is computed. Of a result folder it says how the computation ended.
    """
    from rotfem.commands.check import check as weigh

    session.finish(weigh(session.scene, comm=session.comm))


@verb(computes=False)
def explain(
    session: Session,
    accuracy: Annotated[
        float | None, typer.Option("--accuracy", help="that the model of --write is for, 1e-2 by default")
    ] = None,
    write: Annotated[
        Path | None, typer.Option("--write", metavar="FILE", parser=as_path, help="write the scene with what it needs")
    ] = None,
) -> None:
    """Show how much each effect and each theory changes in SCENE.

    Its last line names those that the scene calls for.
    """
    from rotfem.accuracy.tuned import write_variant
    from rotfem.commands.explain import explain as estimate

    if write is not None:
        session.check_writable("--write", write, session.scene.inputs)
    scene = session.scene if accuracy is None else session.scene.replace({"accuracy": accuracy})
    result = estimate(scene, comm=session.comm, progress=session.bar)
    session.finish(result)
    if write is not None and session.first:
        within = result.summary["needed"]["accuracy"]
        remark = f"# {session.scene.name} with the theory and the effects that it needs for {within:g}.\n\n"
        write_variant(session.scene, result.needed, write, remark)
        session.say(f"scene with what it needs in {write}")


@verb(computes=False)
def cost(
    session: Session,
    quick: Annotated[bool, typer.Option("--quick", help="a small grid")] = False,
    accuracy: Annotated[float, typer.Option("--accuracy", help="relative error wanted, the model's included")] = 1e-4,
    write: Annotated[
        Path | None, typer.Option("--write", metavar="FILE", parser=as_path, help="write the tuned scene there")
    ] = None,
    of: Annotated[str | None, typer.Option("--of", metavar="OUTPUT", help="tip, frequencies or campbell")] = None,
    theories: Annotated[str | None, typer.Option("--theories", metavar="A,B,…", help="theories to try")] = None,
    schemes: Annotated[str | None, typer.Option("--schemes", metavar="A,B,…", help="time-stepping schemes")] = None,
    budget: Annotated[str | None, typer.Option("--budget", metavar="TIME", help="of the study: 60s, 2min, 1h")] = None,
) -> None:
    """Measure error against computing time of SCENE over settings.

    Each theory and scheme has a ladder of settings, each about twice as dear as the last.
    """
    from rotfem.commands.cost import cost as study

    if write is not None:
        session.check_writable("--write", write, session.scene.inputs)
    result = study(
        session.scene,
        quick=quick,
        accuracy=accuracy,
        output=of,
        budget=budget,
        theories=None if theories is None else theories.split(","),
        schemes=None if schemes is None else schemes.split(","),
        comm=session.comm,
        progress=session.bar,
    )
    session.finish(result)
    if result.summary["recommended"] is None:
        raise result.missed()
    if write is not None and session.first:
        result.write_tuned(write)
        session.say(f"tuned scene in {write}")


def listed(option: str, text: str, kind: type[int] | type[float] = float, count: int | None = None) -> list[Any]:
    """Return the numbers of an option such as "1,2" or, in rad/s, "6.9,12.1rpm"."""
    with suppress(ValueError):
        numbers, unit = split_unit(text)
        found = [kind(part) * kind(unit) for part in numbers.split(",")]
        if count in (None, len(found)):
            return found
    what = {1: "a speed, rad/s or as 12.1rpm", 2: "two speeds low:high, rad/s or as 6.9:12.1rpm"}
    raise SceneError("command line", option, text, f"must be {what.get(count or 0, 'numbers separated by commas')}")
