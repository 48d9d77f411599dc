"""Output functionals: numbers that are computed at every instant that is recorded, by a form of the motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from rotfem.registry import Registry
from rotfem.registry import outputs as registered

#: mechanics ↦ functional of the motion, a UFL form without arguments; see `rotfem.mechanics.work.Mechanics`.
Functional = str | Callable[..., Any]


@dataclass(frozen=True)
class Output:
    """One output functional; `[output] quantities` of a scene names those that are wanted.

    Attributes:
        name: what a scene calls it, and the column of history.csv.
        form: mechanics ↦ its value as a UFL form.
        unit: of its value.
    """

    registry: ClassVar[Registry[Output]] = registered

    name: str
    form: Functional
    unit: str = ""
