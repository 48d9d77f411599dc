"""How large the program is, by capability: lines, files, numbers named at module level, splinters, circles, a walk.

    python3 benchmarks/size.py                # a table
    python3 benchmarks/size.py --csv          # the same as CSV

Nothing of the program is run or imported: all is read from the source, so this needs no FEniCSx.
"""

from __future__ import annotations

import argparse
import ast
import csv
import sys
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "rotfem"

#: Capability ↦ what its modules begin with, dots for slashes; a module counts for the first that fits.
CAPABILITIES = {
    "error, accuracy, explain, cost": """
        accuracy commands.answers commands.cost commands.explain results.distance
    """,
    "time integration": """
        analysis.dense_output analysis.first_motion analysis.march analysis.schemes analysis.time_grid
    """,
    "loads": "mechanics.loads scene.load",
    "modes and other analyses": "analysis",
    "commands": "commands",
    "equations": "equations",
    "structures": "structures",
    "mechanics": "mechanics",
    "numerics": "numerics",
    "results": "results",
    "scene": "scene",
    "ground": "",
}


def name_of(path: Path) -> str:
    """Return the name of a module below the package, "" for the package itself."""
    return ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix("__init__").rstrip(".")


MODULES = {name_of(path): path for path in sorted(PACKAGE.rglob("*.py"))}


@cache
def tree(module: str) -> ast.Module:
    """Return the syntax tree of a module."""
    return ast.parse(MODULES[module].read_text(encoding="utf-8"))


def module_in(name: str) -> str | None:
    """Return the module that a full name lies in; None of what is not the program's."""
    if name.split(".")[0] != "rotfem":
        return None
    parts = name.split(".")[1:]
    while ".".join(parts) not in MODULES:
        parts.pop()
    return ".".join(parts)


@cache
def names_of(module: str, everywhere: bool = True) -> dict[str, str]:
    """Return local name ↦ full name of what a module imports, for type checkers too.

    Args:
        module: its name.
        everywhere: inside functions too.
    """
    found: dict[str, str] = {}
    pending: list[ast.AST] = list(tree(module).body)
    while pending:
        node = pending.pop()
        if isinstance(node, ast.Import):
            found |= {alias.asname or alias.name: alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {alias.asname or alias.name: f"{node.module}.{alias.name}" for alias in node.names}
        elif everywhere or not isinstance(node, ast.FunctionDef | ast.ClassDef):
            pending += ast.iter_child_nodes(node)
    return found


@cache
def imported(module: str, everywhere: bool = True) -> set[str]:
    """Return the modules of the program that a module imports."""
    found = {module_in(name) for name in names_of(module, everywhere).values()}
    return {name for name in found if name is not None} - {module}


def constants(module: str) -> int:
    """Return how many numbers a module names at its level: NAME = 0.1, or a tuple of names and numbers."""
    count = 0
    for node in tree(module).body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            numbers = [n for n in ast.walk(node.value) if isinstance(n, ast.Constant) and type(n.value) in (int, float)]
            plain = isinstance(node.value, ast.Constant | ast.Tuple | ast.UnaryOp | ast.BinOp)
            count += len(numbers) if plain else 0
    return count


def circles(lazy: bool) -> list[list[str]]:
    """Return circles of imports, for type checkers too, each broken where it was found; those in functions if lazy."""
    graph = {module: imported(module, everywhere=lazy) for module in MODULES}
    found: list[list[str]] = []
    while True:
        try:
            TopologicalSorter(graph).prepare()
        except CycleError as error:
            circle = error.args[1]
            found.append(circle)
            graph[circle[1]].discard(circle[0])
        else:
            return found


@cache
def functions(module: str) -> dict[str, ast.FunctionDef]:
    """Return name ↦ definition of functions and methods of a module; a class stands for its __init__."""
    found = {}
    for node in tree(module).body:
        if isinstance(node, ast.FunctionDef):
            found[node.name] = node
        elif isinstance(node, ast.ClassDef):
            methods = {f.name: f for f in node.body if isinstance(f, ast.FunctionDef)}
            found |= {f"{node.name}.{name}": method for name, method in methods.items()}
            if "__init__" in methods:
                found[node.name] = methods["__init__"]
    return found


def passed_on(module: str, function: str, parameter: str) -> Iterator[tuple[str, str, str]]:
    """Yield (module, function, parameter) of what a function calls with a parameter, or a part of it."""
    known = names_of(module)
    for call in (node for node in ast.walk(functions(module)[function]) if isinstance(node, ast.Call)):
        parts = ast.unparse(call.func).split(".")
        full = known.get(parts[0], f"rotfem.{module}.{parts[0]}")
        home, name = module_in(".".join([full, *parts[1:]])), ".".join([full.split(".")[-1], *parts[1:]])
        if home is None or name not in functions(home):
            continue
        names = [argument.arg for argument in functions(home)[name].args.args if argument.arg not in ("self", "cls")]
        given = dict(zip(names, call.args, strict=False)) | {k.arg: k.value for k in call.keywords if k.arg in names}
        for own, value in given.items():
            if parameter in {node.id for node in ast.walk(value) if isinstance(node, ast.Name)}:
                yield home, name, own


def walk(module: str, function: str, parameter: str) -> set[tuple[str, str, str]]:
    """Return the (module, function, parameter) that a parameter reaches over direct calls."""
    seen, pending = set(), [(module, function, parameter)]
    while pending:
        stay = pending.pop()
        if stay not in seen:
            seen.add(stay)
            pending += passed_on(*stay)
    return seen


def capability(module: str) -> str:
    """Return what a module belongs to."""
    return next(name for name, starts in CAPABILITIES.items() if module.startswith(tuple(starts.split()) or ""))


def rows() -> list[tuple[str, int, int, int, int]]:
    """Return capability, lines, files, numbers named at module level, files with one importer; and their sums."""
    importers = {module: {other for other in MODULES if module in imported(other)} for module in MODULES}
    table = []
    for name in CAPABILITIES:
        own = [module for module in MODULES if capability(module) == name]
        lines = sum(len(MODULES[module].read_text(encoding="utf-8").splitlines()) for module in own)
        single = sum(len(importers[module]) == 1 for module in own)
        table.append((name, lines, len(own), sum(map(constants, own)), single))
    return [*table, ("all", *(sum(row[k] for row in table) for k in range(1, 5)))]  # type: ignore[list-item]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--csv", action="store_true", help="the table as CSV, without circles and walks")
    heads, table = ("part", "lines", "files", "numbers", "one importer"), rows()
    if parser.parse_args().csv:
        csv.writer(sys.stdout).writerows([heads, *table])
        return
    print(f"{heads[0]:32}" + "".join(f"{head:>14}" for head in heads[1:]))
    for name, *figures in table:
        print(f"{name:32}" + "".join(f"{figure:14d}" for figure in figures))
    for what, found in (("at heads of modules", circles(False)), ("in functions too", circles(True))):
        print(f"\ncircles of imports {what}: {len(found)}")
        print("".join(f"  {' -> '.join(circle)}\n" for circle in found), end="")
    for verb, function in {"run": "simulate", "explain": "needed_model", "cost": "studied"}.items():
        stays = walk(f"commands.{verb}", function, "scene")
        print(f"`scene` of {verb}: {len(stays)} functions in {len({module for module, *_ in stays})} files")


if __name__ == "__main__":
    main()
