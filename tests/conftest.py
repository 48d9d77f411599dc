"""Tests marked nightly run only where they are asked for: `pytest -m nightly`, or by their full name."""

from __future__ import annotations

import pytest


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    asked = "nightly" in str(config.option.markexpr) or any("::" in str(argument) for argument in config.args)
    if asked:
        return
    kept = [item for item in items if item.get_closest_marker("nightly") is None]
    config.hook.pytest_deselected(items=[item for item in items if item.get_closest_marker("nightly") is not None])
    items[:] = kept
