"""The forms that follow from a residual: made and compiled once, they serve the same residual on other meshes.

UFL takes longer to derive them than to compute with them on a small mesh. Which they are follows from the signature of
the residual, in which coefficients and constants stand for their places.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import ufl

from rotfem.equations.model import Model
from rotfem.numerics import forms

#: Name ↦ UFL form (or what stands for it, see `rotfem.numerics.forms.drawn`), and name ↦ compiled form.
Both = tuple[dict[str, Any], dict[str, Any]]

#: Purpose and signature ↦ sketches of the forms; the latest ones.
_KNOWN: dict[tuple[str, str], dict[str, Any]] = {}
MOST = 32


def derived_forms(model: Model, purpose: str, make: Callable[[], Both], more: tuple[Any, ...] = ()) -> Both:
    """Return forms that follow from the residual of a model, their purpose, and nothing else.

    Args:
        model: with the residual.
        purpose: which forms.
        make: derives and compiles them.
        more: functions and constants that they can have beyond those of the residual, always in one order.
    """
    residual = model.residual
    constants = [*residual.constants(), *(x for x in more if isinstance(x, ufl.Constant))]
    functions = [*residual.coefficients(), *(x for x in more if isinstance(x, ufl.Coefficient))]
    key, whole = (purpose, residual.signature()), (functions, constants)
    if key in _KNOWN:
        (data,) = residual.subdomain_data().values()
        both = {name: forms.drawn(known, whole, model.structure.V, data) for name, known in _KNOWN[key].items()}
        return {name: f for name, (f, _) in both.items()}, {name: compiled for name, (_, compiled) in both.items()}
    derived, compiled = make()
    sketches = {name: forms.sketch(f, compiled[name], whole) for name, f in derived.items()}
    if None not in sketches.values():
        _KNOWN[key] = sketches
        if len(_KNOWN) > MOST:
            del _KNOWN[next(iter(_KNOWN))]
    return derived, compiled
