"""The command line: parses, calls, prints."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from rotfem.errors import ComputationError, SceneError
from rotfem.reports import campbell_report, explain_report, modes_report, run_report
from rotfem.scene import load_scene
from rotfem.session import Session

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


def main() -> None:
    """Run the command line."""
    app(prog_name="rotfem")
