"""The command line: parses, calls, prints.

Exit status 0 done, 2 bad input, 3 the computation failed, 130 interrupted.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

from rotfem.errors import ComputationError, OutputError, SceneError
from rotfem.scene import load_scene

app = typer.Typer(
    name="rotfem",
    help="Rotating beams and plates with FEniCSx. A scene is a TOML file; docs/scene.md lists its keys.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

ScenePath = Annotated[Path, typer.Argument(metavar="SCENE", help="scene file (TOML)", show_default=False)]
Output = Annotated[Path | None, typer.Option("-o", "--output", help="result folder [results/<scene name>]")]
Overrides = Annotated[list[str], typer.Option("--set", metavar="KEY=VALUE", help="change a scene key, repeatable")]
Json = Annotated[bool, typer.Option("--json", help="print the summary as JSON, and nothing else, on stdout")]
NoPlots = Annotated[bool, typer.Option("--no-plots", help="write no figures")]
NoAdvice = Annotated[bool, typer.Option("--no-advice", help="give no hints at the start")]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="print errors only")]
Debug = Annotated[bool, typer.Option("--debug", help="show the traceback of an error")]


@app.callback()
def _root() -> None:
    """Rotating beams and plates with FEniCSx."""


@app.command()
def run(
    scene: ScenePath,
    output: Output = None,
    overrides: Overrides = [],  # noqa: B006 (typer reads the default)
    as_json: Json = False,
    no_plots: NoPlots = False,
    no_advice: NoAdvice = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Compute the steady state or the time history of SCENE."""
    with Session(as_json, quiet, debug) as session:
        loaded = load_scene(scene, overrides)
        folder = session.folder(output or Path("results") / loaded.name)
        from rotfem.simulation import run as simulate

        try:
            with session.progress(f"{loaded.name}: {loaded.model.theory}") as progress:
                result = simulate(loaded, progress=progress, hint=session.hint(no_advice))
        except (ComputationError, KeyboardInterrupt) as error:
            partial = getattr(error, "result", None)
            if partial is not None:
                session.write(partial, folder, plots=not no_plots)
            raise
        session.write(result, folder, plots=not no_plots)
        session.say(run_report(result.summary, folder))


