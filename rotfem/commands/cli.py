"""The command line: the verbs on a scene, and what works on several results or on other files."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from rotfem.commands.console import Session
from rotfem.commands.verbs import Debug, Json, NoPlots, Quiet, SceneFile, app, as_path, folder_option


@app.command()
def sweep(
    scene: SceneFile,
    verb: Annotated[
        list[str],
        typer.Argument(metavar="-- VERB…", help="run, modes, campbell, response, unbalance or check, with options"),
    ],
    overrides: Annotated[
        list[str], typer.Option("--set", metavar="KEY=A:B:N", help="values of a scene key, or KEY=A,B,…; repeatable")
    ],
    output: Annotated[Path | None, folder_option("results/<scene name>/sweep")] = None,
    jobs: Annotated[int, typer.Option("-j", "--jobs", min=1, metavar="N", help="processes that compute")] = 1,
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

    with Session(as_json, quiet, debug, no_plots) as session:
        folder = session.folder(output or Path("results", scene.stem, "sweep"), "sweep", [scene])
        keys = {}
        for text in overrides:
            key, _, values = text.partition("=")
            keys[key.strip()] = values_of(values.strip())
        session.start(f"{scene.stem}: sweep")
        result = compute(scene, keys, verb, folder.path, jobs=jobs, progress=session.bar)
        session.finish(result)


@app.command("import")
def import_(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", parser=as_path, help="blade or rotor file", show_default=False)
    ],
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
    """Write the scene of a blade or rotor FILE of another program.

    It may be of BeamDyn, ElastoDyn, OpenFAST, BModes, HAWC2, windIO or ROSS.
    """
    from rotfem.commands.import_blade import import_blade, write_imported

    with Session(quiet=quiet, debug=debug) as session:
        scene = import_blade(file, kind, overrides or ())
        session.check_writable("-o", output, scene.inputs)
        if session.first:
            write_imported(scene, file, output)
        for line in () if quiet else scene.hints:
            session.advise(line)
        structure: Any = scene.structure
        session.say(f"{output}: {structure.type} of {file.name}, rows at {len(structure.knots) + 2} places")


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

    with Session(as_json, quiet, debug, no_plots) as session:
        result = distances(*folders)
        inputs = [Path(folder) / "summary.json" for folder in folders]
        session.folder(output or Path("results/compare"), "compare", inputs)
        session.finish(result)
        if tolerance is not None and not result.summary["worst"] <= tolerance:
            session.say(f"farther apart than {tolerance:g}")
            raise SystemExit(1)  # as diff(1) has it


def main() -> None:
    """Run the command line."""
    arguments = sys.argv[1:]
    del sys.argv[1:]  # where dolfinx looks for options of its own, and fails on what is not UTF-8
    app(arguments, prog_name="rotfem")
