"""The ladder of theories: each is a set of strain measures; a linear one may have second-order ones for its prestress.

Forces, tangents and geometric stiffness follow from the strains by differentiation (`rotfem.equations`). UFL is not
imported here: strains are imported when a form needs them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import wraps
from typing import Any, ClassVar

from rotfem.errors import InputError
from rotfem.registry import Registry, register, resolved
from rotfem.registry import theories as registered

#: Structure type ↦ number of its strain measures.
MEASURES = {"planar_beam": 3, "spatial_beam": 2, "plate": 3}

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
        quick: whether a quick study of cost tries it.
    """

    registry: ClassVar[Registry[Theory]] = registered

    name: str
    rank: float
    strains: Mapping[str, Strains]
    linear: bool = False
    exact: bool = False
    prestress: Mapping[str, Strains] = field(default_factory=dict)
    quick: bool = False

    def holds_for(self, structure: str) -> bool:
        """Return whether the theory has strains for a structure type."""
        return structure in self.strains

    def measures(self, structure: str) -> Callable[..., tuple[Any, ...]]:
        """Return the strain measures of a structure type."""
        return self._counted(self.strains[structure], structure)

    def prestress_measures(self, structure: str) -> Callable[..., tuple[Any, ...]]:
        """Return the second-order strains that the forces of the linear structure work on."""
        return self._counted(self.prestress[structure], structure)

    def _counted(self, strains: Strains, structure: str) -> Callable[..., tuple[Any, ...]]:
        """Return a function of strains that refuses another number of them."""
        function, needed = resolved(strains), MEASURES.get(structure)

        @wraps(function)
        def counted(*arguments: Any) -> tuple[Any, ...]:
            found: tuple[Any, ...] = function(*arguments)
            if needed not in (None, len(found)):
                why = f"returns {len(found)} strains, a {structure.replace('_', ' ')} needs {needed}"
                raise InputError("model.theory", self.name, why)
            return found

        return counted


def theories() -> tuple[Theory, ...]:
    """Return all theories, from the poorest to the richest."""
    return tuple(sorted(Theory.registry, key=lambda theory: theory.rank))


def richest() -> Theory:
    """Return the richest theory that holds for displacements and rotations of any size."""
    return [theory for theory in theories() if theory.exact][-1]


def _measured_in(order: str) -> dict[str, Strains]:
    """Return the strains of an order in `rotfem.mechanics.strains` by structure type."""
    return {kind: f"rotfem.mechanics.strains:{order}_{kind}" for kind in ("planar_beam", "spatial_beam", "plate")}


_LINEAR, _SECOND_ORDER, _VON_KARMAN = (_measured_in(name) for name in ("linear", "second_order", "von_karman"))

for _theory in (
    Theory("linear", 0, _LINEAR, linear=True, quick=True),
    Theory("consistent_linear", 1, _LINEAR, linear=True, prestress=_SECOND_ORDER, quick=True),
    Theory("von_karman_linear", 2, _LINEAR, linear=True, prestress=_VON_KARMAN),
    Theory("second_order", 3, _SECOND_ORDER),
    Theory("von_karman", 4, _VON_KARMAN),
    Theory("reissner", 5, _measured_in("reissner"), exact=True, quick=True),
):
    register(_theory)
