"""What the documentation names is there: modules, attributes, files, links; and what is public is named."""

from __future__ import annotations

import ast
import importlib
import inspect
import re
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import rotfem
from rotfem.scene import Scene

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]

DOTTED = re.compile(r"(?<![\w./-])rotfem(?:\.[A-Za-z_]\w*)+(?![\w/-])")
FILE = re.compile(r"(?<![\w./*-])(?:rotfem|tests|demos|docs|meshes|benchmarks|\.ci)/[\w./*-]*[\w/*]")
LINK = re.compile(r"\]\(([^)\s]+)\)")
#: A word of code with dots in it, and whatever stands behind it in the same span.
SPAN = re.compile(r"`([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)+)(?:\([^`]*\))?`")
ENDINGS = set("py sh toml json jsonl csv dat md png gif svg pdf html msh bp h5 nc npz log opt cache lock xdmf".split())  # noqa: SIM905
#: What a first word may be that is no module or class of the program: packages of others, tables of a scene and of
#: summary.json, and what the examples call a mechanics, a variation and a body.
OUTSIDE = {"ufl", "np", "numpy", "scipy", "dolfinx", "fem", "MPI", "section", "choice", "m", "delta", "body"}
#: A class, alone.
CLASS = re.compile(r"`([A-Z][a-z]+(?:[A-Z][a-z]+)+)`")


def resolve(name: str) -> Any:
    """Return what a dotted name stands for, an attribute that objects have by what their class says of it.

    Raises:
        LookupError: nothing has that name.
    """
    parts = name.split(".")
    for n in range(len(parts), 0, -1):
        try:
            found: Any = importlib.import_module(".".join(parts[:n]))
        except ModuleNotFoundError:
            continue
        for part in parts[n:]:
            found = member(found, part)
        return found
    raise LookupError(name)


def member(owner: Any, name: str) -> Any:
    """Return an attribute of a module, a class, or the objects of a class.

    Raises:
        LookupError: there is none.
    """
    if hasattr(owner, name):
        return getattr(owner, name)
    if inspect.isclass(owner):
        for base in (base for base in owner.__mro__ if base.__module__.startswith("rotfem")):
            if name in getattr(base, "__annotations__", {}) or re.search(rf"\bself\.{name}\b", inspect.getsource(base)):
                return None
    raise LookupError(f"{owner} has no {name}")


@cache
def defined() -> dict[str, list[str]]:
    """Return last name ↦ full names of all modules and classes of the program."""
    out: dict[str, list[str]] = {}
    for path in (ROOT / "rotfem").rglob("*.py"):
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        out.setdefault(module.rpartition(".")[2], []).append(module)
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef):
                out.setdefault(node.name, []).append(f"{module}.{node.name}")
    return out


def own_names(text: str) -> set[str]:
    """Return the names that the Python examples of a document bind, and those of `OUTSIDE` and of a scene."""
    names = {*OUTSIDE, *Scene.model_fields}
    for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                names.add(node.id)
            elif isinstance(node, ast.FunctionDef | ast.ClassDef):
                names.add(node.name)
    return names


def missing(name: str, own: set[str]) -> bool:
    """Return whether a span of code with dots in it names something of the program that is not there."""
    first, _, rest = name.partition(".")
    if first in own or first == "rotfem" or name.rpartition(".")[2] in ENDINGS:
        return False
    for full in defined().get(first, []):
        try:
            resolve(f"{full}.{rest}")
        except LookupError:
            continue
        return False
    return True


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_names_are_there(document: Path) -> None:
    text = document.read_text(encoding="utf-8")
    for name in sorted(set(DOTTED.findall(text))):
        resolve(name)
    own = own_names(text)
    assert [name for name in SPAN.findall(text) if missing(name, own)] == []
    assert set(CLASS.findall(text)) - own <= set(defined())


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_files_are_there(document: Path) -> None:
    text = document.read_text(encoding="utf-8")
    paths = {path.rstrip(".") for path in FILE.findall(text)}
    assert [path for path in sorted(paths) if not any(ROOT.glob(path))] == []
    folders = [ROOT / name for name in ("", "demos", "meshes")]
    alone = set(re.findall(r"`([\w.-]+\.(?:py|sh))`", text))
    assert [name for name in sorted(alone) if not any((folder / name).exists() for folder in folders)] == []


def slugs(document: Path) -> set[str]:
    """Return the anchors of the headings of a document, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", document.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("document", [*DOCUMENTS, ROOT / "CHANGELOG.md"], ids=lambda path: path.name)
def test_links_lead_somewhere(document: Path) -> None:
    for target in LINK.findall(document.read_text(encoding="utf-8")):
        if target.startswith(("http", "mailto")):
            continue
        path, _, anchor = target.partition("#")
        there = document.parent / path if path else document
        assert there.exists(), target
        assert not anchor or anchor in slugs(there), target


def test_what_is_public_is_documented() -> None:
    text = "\n".join(document.read_text(encoding="utf-8") for document in DOCUMENTS)
    names = [name for name in rotfem.__all__ if name != "__version__"]
    assert [name for name in names if not re.search(rf"\brotfem\.{name}\b", text)] == []
