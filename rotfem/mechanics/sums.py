"""Sums of UFL forms, made at once: a sum of two goes through all that is in them, and n of them n times."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import ufl


def added(parts: Iterable[Any]) -> Any:
    """Return the sum of UFL forms; 0 of none. Zeros count as none."""
    forms = [part for part in parts if not isinstance(part, int)]
    if len(forms) < 2:
        return forms[0] if forms else 0
    if all(isinstance(form, ufl.Form) for form in forms):
        return ufl.Form([integral for form in forms for integral in form.integrals()])
    return sum(forms[1:], start=forms[0])


def weighted(factors: Iterable[Any], parts: Iterable[Any]) -> ufl.Form:
    """Return the sum of UFL forms, each times a scalar."""
    return ufl.Form([c * integral for c, form in zip(factors, parts, strict=True) for integral in form.integrals()])