@app.command()
def modes(
    scene: ScenePath,
    output: Output = None,
    overrides: Overrides = [],  # noqa: B006
    sensitivities: Annotated[
        bool, typer.Option("--sensitivities", help="derivatives to section, hub and speed")
    ] = False,
    state_space: Annotated[bool, typer.Option("--state-space", help="write the modal model state_space.npz")] = False,
    matrices: Annotated[bool, typer.Option("--matrices", help="write M, C, K as Matrix Market and npz")] = False,
    animate: Annotated[int | None, typer.Option("--animate", metavar="MODE", help="animate a mode of a plate")] = None,
    as_json: Json = False,
    no_plots: NoPlots = False,
    no_advice: NoAdvice = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Compute the gyroscopic eigenmodes of SCENE at its speed."""
    with Session(as_json, quiet, debug) as session:
        loaded = load_scene(scene, overrides)
        folder = session.folder(output or Path("results") / loaded.name)
        from rotfem.modes import modes as analyse

        result = analyse(loaded, sensitivities=sensitivities, hint=session.hint(no_advice))
        if state_space or matrices:
            from rotfem.state_space import state_space as reduce
            from rotfem.state_space import write_matrices

            if state_space:
                reduce(result.analysis, result.spinning, loaded.modes.count).write(folder / "state_space.npz")
            if matrices:
                write_matrices(result.analysis, result.spinning, folder)
        session.write(result, folder, plots=not no_plots)
        if animate is not None:
            session.animate(result, animate, folder)
        session.say(modes_report(result.summary, folder))


@app.command()
def campbell(
    scene: ScenePath,
    speeds: Annotated[str, typer.Option("--speeds", metavar="RANGE", help="first:last:number or s1,s2,… in rad/s")],
    per_rev: Annotated[int | None, typer.Option("--per-rev", min=0, help="per-rev lines 1Ω … NΩ to cross")] = None,
    output: Output = None,
    overrides: Overrides = [],  # noqa: B006
    as_json: Json = False,
    no_plots: NoPlots = False,
    no_advice: NoAdvice = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Follow the modes of SCENE over a range of speeds."""
    with Session(as_json, quiet, debug) as session:
        loaded = load_scene(scene, overrides)
        folder = session.folder(output or Path("results") / loaded.name)
        from rotfem.campbell import campbell as sweep

        with session.progress(f"{loaded.name}: {loaded.model.theory}") as progress:
            result = sweep(loaded, speeds, orders=per_rev, progress=progress, hint=session.hint(no_advice))
        session.write(result, folder, plots=not no_plots)
        session.say(campbell_report(result.summary, folder))


@app.command()
def explain(
    scene: ScenePath,
    output: Output = None,
    overrides: Overrides = [],  # noqa: B006
    check: Annotated[bool, typer.Option("--check", help="run the full models too: truth beside the estimates")] = False,
    as_json: Json = False,
    no_plots: NoPlots = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Say which effects and which theory SCENE calls for, and what each of them changes."""
    with Session(as_json, quiet, debug) as session:
        loaded = load_scene(scene, overrides)
        folder = session.folder(output or Path("results") / loaded.name)
        from rotfem.explain import explain as estimate

        with session.progress(f"{loaded.name}: {loaded.model.theory}") as progress:
            result = estimate(loaded, check, progress=progress)
        session.write(result, folder, plots=not no_plots)
        session.say(explain_report(result.summary, folder))


@app.command()
def cost(
    scene: ScenePath,
    quick: Annotated[bool, typer.Option("--quick", help="a small grid")] = False,
    accuracy: Annotated[float, typer.Option("--accuracy", help="relative error wanted, the model's included")] = 1e-4,
    write: Annotated[Path | None, typer.Option("--write", metavar="FILE", help="write the tuned scene there")] = None,
    of: Annotated[str | None, typer.Option("--of", metavar="OUTPUT", help="tip or frequencies")] = None,
    theories: Annotated[str | None, typer.Option("--theories", metavar="A,B,…", help="theories to try")] = None,
    elements: Annotated[str | None, typer.Option("--elements", metavar="N,…", help="numbers of elements")] = None,
    degrees: Annotated[str | None, typer.Option("--degrees", metavar="K,…", help="polynomial degrees")] = None,
    steps: Annotated[str | None, typer.Option("--steps", metavar="H,…", help="time steps (s)")] = None,
    schemes: Annotated[str | None, typer.Option("--schemes", metavar="A,B,…", help="time-stepping schemes")] = None,
    repeat: Annotated[int, typer.Option("--repeat", min=1, help="repetitions; times are medians")] = 3,
    resume: Annotated[bool, typer.Option("--resume/--fresh", help="go on with what is in the result folder")] = True,
    output: Output = None,
    overrides: Overrides = [],  # noqa: B006
    as_json: Json = False,
    no_plots: NoPlots = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Measure what accuracy costs: error and time of SCENE over theory, mesh, degree, step and scheme."""
    with Session(as_json, quiet, debug) as session:
        loaded = load_scene(scene, overrides)
        folder = session.folder(output or Path("results") / loaded.name)
        from rotfem.cost import cost as study
        from rotfem.cost_report import cost_report

        with session.progress(f"{loaded.name}: cost") as progress:
            result = study(
                loaded,
                quick=quick,
                accuracy=accuracy,
                output=of,
                repeat=repeat,
                folder=folder,
                resume=resume,
                theories=listed("--theories", theories, str),
                elements=listed("--elements", elements, int),
                degrees=listed("--degrees", degrees, int),
                steps=listed("--steps", steps, float),
                schemes=listed("--schemes", schemes, str),
                progress=progress,
            )
        session.write(result, folder, plots=not no_plots)
        session.say(cost_report(result.summary, result.rows, folder))
        if write is not None and session.first:
            result.write_tuned(write)
            session.say([f"tuned scene in {write}"])


def listed(option: str, text: str | None, kind: Callable[[str], Any]) -> list[Any] | None:
    """Return the values of an option such as "2,3"; None where it is not given.

    Raises:
        SceneError: they are not of the kind.
    """
    if text is None:
        return None
    try:
        return [kind(part.strip()) for part in text.split(",")]
    except ValueError:
        what = "integers" if kind is int else "numbers"
        raise SceneError("command line", option, text, f"must be {what} separated by commas") from None


class Session:
    """One command under one set of flags: speaks on rank 0 only, and turns errors into messages and exit status.

    Args:
        as_json: print the summary on stdout as JSON and nothing else there.
        quiet: print errors only.
        debug: let tracebacks through.
    """

    def __init__(self, as_json: bool, quiet: bool, debug: bool):
        from mpi4py import MPI

        self.comm = MPI.COMM_WORLD
        self.as_json, self.quiet, self.debug = as_json, quiet, debug
        self.first = self.comm.rank == 0

    def __enter__(self) -> Session:
        signal.signal(signal.SIGTERM, _interrupt)
        return self

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        if error is None or (self.debug and not isinstance(error, SystemExit)):
            return
        if isinstance(error, SceneError | OutputError):
            self._end(str(error), 2)
        if isinstance(error, ComputationError):
            self._end(f"the computation failed: {error}", 3)
        if isinstance(error, KeyboardInterrupt):
            self._end("interrupted", 130)
        if self.comm.size > 1 and not isinstance(error, SystemExit):
            # A rank that fails alone would leave the others waiting for it.
            import traceback

            traceback.print_exception(kind, error, trace)
            self.comm.Abort(1)

    def _end(self, message: str, status: int) -> NoReturn:
        if self.first:
            print(f"rotfem: {message}", file=sys.stderr)
        raise SystemExit(status) from None

    def folder(self, path: Path) -> Path:
        """Return the result folder, made by rank 0.

        Raises:
            OutputError: it cannot be written.
        """
        from rotfem.results import prepare_folder

        problem = None
        if self.first:
            try:
                prepare_folder(path)
            except OutputError as error:
                problem = error
        problem = self.comm.bcast(problem)
        if problem is not None:
            raise problem
        return path

    def progress(self, title: str) -> ProgressBar:
        """Return the progress bar: on a terminal only, and only where the command may speak."""
        return ProgressBar(title, self.first and not self.quiet and not self.as_json and sys.stderr.isatty())

    def hint(self, unwanted: bool) -> Callable[[str], None] | None:
        """Return what prints advice on stderr, rank 0 only; None where it is not wanted."""
        if unwanted or self.quiet:
            return None
        return lambda line: print(f"hint: {line}", file=sys.stderr) if self.first else None

    def write(self, result: Any, folder: Path, plots: bool) -> None:
        """Write a result and its figures from rank 0, its fields from all; print its summary if --json asks for it."""
        fields = getattr(result, "fields", None)
        if fields is not None:
            fields(folder)
        if not self.first:
            return
        result.write(folder)
        if plots:
            if result.summary["command"] == "cost":
                from rotfem.plots_cost import plot_cost

                plot_cost(result, folder)
            else:
                from rotfem.plots import plot

                plot(result, folder)
        if self.as_json:
            from rotfem.results import json_text

            sys.stdout.write(json_text(result.summary))
        for warning in result.summary["warnings"]:
            if not self.quiet:
                print(f"warning: {warning}", file=sys.stderr)

    def animate(self, result: Any, mode: int, folder: Path) -> None:
        """Write the picture and the animation of a plate's mode from rank 0.

        Raises:
            SceneError: there is no such mode, or the structure is no plate.
            OutputError: they cannot be written.
        """
        if result.triangles is None:
            raise SceneError("command line", "--animate", mode, 'needs structure.type = "plate"')
        from rotfem.plots_plate import animate

        problem: Exception | None = None
        if self.first:
            try:
                animate(result, mode, folder)
            except (SceneError, OutputError) as error:
                problem = error
        problem = self.comm.bcast(problem)
        if problem is not None:
            raise problem

    def say(self, lines: list[str]) -> None:
        """Print what was done."""
        if self.first and not (self.quiet or self.as_json):
            print("\n".join(lines))


class ProgressBar:
    """Progress on stderr; calls are free where it is off.

    Args:
        title: text before the bar.
        on: whether to draw it.
    """

    def __init__(self, title: str, on: bool):
        self._bar: Any = None
        self._title = title
        self._on = on

    def __enter__(self) -> Callable[[float], None]:
        if not self._on:
            return lambda share: None
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

        columns = (TextColumn(self._title), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
        self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
        self._bar.start()
        task = self._bar.add_task("", total=1.0)
        return lambda share: self._bar.update(task, completed=share)

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()


def run_report(summary: dict[str, Any], folder: Path) -> list[str]:
    """Return the lines a run prints."""
    f, time = summary["figures"], summary["timings"]
    lines = [
        f"{summary['name']}: {summary['theory']}, {summary['frame']} frame, {summary['elements']} elements, "
        f"{summary['dofs']} dofs",
        f"effects: {', '.join(summary['effects']) or 'none'} "
        f"({summary['integrals']['F']} integrals in F, {summary['integrals']['J']} in J)",
    ]
    lines += choice_report(summary)
    if summary["kind"] == "history":
        lines.append(
            f"{summary['steps']} steps, {summary['newton_iterations']} iterations in {time['total']:.2f} s "
            f"(compile {time['compile']:.2f}, assemble {time['assemble']:.2f}, solve {time['solve']:.2f})"
        )
        for name in ("tip_u1", "tip_u2", "tip_u3"):
            if f"{name}_min" in f:
                low, high = (f"{f[f'{name}_{w}']:.6g} m at t = {f[f'{name}_{w}_time']:.4f} s" for w in ("min", "max"))
                lines.append(f"{name.replace('_', ' ')}: {low} … {high}, at the end {f[f'{name}_final']:.6g} m")
    else:
        finals = {k.removesuffix("_final").replace("_", " "): v for k, v in f.items() if k.endswith("_final")}
        values = (f"{name} = {value:.6g}" for name, value in finals.items())
        lines.append(f"steady state in {time['total']:.2f} s: {', '.join(values)}")
    return [*lines, f"results in {folder}"]


def modes_report(summary: dict[str, Any], folder: Path) -> list[str]:
    """Return the lines `modes` prints: a table."""
    lines = [
        f"{summary['name']}: {summary['theory']} about the {summary['about']} state at {summary['speed']:g} rad/s, "
        f"{summary['dofs']} dofs, in {summary['timings']['total']:.2f} s",
        f"effects: {', '.join(summary['effects']) or 'none'}",
        *choice_report(summary),
        f"{'mode':>4}  {'label':<16}{'rad/s':>14}{'Hz':>12}{'damping':>12}{'error':>10}",
    ]
    for row in summary["modes"]:
        lines.append(
            f"{row['mode']:>4}  {row['label']:<16}{row['frequency']:>14.6f}{row['frequency_hz']:>12.6f}"
            f"{row['damping']:>12.3e}{row['residual']:>10.1e}"
        )
    return [*lines, f"results in {folder}"]


def campbell_report(summary: dict[str, Any], folder: Path) -> list[str]:
    """Return the lines `campbell` prints: branches and critical speeds."""
    lines = [
        f"{summary['name']}: {summary['theory']}, {summary['speeds']} speeds ({summary['speeds_solved']} solved), "
        f"{summary['dofs']} dofs, in {summary['timings']['total']:.2f} s",
        *choice_report(summary),
        f"{'branch':>6}  {'label':<16}{'first rad/s':>14}{'last rad/s':>14}{'confidence':>12}",
    ]
    for b in summary["branches"]:
        first, last = (f"{b[k]:.6f}" if b[k] == b[k] else "lost" for k in ("frequency_first", "frequency_last"))
        lines.append(f"{b['branch']:>6}  {b['label']:<16}{first:>14}{last:>14}{b['confidence']:>12.3f}")
    for c in summary["critical_speeds"]:
        lines.append(f"critical speed {c['speed']:.6f} rad/s: {c['label']} meets {c['per_rev']}Ω")
    return [*lines, f"results in {folder}"]


def choice_report(summary: dict[str, Any]) -> list[str]:
    """Return the line that says which model was chosen, if one was."""
    choice = summary.get("choice")
    if choice is None:
        return []
    dropped = ", ".join(row["name"] for row in choice["dropped"]) or "nothing"
    error = f"estimated error {choice['estimated_error']:.1e} of {choice['tolerance']:g} allowed"
    return [f"chosen in {choice['seconds']:.2f} s: {choice['theory']}; left out: {dropped}; {error}"]


def explain_report(summary: dict[str, Any], folder: Path) -> list[str]:
    """Return the lines `explain` prints: dimensionless groups, then a row an effect and a theory."""
    outputs, rows = summary["outputs"], summary["rows"]
    checked = any("truth" in row for row in rows)
    lines = [
        f"{summary['name']}: {summary['theory']} with {', '.join(summary['effects']) or 'no effects'}, "
        f"in {summary['timings']['total']:.2f} s",
        *(f"{value:>12.4g}  {summary['meaning'][name]}" for name, value in summary["groups"].items()),
        f"{'relative change of':<26}" + "".join(f"{n:>10}{'true':>10}" if checked else f"{n:>10}" for n in outputs),
    ]
    for row in rows:
        what = {True: "without ", False: "with "}[row["included"]] if row["kind"] == "effect" else "theory "
        kinds = ("estimate", "truth") if checked else ("estimate",)
        cells = "".join(f"{row[kind][name]:>10.1e}" for name in outputs for kind in kinds)
        lines.append(f"{what + row['name']:<26}{cells}  {row['verdict']}: {row['why']}")
    lines += choice_report(summary)
    lines += [f"no {name}: {text}" for name, text in summary["absent_effects"].items()]
    return [*lines, f"results in {folder}"]


def _interrupt(signum: int, frame: object) -> NoReturn:
    raise KeyboardInterrupt


def main() -> None:
    """Run the command line."""
    app(prog_name="rotfem")
