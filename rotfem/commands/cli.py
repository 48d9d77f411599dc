"""The command line: parses, calls, prints."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rotfem.commands.console import Session, missing
from rotfem.commands.job import Debug, Job, Json, NoPlots, Quiet, SceneFile, app, as_path, command, folder_option
from rotfem.errors import SceneError, input_of
from rotfem.units import split_unit

if TYPE_CHECKING:
    from rotfem.results.result_set import Writer


@command()
def run(
    todo: Job,
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
    store = RunStore(todo.session.comm, todo.results, every, resume)
    hint = todo.hint if todo.scene.accuracy is None else todo.session.bar.says
    shown, parts = todo.show, error is not None
    todo.finish(simulate(todo.scene, store, todo.progress, hint, shown=shown, parts=parts))


@command()
def modes(
    todo: Job,
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

    count = todo.scene.modes.count
    if animate is not None and not 1 <= animate <= count:
        raise SceneError("command line", "--animate", animate, f"must be from 1 to modes.count, {count}")
    result = analyse(
        todo.scene,
        sensitivities=sensitivities,
        blade_tables=blade_tables,
        participation=participation,
        comm=todo.session.comm,
        hint=todo.hint,
    )
    further: list[Writer] = []
    if state_space or matrices:
        from rotfem.analysis.state_space import serial, write_matrices
        from rotfem.analysis.state_space import state_space as reduce

        with input_of(todo.scene.file):
            if state_space:
                model = reduce(result.analysis, result.spinning, todo.scene.modes.count)
                further.append(lambda folder: model.write(folder / "state_space.npz"))
            if matrices:
                serial(result.analysis, "the export of matrices")
                further.append(lambda folder: write_matrices(result.analysis, result.spinning, folder))
    if animate is not None:
        from rotfem.results.surfaces import animate as draw

        further.append(lambda folder: draw(result, animate, folder))
    todo.finish(result, further)


@command()
def campbell(
    todo: Job,
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
) -> None:
    """Compute the Campbell diagram and critical speeds of SCENE.

    Of one that was interrupted the finished speeds are kept; the same command goes on from there.
    """
    from rotfem.commands.campbell import campbell as sweep

    marks: dict[str, Any] = {
        "orders": per_rev if orders is None else listed("--orders", orders, int),
        "rated": None if rated is None else speeds_of("--rated", rated, 1)[0],
        "operating": None if operating is None else speeds_of("--operating", operating, 2),
    }
    marks |= {"only": only, "folder": todo.results.path, "progress": todo.progress, "hint": todo.hint}
    result = sweep(todo.scene, speeds, comm=todo.session.comm, **marks)
    todo.finish(result)


@command(computes=False)
def response(
    todo: Job,
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

    orders = listed("--per-rev", per_rev, float) or ()
    result = answers(todo.scene, low, high, number=number, per_rev=orders, comm=todo.session.comm)
    todo.finish(result)


def look(session: Session, path: Path, overrides: Sequence[str]) -> bool:
    """Say how the results of a folder ended, or, without FEniCSx, that a scene is valid; return whether either was."""
    if path.is_dir():
        from rotfem.results.result_set import read_summary, said_of

        said = said_of(path)
        session.print_json({**read_summary(path), "found": said})
    elif lacking := missing():
        from rotfem.scene import load_scene

        scene = load_scene(path, overrides)
        said = f"{path} is a valid scene; for more, {lacking}"
        session.print_json({"command": "check", "name": scene.name, "found": said})
    else:
        return False
    session.say([said])
    return True


@command(computes=False, first=look)
def check(todo: Job) -> None:
    """Show mass, centre of mass and inertias of SCENE, and draw it.

    No motion is computed. Of a result folder it says how the computation ended.
    """
    from rotfem.commands.check import check as weigh

    todo.finish(weigh(todo.scene, comm=todo.session.comm))


@command(computes=False)
def explain(
    todo: Job,
    check: Annotated[
        bool, typer.Option("--check", help="run the full models too: true changes next to the estimates")
    ] = False,
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
        todo.session.check_writable("--write", write, todo.scene.inputs)
    scene = todo.scene if accuracy is None else todo.scene.replace({"accuracy": accuracy})
    result = estimate(scene, check=check, comm=todo.session.comm, progress=todo.progress)
    todo.finish(result)
    if write is not None and todo.session.first:
        within = result.summary["needed"]["accuracy"]
        remark = f"# {todo.scene.name} with the theory and the effects that it needs for {within:g}.\n\n"
        write_variant(todo.scene, result.needed, write, remark)
        todo.session.say([f"scene with what it needs in {write}"])


@command(computes=False)
def cost(
    todo: Job,
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
    from rotfem import cost as study

    if write is not None:
        todo.session.check_writable("--write", write, todo.scene.inputs)
    result = study(
        todo.scene,
        quick=quick,
        accuracy=accuracy,
        output=of,
        budget=budget,
        theories=listed("--theories", theories, str),
        schemes=listed("--schemes", schemes, str),
        comm=todo.session.comm,
        progress=todo.progress,
    )
    todo.finish(result)
    if result.summary["recommended"] is None:
        raise result.missed()
    if write is not None and todo.session.first:
        result.write_tuned(write)
        todo.session.say([f"tuned scene in {write}"])


@app.command()
def sweep(
    scene: SceneFile,
    verb: Annotated[
        list[str], typer.Argument(metavar="-- VERB…", help="run, modes, campbell, response or check, with its options")
    ],
    overrides: Annotated[
        list[str], typer.Option("--set", metavar="KEY=A:B:N", help="values of a scene key, or KEY=A,B,…; repeatable")
    ],
    output: Annotated[Path | None, folder_option("results/<scene name>/sweep")] = None,
    jobs: Annotated[int, typer.Option("-j", "--jobs", metavar="N", help="processes that compute")] = 1,
    as_json: Json = False,
    no_plots: NoPlots = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Run a verb over a grid of scene keys, on several processes.

    A sweep that was stopped goes on where it was.
    """
    from rotfem.commands.sweep import sweep as compute
    from rotfem.commands.sweep import values_of

    with Session(as_json, quiet, debug) as session:
        folder = session.folder(output or Path("results", scene.stem, "sweep"), "sweep", [scene])
        keys = {}
        for text in overrides:
            key, _, values = text.partition("=")
            keys[key.strip()] = values_of(values.strip())
        session.start(f"{scene.stem}: sweep")
        result = compute(scene, keys, verb, folder.path, jobs=jobs, comm=session.comm, progress=session.bar)
        session.finish(result, not no_plots)


