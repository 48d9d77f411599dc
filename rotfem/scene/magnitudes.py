"""What a section comes to: numbers that are each allowed may make a stiffness or a mass that is none."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from rotfem.scene.values import Array, problem

#: Sizes that a stiffness or a mass may have, if it is not 0; beyond them the products of the elements are none.
SMALLEST, LARGEST = 1e-140, 1e140

#: Properties of a section without which it moves all the same.
MAY_BE_ZERO = ("rotary_inertia", "rotary_inertia2", "rotary_inertia3")


def check_magnitudes(values: Callable[[], Mapping[str, Array]], key: str) -> None:
    """Refuse what a section makes of good numbers: infinite, undefined, or nothing at all.

    Args:
        values: returns the properties of the section by name, each of any shape.
        key: where the section is given.

    Raises:
        PydanticCustomError: names the property.
    """
    with np.errstate(all="ignore"):
        try:
            found = values()
        except (OverflowError, ZeroDivisionError):
            raise problem(key, None, "its numbers cannot be multiplied: too large or too small") from None
    for name, value in found.items():
        size = np.abs(value)
        good = (size == 0.0) | ((size >= SMALLEST) & (size <= LARGEST))
        if np.all(good & (size > 0.0) if name not in MAY_BE_ZERO else good):
            continue
        worst = float(np.ravel(value)[np.argmin(good & (size > 0.0))])
        reason = f"its {name} comes out as {worst:g}; must be from {SMALLEST:g} to {LARGEST:g} in size"
        raise problem(key, None, reason)
