"""The command line: a command of every verb on a scene, and what works on several results or on other files."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any, NoReturn

import click
import typer

from rotfem.commands.console import Session
from rotfem.commands.verbs import OF_SCRIPTS, VERBS, asked, described
from rotfem.errors import InputError, SceneError
from rotfem.scene import Scene, load_scene
from rotfem.scene.extensions import Untrusted, load
from rotfem.scene.files import parse_override
from rotfem.version import __version__

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


#: Options that commands have, and functions have not.
SceneFile = Annotated[
    Path, typer.Argument(metavar="SCENE", parser=as_path, help="scene file (TOML)", show_default=False)
]
Json = Annotated[bool, typer.Option("--json", help="print the summary as JSON, and nothing else, on stdout")]
NoPlots = Annotated[bool, typer.Option("--no-plots", help="write no figures")]
NoAdvice = Annotated[bool, typer.Option("--no-advice", help="give no hints at the start")]
Trust = Annotated[bool, typer.Option("--trust", help="let the scene run the Python files it names")]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="print errors only")]
Debug = Annotated[bool, typer.Option("--debug", help="show the traceback of an error")]
Changes = Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="change a scene key, repeatable")]


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
    with Session():
        for path in files or ():
            load(str(path), path, "command line", "--load")


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"rotfem {__version__}")
        raise typer.Exit


# --- the verbs on a scene ---------------------------------------------------------------------------------------------

#: Names of options that differ from those of keywords.
NAMES = {"folder": ("-o", "--output"), "low": ("--from",), "high": ("--to",), "probes": ("--probe",)}

#: Annotation of a keyword ↦ type of its option; of others it is a text.
KINDS: dict[str, Any] = {
    "bool": bool,
    "int": int,
    "int | None": int | None,
    "float": float,
    "float | None": float | None,
    "str | Path | None": Path | None,
    "Sequence[tuple[float, float] | str]": list[str] | None,
}


def options_of(function: Callable[..., Any]) -> list[Parameter]:
    """Return the options that are keywords of a verb; what is True by default has one that begins with --no."""
    helps, out = described(function), []

    def option(name: str, kind: Any, default: Any, said: str, *flags: str) -> None:
        more: dict[str, Any] = {"metavar": "PATH", "parser": as_path} if kind == Path | None else {}
        annotation = Annotated[kind, typer.Option(*flags or (f"--{name.replace('_', '-')}",), help=said, **more)]
        out.append(Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=annotation))

    for name, keyword in list(signature(function).parameters.items())[1:]:
        if name in OF_SCRIPTS:
            continue
        said, kind, default = helps[name].removesuffix("."), KINDS.get(keyword.annotation, str | None), keyword.default
        if default is Parameter.empty:
            kind = str
        if default is True:
            what, _, said = said.partition("; ")
            option(f"no_{name}", bool, False, f"do not {what}")
        if default is not True or kind is not bool:
            option(name, kind, None if default in (True, ()) else default, said, *NAMES.get(name, ()))
    return out


def keywords(function: Callable[..., Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keywords of a verb that options give."""
    found = {name: given[name] for name in signature(function).parameters if given.get(name) is not None}
    off = [name.removeprefix("no_") for name in given if name.startswith("no_") and given[name]]
    return found | {name: False for name in off if name in signature(function).parameters}


def command_of(function: Callable[..., Any]) -> None:
    """Make a command of a verb."""
    verb, computes = function.__name__, "hint" in signature(function).parameters

    def call(
        scene: SceneFile,
        overrides: Changes = None,
        as_json: Json = False,
        no_advice: NoAdvice = False,
        quiet: Quiet = False,
        debug: Debug = False,
        **given: Any,
    ) -> None:
        options = keywords(function, given)
        plots, report = options.pop("plots", True), options.pop("report", False)
        folder, trust = options.pop("folder", None), options.pop("trust", False)
        with Session(as_json, quiet, debug, plots, report) as session:
            if verb == "check" and scene.is_dir():
                from rotfem.results.result_set import read_summary, said_of

                found(session, said_of(scene), read_summary(scene))
            wanted = {}
            if computes:
                wanted = asked(options.pop("accuracy", None), options.pop("budget", None), options.get("error", True))
            changes = [*(overrides or ()), *(f"{key}={json.dumps(value)}" for key, value in wanted.items())]
            session.scene = trusted(scene, changes, trust)
            prepare(session, verb, folder)
            heard = {"progress": session.bar, "hint": None if no_advice or quiet else session.advise}
            options |= {name: value for name, value in heard.items() if name in signature(function).parameters}
            result = function(session.scene, session=session, **options)
            if verb == "cost" and result.summary["recommended"] is None:
                raise result.missed()

    scene, *shared = [p for p in signature(call, eval_str=True).parameters.values() if p.kind != Parameter.VAR_KEYWORD]
    shared = [p.replace(kind=Parameter.KEYWORD_ONLY) for p in shared if computes or p.name != "no_advice"]
    call.__name__, call.__doc__ = verb, (function.__doc__ or "").partition("Args:")[0].replace("a scene", "SCENE")
    vars(call)["__signature__"] = Signature([scene, *options_of(function), *shared])
    app.command()(call)


