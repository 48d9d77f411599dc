"""All hard cases: every module in `cases` adds those of its topics."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from tests.hard.case import Case


def catalogue() -> list[Case]:
    """Return all cases in the order of their modules.

    Raises:
        ValueError: two have one name.
    """
    modules = sorted(path.stem for path in (Path(__file__).parent / "cases").glob("*.py") if path.stem != "__init__")
    cases = [case for name in modules for case in import_module(f"tests.hard.cases.{name}").CASES]
    keys = [case.key for case in cases]
    if twice := sorted({key for key in keys if keys.count(key) > 1}):
        raise ValueError(f"two cases of one name: {twice}")
    return cases
