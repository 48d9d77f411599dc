"""Sums of UFL forms."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import ufl


def added(parts: Iterable[Any]) -> Any:
    """Return the sum of UFL forms; 0 of none. Zeros count as none.

    Made at once: each sum of two goes through all that is in them, and n of them n times.
    """
    forms = [part for part in parts if not isinstance(part, int)]
    if len(forms) < 2:
        return forms[0] if forms else 0
    if all(isinstance(form, ufl.Form) for form in forms):
        return ufl.Form([integral for form in forms for integral in form.integrals()])
    return sum(forms[1:], start=forms[0])
