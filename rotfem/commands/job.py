"""What all commands of the command line have in common: their options, and the job that these make."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rotfem.commands.console import Session, missing
from rotfem.commands.interrupts import importing
from rotfem.errors import ComputationError, InputError, SceneError, Stopped
from rotfem.units import seconds_of
from rotfem.version import __version__

if TYPE_CHECKING:
    from rotfem.results import Result
    from rotfem.results.result_set import ResultFolder, Writer
    from rotfem.scene import Scene

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


@dataclass
class Job:
    """What every command works on.

    Attributes:
        scene: the scene, with the changes of --set.
        results: folder where its results go.
        session: who speaks.
        plots: whether figures are wanted.
        report: whether report.html is.
        hint: receives advice; None where none is wanted.
        shown: whether the result has been written and printed, all but its error.
    """

    scene: Scene
    results: ResultFolder
    session: Session
    plots: bool
    report: bool
    hint: Callable[[str], None] | None
    shown: bool = False

    def progress(self, share: float) -> None:
        """Show which share of the computation is done."""
        self.session.bar(share)

    def show(self, result: Result) -> None:
        """Write and print a result whose error is still to be estimated."""
        self.session.finish(result, self.plots, last=False)
        self.shown = True

    def finish(self, result: Result, further: Sequence[Writer] = ()) -> None:
        """Write a result, what else is wanted, and report.html if that is; print its report."""
        writers = list(further)
        if self.report:
            from rotfem.commands.check import check
            from rotfem.results.report import write_report

            drawing = None
            if result.summary["command"] != "check":
                with suppress(InputError, ComputationError):
                    drawing = check(self.scene, comm=self.session.comm).plot()
            writers.append(partial(write_report, result, drawing))
        if self.shown:
            self.session.complete(result, writers)
        else:
            self.session.finish(result, self.plots, writers)


@contextmanager
def job(
    command: str,
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
    no_advice: Annotated[bool, typer.Option("--no-advice", help="give no hints at the start")] = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> Iterator[Job]:
    """Give a command its job; these are, but for its name, the options of all commands."""
    with importing():  # in the middle of an import what signals raise becomes any error
        from rotfem.scene import load_scene

    with Session(as_json, quiet, debug) as session:
        wanted = [] if accuracy is None else [f"accuracy={accuracy!r}"]
        if budget is not None:
            wanted.append(f"accuracy_budget={seconds_of(budget, 'command line', '--budget')!r}")
        if no_error:
            wanted.append("output.error=false")
        loaded = load_scene(scene, [*(overrides or ()), *wanted])
        if lacking := missing():
            raise InputError("", None, lacking)
        session.start(f"{loaded.name}: {command}", loaded.output.speed)
        if output is None and loaded.name in ("", ".", ".."):
            raise SceneError("command line", "-o", None, f'must be given for a scene of the name "{loaded.name}"')
        folder = session.folder(output or Path("results", loaded.name, command), command, loaded.inputs)
        with importing():
            import rotfem.numerics.forms  # noqa: F401  PETSc first, which dolfinx would start in its own way
        if report and find_spec("bokeh") is None:
            raise InputError("--report", None, "needs bokeh, which is not installed: pip install bokeh")
        todo = Job(loaded, folder, session, not no_plots, report, session.hint(no_advice))
        try:
            yield todo
        except (ComputationError, Stopped) as error:
            if error.result is not None:
                todo.finish(error.result)
            raise


def command(
    computes: bool = True, first: Callable[[Session, Path, Sequence[str]], bool] | None = None
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Make a command of a function of a job and its own options."""

    def decorate(work: Callable[..., None]) -> Callable[..., None]:
        options_of_all = list(signature(job, eval_str=True).parameters.values())[1:]
        shared = [
            p for p in options_of_all if computes or p.name not in ("no_advice", "no_error", "accuracy", "budget")
        ]
        own = list(signature(work, eval_str=True).parameters.values())[1:]

        def call(**given: Any) -> None:
            options = {p.name: given.pop(p.name) for p in own}
            if first is not None:
                with Session(given["as_json"], given["quiet"], given["debug"]) as session:
                    if first(session, given["scene"], given["overrides"] or ()):
                        return
            with job(work.__name__, **given) as todo:
                work(todo, **options)

        ordered = [shared[0], *own, *shared[1:]]
        call.__name__, call.__doc__ = work.__name__, work.__doc__
        vars(call)["__signature__"] = Signature([p.replace(kind=Parameter.KEYWORD_ONLY) for p in ordered])
        app.command()(call)
        return work

    return decorate
