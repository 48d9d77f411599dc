"""Imports go down only, over the packages, and what is read without FEniCSx imports none of it."""

from __future__ import annotations

import ast
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "rotfem"

#: From the ground up; a package imports from itself and those before it. "" are the modules of no package.
ORDER = (
    "",
    "scene",
    "results",
    "numerics",
    "mechanics",
    "structures",
    "equations",
    "analysis",
    "selection",
    "commands",
)
#: Those that are read without FEniCSx.
LIGHT = ("", "scene", "results")
FENICSX = {"dolfinx", "ufl", "basix", "ffcx", "petsc4py", "slepc4py"}

MODULES = {
    ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix("__init__").rstrip("."): path
    for path in sorted(PACKAGE.rglob("*.py"))
}
#: They are the package's door: they open what lies above.
DOORS = ("", "__main__")


def package(module: str) -> str:
    """Return the package that a module is in."""
    first = module.split(".")[0]
    return first if (PACKAGE / first).is_dir() else ""


def imports(module: str, everywhere: bool = True) -> set[str]:
    """Return full names of what a module imports: at its head only, or inside functions too; not for type checkers."""
    tree = ast.parse(MODULES[module].read_text(encoding="utf-8"))
    found: set[str] = set()
    pending: list[ast.AST] = list(tree.body)
    while pending:
        node = pending.pop()
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: relative import"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif everywhere or not isinstance(node, ast.FunctionDef | ast.ClassDef):
            pending += ast.iter_child_nodes(node)
    return found


def own(module: str, everywhere: bool = True) -> set[str]:
    """Return the modules of the program that a module imports."""
    names = set()
    for name in imports(module, everywhere):
        if name == "rotfem" or name.startswith("rotfem."):
            parts = name.split(".")[1:]
            while ".".join(parts) not in MODULES:
                parts.pop()
            names.add(".".join(parts))
    return names - {module}


@pytest.mark.parametrize("module", [name for name in MODULES if name not in DOORS])
def test_imports_go_down_only(module: str) -> None:
    here = ORDER.index(package(module))
    up = sorted(name for name in own(module) if ORDER.index(package(name)) > here)
    assert not up, f"rotfem.{module} imports from above itself: {up}"


def test_every_package_has_its_place() -> None:
    assert {package(module) for module in MODULES} == set(ORDER)


def test_no_cycles_at_import() -> None:
    """Within a package too; imports inside functions, made when called, do not count."""
    order = TopologicalSorter({module: own(module, everywhere=False) for module in MODULES}).static_order()
    assert set(order) == set(MODULES)


@pytest.mark.parametrize("module", [name for name in MODULES if package(name) in LIGHT])
def test_light_modules_import_no_fenicsx(module: str) -> None:
    assert {name.split(".")[0] for name in imports(module)} & FENICSX == set()


@pytest.mark.parametrize(
    "module",
    [
        "rotfem",
        "rotfem.scene",
        "rotfem.results",
        "rotfem.results.plots",
        "rotfem.commands.cost.plot",
        "rotfem.commands.cli",
    ],
)
def test_nothing_of_fenicsx_is_loaded(module: str) -> None:
    """As above, but with all that the module pulls in: a bad scene is refused before FEniCSx is loaded."""
    code = f"import sys, {module}; print(*sorted({FENICSX!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=PACKAGE.parent, check=True)
    assert done.stdout.split() == []


def test_an_import_from_above_is_seen() -> None:
    """The test can fail: what the command line imports is not allowed for the ground."""
    assert any(package(name) == "commands" for name in own("commands.cli"))
    assert "commands.modes" in own("commands.cli") - own("commands.cli", everywhere=False)
