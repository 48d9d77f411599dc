"""The ladder of theories: each is a set of strain measures; a linear one may have second-order ones for its prestress.

Forces, tangents and geometric stiffness follow from the strains by differentiation (`rotfem.equations`). UFL is not
imported here: strains are imported when a form needs them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from rotfem.registry import Registry, register, resolved
from rotfem.registry import theories as registered

#: What the strains of a structure type are computed by: a function, or "module:name".
Strains = str | Callable[..., tuple[Any, ...]]


@dataclass(frozen=True)
class Theory:
    """One order of the ladder.

    Attributes:
        name: what a scene calls it.
        rank: its place in the ladder, from the poorest on.
        strains: structure type ("planar_beam", "spatial_beam", "plate") ↦ strain measures. Of a planar beam and of a
            plate a function of q; of a spatial beam one of (u', θ, θ', e); see `rotfem.mechanics.strains`. That of a
            plate in an exact theory takes the director as a second argument, None for that of the angles in q.
        linear: whether the equations of motion are linear in q.
        exact: whether displacements and rotations may be of any size.
        prestress: for a linear theory, second-order strains by structure type, of its geometric stiffness under the
            forces of the spinning linear structure; empty for none.
        poorer: cheaper theories of its own family, cheapest first, which an accuracy may take instead.
        quick: whether a quick study of cost tries it.
    """

    registry: ClassVar[Registry[Theory]] = registered

    name: str
    rank: float
    strains: Mapping[str, Strains]
    linear: bool = False
    exact: bool = False
    prestress: Mapping[str, Strains] = field(default_factory=dict)
    poorer: tuple[str, ...] = ()
    quick: bool = False

    def holds_for(self, structure: str) -> bool:
        """Return whether the theory has strains for a structure type."""
        return structure in self.strains

    def measures(self, structure: str) -> Callable[..., tuple[Any, ...]]:
        """Return the strain measures of a structure type."""
        return resolved(self.strains[structure])

    def prestress_measures(self, structure: str) -> Callable[..., tuple[Any, ...]]:
        """Return the second-order strains that the forces of the linear structure work on."""
        return resolved(self.prestress[structure])


def theories() -> tuple[Theory, ...]:
    """Return all theories, from the poorest to the richest."""
    return tuple(sorted(Theory.registry, key=lambda theory: theory.rank))


def ladder() -> tuple[str, ...]:
    """Return the names of all theories, from the poorest to the richest."""
    return tuple(theory.name for theory in theories())


def richest() -> Theory:
    """Return the richest theory that holds for displacements and rotations of any size."""
    return [theory for theory in theories() if theory.exact][-1]


def stiffened() -> Theory:
    """Return the poorest linear theory that has the stiffening by stress."""
    return next(theory for theory in theories() if theory.linear and theory.prestress)


def compared(theory: Theory, structure: str) -> Theory | None:
    """Return the richer theory that a theory is compared with, for its error; None without one.

    It has the terms whose error accumulates over time: stress stiffness, which `linear` lacks, and third order, which
    nonlinear theories of moderate rotations lack. None for exact theories and linear ones with stress stiffness.
    """
    if theory.exact or (theory.linear and theory.prestress):
        return None
    richer = stiffened() if theory.linear else richest()
    holds = richer.holds_for(structure) and (not theory.linear or structure in richer.prestress)
    return richer if holds else None


def _measured_in(order: str) -> dict[str, Strains]:
    """Return the strains of an order in `rotfem.mechanics.strains` by structure type."""
    return {kind: f"rotfem.mechanics.strains:{order}_{kind}" for kind in ("planar_beam", "spatial_beam", "plate")}


_LINEAR, _SECOND_ORDER, _VON_KARMAN = (_measured_in(name) for name in ("linear", "second_order", "von_karman"))

# The nonlinear theories of moderate rotation cost what the exact one costs, so it does not have them as cheaper ones.
for _theory in (
    Theory("linear", 0, _LINEAR, linear=True, quick=True),
    Theory("consistent_linear", 1, _LINEAR, linear=True, prestress=_SECOND_ORDER, poorer=("linear",), quick=True),
    Theory("von_karman_linear", 2, _LINEAR, linear=True, prestress=_VON_KARMAN, poorer=("linear",)),
    Theory("second_order", 3, _SECOND_ORDER, poorer=("linear", "consistent_linear")),
    Theory("von_karman", 4, _VON_KARMAN, poorer=("linear", "von_karman_linear")),
    Theory("reissner", 5, _measured_in("reissner"), exact=True, poorer=("linear", "consistent_linear"), quick=True),
):
    register(_theory)
