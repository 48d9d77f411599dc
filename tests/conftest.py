"""What holds for all tests.

Those marked nightly run only where they are asked for: `pytest -m nightly`, or by their full name. Forms are compiled
in haste, as most are used for few steps on few cells: that takes half the time.
"""

from __future__ import annotations

import gc
import importlib.metadata
import os
import sys
from functools import cache

import pytest

os.environ.setdefault("ROTFEM_HASTE", "1")  # before rotfem is imported, and for the processes that tests start
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # each of these would translate the package anew, 0.3 s
sys.dont_write_bytecode = False
# setuptools asks six times for each form what all installed packages offer: half of the time of a small one.
importlib.metadata.entry_points = cache(importlib.metadata.entry_points)
gc.set_threshold(100_000)  # expressions of UFL are many small objects in use, and looked at for nothing


def pytest_collection_finish() -> None:
    """Take what the imports left out of all collections to come: a study of cost collects before each measurement."""
    gc.collect()
    gc.freeze()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    asked = "nightly" in str(config.option.markexpr) or any("::" in str(argument) for argument in config.args)
    if asked:
        return
    kept = [item for item in items if item.get_closest_marker("nightly") is None]
    config.hook.pytest_deselected(items=[item for item in items if item.get_closest_marker("nightly") is not None])
    items[:] = kept