def trusted(path: Path, changes: list[str], trust: bool) -> Scene:
    """Return the scene of a file; at a terminal ask whether it may run Python."""
    try:
        return load_scene(path, changes, trust)
    except Untrusted as error:
        if not (sys.stdin.isatty() and sys.stderr.isatty()) or not typer.confirm(f"{error}\nRun it?", err=True):
            raise
        return load_scene(path, changes, True)


def prepare(session: Session, verb: str, folder: Path | None) -> None:
    """See that there is FEniCSx, begin to show progress and make the result folder."""
    name = session.scene.name
    modules = ("mpi4py", "petsc4py", "slepc4py", "dolfinx")
    if absent := next((module for module in modules if find_spec(module) is None), ""):
        lacking = f"FEniCSx is not here (there is no module {absent}); see docs/installation.md"
        if verb != "check":
            raise InputError("", None, lacking)
        shown = session.scene.inputs[0].name
        found(session, f"{shown} is a valid scene; for more, {lacking}", {"command": "check", "name": name})
    session.start(f"{name}: {verb}", session.scene.output.speed)
    if folder is None and name in ("", ".", ".."):
        raise SceneError("command line", "-o", None, f'must be given for a scene of the name "{name}"')
    import rotfem.numerics.forms  # noqa: F401  PETSc first, which dolfinx would start in its own way

    session.open(folder or Path("results", name, verb), verb)


def found(session: Session, said: str, summary: dict[str, Any]) -> NoReturn:
    """Say what `check` finds without a computation, and end it."""
    session.print_json({**summary, "found": said})
    session.say(said)
    raise SystemExit(0)


for function in VERBS.values():
    command_of(function)


# --- what works on several results or on other files ------------------------------------------------------------------


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
    trust: Trust = False,
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

    with Session(as_json, quiet, debug, not no_plots) as session:
        session.open(output or Path("results", scene.stem, "sweep"), "sweep", [scene])
        keys = {}
        for text in overrides:
            key, _, values = text.partition("=")
            keys[key.strip()] = values_of(values.strip())
        name, *words = verb
        options: dict[str, Any] = {}
        if name in VERBS:
            commands: Any = typer.main.get_command(app)
            try:
                given = commands.commands[name].make_context(name, [str(scene), *words]).params
            except click.UsageError as error:
                raise InputError("sweep", " ".join(verb), error.format_message()) from None
            keys |= {key: [value] for key, value in (parse_override("sweep", x) for x in given["overrides"] or ())}
            options = keywords(VERBS[name], given)
            trust = options.pop("trust", False) or trust
            options = {key: value for key, value in options.items() if key not in ("scene", "folder", "plots")}
        session.start(f"{scene.stem}: sweep")
        assert session.results is not None
        result = compute(
            scene, keys, name, session.results.path, jobs=jobs, trust=trust, progress=session.bar, **options
        )
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
    rigid: Annotated[bool, typer.Option("--rigid", help="let stiffnesses that the file leaves open be large")] = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Write the scene of a blade or rotor FILE of another program.

    It may be of BeamDyn, ElastoDyn, OpenFAST, BModes, HAWC2, windIO or ROSS.
    """
    from rotfem.commands.import_blade import import_blade

    with Session(quiet=quiet, debug=debug) as session:
        scene = import_blade(file, kind, overrides or (), rigid)
        session.check_writable("-o", output, scene.inputs)
        if session.first:
            remark = f"# imported from {file.name}; axes, signs and centres as in docs/blades.md, SI units, rad\n\n"
            scene.write(output, remark)
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

    with Session(as_json, quiet, debug, not no_plots) as session:
        result = distances(*folders)
        inputs = [Path(folder) / "summary.json" for folder in folders]
        session.open(output or Path("results/compare"), "compare", inputs)
        session.finish(result)
        if tolerance is not None and not result.summary["worst"] <= tolerance:
            session.say(f"farther apart than {tolerance:g}")
            raise SystemExit(1)  # as diff(1) has it


def main() -> None:
    """Run the command line."""
    arguments = sys.argv[1:]
    del sys.argv[1:]  # where dolfinx looks for options of its own, and fails on what is not UTF-8
    app(arguments, prog_name="rotfem")
