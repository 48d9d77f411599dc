"""The forms that follow from a residual: made and compiled once, they serve the same residual on other meshes.

UFL takes longer to derive them than to compute with them on a small mesh. Which they are follows from the signature of
the residual, in which coefficients and constants stand for their places, from theory and from effects.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from rotfem.equations.model import Model
from rotfem.numerics import forms

#: Name ↦ UFL form (or what stands for it, see `rotfem.numerics.forms.drawn`), and name ↦ compiled form.
Both = tuple[dict[str, Any], dict[str, Any]]

#: Purpose, signature, theory and effects by their addresses ↦ these objects, and sketches of forms; the latest ones.
_KNOWN: dict[Any, tuple[Any, dict[str, Any]]] = {}
MOST = 32


def derived_forms(model: Model, purpose: str, functions: Sequence[Any], make: Callable[[], Both]) -> Both:
    """Return forms that follow from the residual of a model.

    Args:
        model: with the residual.
        purpose: which forms.
        functions: that they have in addition to the residual's.
        make: derives and compiles them.
    """
    residual, makers = model.residual, [model.theory, *model.acting.values()]
    key = (purpose, residual.signature(), *(id(maker) for maker in makers))
    constants = residual.constants()
    switches = [switch for switch in model.switches.values() if switch not in constants]
    whole = [*residual.coefficients(), *functions], [*constants, *switches]
    if key in _KNOWN:
        (data,) = residual.subdomain_data().values()
        sketches = _KNOWN[key][1]
        both = {name: forms.drawn(known, whole, model.structure.V, data) for name, known in sketches.items()}
        return {name: f for name, (f, _) in both.items()}, {name: compiled for name, (_, compiled) in both.items()}
    derived, compiled = make()
    sketches = {name: forms.sketch(f, compiled[name], whole) for name, f in derived.items()}
    if None not in sketches.values():
        _KNOWN[key] = makers, sketches
        if len(_KNOWN) > MOST:
            del _KNOWN[next(iter(_KNOWN))]
    return derived, compiled
