"""Imports go down only, and what is read without FEniCSx imports none of it."""

from __future__ import annotations

import ast
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "rotfem"

#: From the ground up; a module imports from its own level and those above it in this list. "x.*" is all of package x.
LEVELS: tuple[tuple[str, ...], ...] = (
    ("errors", "quantities", "shapes", "tables", "version"),
    ("section", "section_spatial", "section_ways"),
    (
        "scene",
        "scene_analysis",
        "scene_checks",
        "scene_common",
        "scene_loads",
        "scene_motion",
        "scene_plate",
        "scene_reader",
        "scene_structure",
        "results",
    ),
    ("plots", "plots_explain", "plots_plate", "cost_grid", "cost_reference", "cost_tuned", "advice", "figures"),
    ("cost_record", "cost_front"),
    ("cost_result", "cost_report", "reports"),
    ("plots_cost",),
    ("session",),
    # FEniCSx from here on
    ("compat", "jit", "kinematics", "motion", "plate_kinematics", "rotations"),
    ("fields", "solvers", "theories", "theories.*", "effects", "structures", "structures.*"),
    ("system", "affine"),
    ("equilibrium", "integrators", "pencil"),
    ("hub",),
    ("marching", "outputs", "switches", "trial_steps"),
    ("trial",),
    ("estimate",),
    ("choice",),
    ("simulation",),
    ("modal",),
    ("reduced", "self_checks", "sensitivity", "state_space", "tracking"),
    ("modes",),
    ("campbell", "cost_measure", "groups"),
    ("cost", "explain"),
    ("cli", "", "__main__"),
)
#: Number of levels that hold no FEniCSx.
LIGHT = 8
FENICSX = {"dolfinx", "ufl", "basix", "ffcx", "petsc4py", "slepc4py"}

MODULES = {
    ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix("__init__").rstrip("."): path
    for path in sorted(PACKAGE.rglob("*.py"))
}


def level(module: str) -> int:
    """Return the level of a module ("" is the package itself)."""
    for i, names in enumerate(LEVELS):
        if module in names or (f"{module.rpartition('.')[0]}.*" in names and "." in module):
            return i
    pytest.fail(f"rotfem/{module.replace('.', '/')}.py has no level yet: put it into LEVELS of {Path(__file__).name}")


def imports(module: str, everywhere: bool) -> set[str]:
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


def own(module: str, everywhere: bool) -> set[str]:
    """Return the modules of the package that a module imports."""
    names = set()
    for name in imports(module, everywhere):
        if name == "rotfem" or name.startswith("rotfem."):
            parts = name.split(".")[1:]
            while ".".join(parts) not in MODULES:
                parts.pop()
            names.add(".".join(parts))
    return names - {module}


@pytest.mark.parametrize("module", list(MODULES))
def test_imports_go_down_only(module: str) -> None:
    here = level(module)
    up = sorted(name for name in own(module, everywhere=True) if level(name) > here)
    assert not up, f"rotfem.{module} imports from above itself: {up}"


def test_no_level_names_what_is_not_there() -> None:
    names = {name for names in LEVELS for name in names if not name.endswith(".*")}
    assert names - set(MODULES) == set()


def test_no_cycles_at_import() -> None:
    """Within a level too; imports inside functions, made when called, do not count."""
    order = TopologicalSorter({module: own(module, everywhere=False) for module in MODULES}).static_order()
    assert set(order) == set(MODULES)


@pytest.mark.parametrize("module", [name for names in LEVELS[:LIGHT] for name in names if name in MODULES])
def test_light_modules_import_no_fenicsx(module: str) -> None:
    assert {name.split(".")[0] for name in imports(module, everywhere=True)} & FENICSX == set()


@pytest.mark.parametrize(
    "module", ["rotfem", "rotfem.scene", "rotfem.results", "rotfem.plots", "rotfem.plots_cost", "rotfem.cli"]
)
def test_nothing_of_fenicsx_is_loaded(module: str) -> None:
    """As above, but with all that the module pulls in: a bad scene is refused before FEniCSx is loaded."""
    code = f"import sys, {module}; print(*sorted({FENICSX!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=PACKAGE.parent, check=True)
    assert done.stdout.split() == []


def test_an_import_from_above_is_seen() -> None:
    """The test can fail: what `cli` imports is not allowed for `errors`."""
    assert any(level(name) > level("errors") for name in own("cli", everywhere=True))
    assert "integrators" in own("simulation", everywhere=False)
    assert "modes" in own("cli", everywhere=True) - own("cli", everywhere=False)
