"""The balance of momentum of the displaced structure, as outputs that a script asks for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import ufl

from rotfem.mechanics import work
from rotfem.numerics.forms import added

#: Directions of the frame.
AXES = [ufl.as_vector([float(i == j) for j in range(3)]) for i in range(3)]


class Rigid:
    """The variation of a rigid motion of the displaced structure: δx = s + φ×(x − x_root).

    Args:
        shift: s; none if None.
        turn: φ; none if None.
        root: x_root along direction 1, m.
    """

    def __init__(self, shift: Any = None, turn: Any = None, root: float = 0.0):
        none = ufl.as_vector([0.0, 0.0, 0.0])
        self.turn = none if turn is None else turn
        self.at_root = (none if shift is None else shift) - ufl.cross(self.turn, root * AXES[0])

    def of(self, moving: Any) -> Any:
        """Return δx of a body or a load; directors only turn."""
        return moving.rigid_turn(self.turn) + (self.at_root if getattr(moving, "is_position", True) else 0 * AXES[0])


def balance(delta: Rigid) -> Callable[[Any], Any]:
    """Return the work of inertia, gravity and loads in a rigid motion: the rate of (angular) momentum less the rest."""
    terms = (work.inertia, work.coriolis, work.centrifugal, work.euler, work.gravity, work.loads)
    return lambda m: added(term(m, delta) for term in terms)


#: Name ↦ the force that the hub must exert on a structure, by its momentum and loads (N): to be told `root_f1` … .
FORCES = {f"balance_f{i + 1}": balance(Rigid(shift=AXES[i])) for i in range(2)}
