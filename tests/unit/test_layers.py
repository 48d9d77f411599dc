"""Imports go down only, over the packages, and what is read without FEniCSx imports none of it."""

from __future__ import annotations

import ast
import subprocess
import sys
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from rotfem import registry

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
    "accuracy",
    "commands",
)
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


@cache
def tree(module: str) -> ast.Module:
    """Return a module as it is written."""
    return ast.parse(MODULES[module].read_text(encoding="utf-8"))


def imports(module: str, everywhere: bool = True) -> set[str]:
    """Return full names of what a module imports: at its head only, or inside functions too; also for type checkers."""
    found: set[str] = set()
    pending: list[ast.AST] = list(tree(module).body)
    while pending:
        node = pending.pop()
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
    """Within a package too, and for type checkers; imports inside functions, made when called, do not count."""
    order = TopologicalSorter({module: own(module, everywhere=False) for module in MODULES}).static_order()
    assert set(order) == set(MODULES)


def test_only_what_lies_above_analysis_knows_the_scene() -> None:
    """What lies below works on a problem, which a script builds as well: no scene, no file, no [tables]."""
    knowing = {name for name in MODULES if any(package(other) == "scene" for other in own(name))}
    assert {package(name) for name in knowing - set(DOORS)} == {"scene", "accuracy", "commands"}


def compared(code: ast.AST) -> set[str]:
    """Return the texts that anything is compared with: ==, in, and the cases of a match."""
    places = [node for node in ast.walk(code) if isinstance(node, ast.Compare | ast.MatchValue)]
    inside = [node for place in places for node in ast.walk(place) if isinstance(node, ast.Constant)]
    return {node.value for node in inside if isinstance(node.value, str)}


def test_no_theory_is_asked_for_by_name() -> None:
    """What a theory is like is read of it (`linear`, `exact`, `prestress`): one of a script's own is no less."""
    names = set(registry.theories.names)
    assert {module: found for module in MODULES if (found := compared(tree(module)) & names)} == {}


#: Where the classes are whose objects say themselves what they do.
SPEAKING = ("equations", "structures", "mechanics.motion", "mechanics.free_hub", "analysis")


def classes(module: str) -> set[str]:
    """Return the names of the classes that a module defines."""
    return {node.name for node in ast.walk(tree(module)) if isinstance(node, ast.ClassDef)}


def asked_for(code: ast.AST) -> set[str]:
    """Return the names of the classes that `isinstance`, `issubclass` and comparisons of `type(…)` ask for."""
    places: list[ast.AST] = []
    for node in ast.walk(code):
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("isinstance", "issubclass"):
            places.append(node.args[1])
        elif isinstance(node, ast.Compare) and "type(" in ast.unparse(node):
            places.append(node)
        elif isinstance(node, ast.MatchClass):
            places.append(node.cls)
    inside = [node for place in places for node in ast.walk(place)]
    names = {node.id for node in inside if isinstance(node, ast.Name)}
    return names | {node.attr for node in inside if isinstance(node, ast.Attribute)}


def test_nothing_branches_on_a_class_of_system_motion_structure_or_scheme() -> None:
    speaking = {name for m in MODULES if m.startswith(SPEAKING) for name in classes(m)}
    assert {"System", "NonlinearSystem", "Motion", "FreeHub", "Structure", "Plate", "GeneralisedAlpha"} <= speaking
    assert {module: found for module in MODULES if (found := asked_for(tree(module)) & speaking)} == {}


@pytest.mark.parametrize(
    "module",
    [
        "rotfem",
        "rotfem.scene",
        "rotfem.results",
        "rotfem.results.plots",
        "rotfem.commands.cli",
    ],
)
def test_nothing_of_fenicsx_is_loaded(module: str) -> None:
    """With all that the module pulls in: a bad scene is refused before FEniCSx is loaded."""
    code = f"import sys, {module}; print(*sorted({FENICSX!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=PACKAGE.parent, check=True)
    assert done.stdout.split() == []


def test_a_plain_run_loads_what_it_uses() -> None:
    """Tables of pandas, splines and figures take as long to load as FEniCSx does."""
    heavy = {"bokeh", "matplotlib", "pandas", "pint", "pyvista", "scipy", "xarray"}
    code = f"import sys, rotfem; rotfem.run; print(*sorted({heavy!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=PACKAGE.parent, check=True)
    assert done.stdout.split() == []
