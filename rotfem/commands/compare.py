"""`rotfem compare`: results of two or more folders side by side."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rotfem.commands.console import Session
from rotfem.commands.job import app
from rotfem.commands.options import as_path

#: Exit status where results are farther apart than the tolerance, as diff(1) has it.
DIFFERENT = 1


@app.command()
def compare(
    folders: Annotated[list[str], typer.Argument(metavar="FOLDER FOLDER…", help="result folders, the reference first")],
    tolerance: Annotated[
        float | None, typer.Option("--tolerance", metavar="E", help="exit with status 1 if anything differs by more")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="DIR", parser=as_path, help="result folder [results/compare]"),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print the summary as JSON on stdout")] = False,
    no_plots: Annotated[bool, typer.Option("--no-plots", help="write no figure")] = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="print errors only")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="show the traceback of an error")] = False,
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
            raise SystemExit(DIFFERENT)