@app.command("import")
def import_(
    file: Annotated[Path, typer.Argument(metavar="FILE", parser=as_path, help="blade file", show_default=False)],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="SCENE", parser=as_path, help="scene to write")],
    kind: Annotated[
        str | None, typer.Option("--format", metavar="NAME", help="format, if the file does not say")
    ] = None,
    overrides: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="scene key in addition to the file, repeatable"),
    ] = None,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Write the scene of a blade FILE of another program.

    It may be of BeamDyn, ElastoDyn, OpenFAST, BModes, HAWC2 or windIO.
    """
    from rotfem.commands.import_blade import import_blade, write_imported

    with Session(quiet=quiet, debug=debug) as session:
        scene = import_blade(file, kind, overrides or ())
        session.check_writable("-o", output, scene.inputs)
        if session.first:
            write_imported(scene, file, output)
        if hint := session.hint(False):
            for line in scene.hints:
                hint(line)
        structure: Any = scene.structure
        session.say([f"{output}: {structure.type} of {file.name}, rows at {len(structure.knots) + 2} places"])


@app.command()
def compare(
    folders: Annotated[list[str], typer.Argument(metavar="FOLDER FOLDER…", help="result folders, the reference first")],
    tolerance: Annotated[
        float | None, typer.Option("--tolerance", metavar="E", help="exit with status 1 if anything differs by more")
    ] = None,
    output: Annotated[Path | None, folder_option("results/compare")] = None,
    as_json: Json = False,
    no_plots: NoPlots = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Compare results in folders with those in the first folder.

    Histories, modes, branches, critical speeds and peaks are compared.
    """
    from rotfem.results.compare import compare as distances

    with Session(as_json, quiet, debug) as session:
        result = distances(*folders)
        inputs = [Path(folder) / "summary.json" for folder in folders]
        session.folder(output or Path("results/compare"), "compare", inputs)
        session.finish(result, not no_plots)
        if tolerance is not None and not result.summary["worst"] <= tolerance:
            session.say([f"farther apart than {tolerance:g}"])
            raise SystemExit(1)  # as diff(1) has it


def listed(option: str, text: str | None, kind: Callable[[str], Any]) -> list[Any] | None:
    """Return the values of an option such as "2,3"; None where it is not given."""
    if text is None:
        return None
    try:
        return [kind(part.strip()) for part in text.split(",")]
    except ValueError:
        what = "integers" if kind is int else "numbers"
        raise SceneError("command line", option, text, f"must be {what} separated by commas") from None


def speeds_of(option: str, text: str, number: int) -> list[float]:
    """Return so many speeds (rad/s) of an option such as "6.9:12.1rpm"."""
    try:
        numbers, unit = split_unit(text)
        speeds = [float(part) * unit for part in numbers.split(":")]
        if len(speeds) == number:
            return speeds
    except ValueError:
        pass
    allowed = {1: "a speed, rad/s or as 12.1rpm", 2: "two speeds low:high, rad/s or as 6.9:12.1rpm"}[number]
    raise SceneError("command line", option, text, f"must be {allowed}")


def main() -> None:
    """Run the command line."""
    arguments = sys.argv[1:]
    del sys.argv[1:]  # where dolfinx looks for options of its own, and fails on what is not UTF-8
    app(arguments, prog_name="rotfem")
