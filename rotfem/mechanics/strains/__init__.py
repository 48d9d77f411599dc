"""The ladder of theories: each is a set of strain measures; a linear one also says whose second order it prestresses.

Forces, tangents and geometric stiffness follow from these strains by differentiation (see `rotfem.equations.system`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rotfem.mechanics.strains import linear, reissner, second_order, von_karman


@dataclass(frozen=True)
class Theory:
    """One order of the ladder.

    Attributes:
        strains: module with one function a structure type, q ↦ strains, that the stored energy is made of.
        linear: whether the equations of motion are linear in q.
        prestressed: for a linear theory, the module whose second-order strains meet the axial force of the spinning
            linear structure in the geometric stiffness; None leaves that stiffness out.
    """

    strains: Any
    linear: bool = False
    prestressed: Any = None

    def measures(self, structure: str) -> Callable[..., tuple[Any, ...]]:
        """Return the function q ↦ strains for a structure type ("planar_beam", …)."""
        return getattr(self.strains, structure)

    def prestress_measures(self, structure: str) -> Callable[..., tuple[Any, ...]]:
        """Return the second-order strains, q ↦ strains, that an axial force of the linear structure works on."""
        return getattr(self.prestressed, structure)


THEORIES: dict[str, Theory] = {
    "linear": Theory(linear, linear=True),
    "consistent_linear": Theory(linear, linear=True, prestressed=second_order),
    "von_karman_linear": Theory(linear, linear=True, prestressed=von_karman),
    "second_order": Theory(second_order),
    "von_karman": Theory(von_karman),
    "reissner": Theory(reissner),
}
