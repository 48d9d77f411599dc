"""Cached properties whose ground has gone."""

from __future__ import annotations

from functools import cached_property
from typing import Any


def forget(owner: Any) -> None:
    """Make an object compute all its cached properties anew when they are next asked for."""
    for name in list(vars(owner)):
        if isinstance(getattr(type(owner), name, None), cached_property):
            del vars(owner)[name]
