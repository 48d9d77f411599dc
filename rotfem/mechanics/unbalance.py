"""Unbalance of a shaft: masses beside its axis as forces that turn with it.

A mass m at a distance e from the axis, at an angle β in the section, pushes with −m d²/dt² of e n, n = (cos φ, sin φ),
φ = ψ + β in the fixed frame (φ = β in one that turns with the shaft):

    f = m e (Ω² n − Ω̇ e₁×n)                    (Genta, Dynamics of Rotating Systems, 2005, section 2.3).

At a constant speed it is Re(m e Ω² (e₂ − i e₃) e^{i(Ωt + β)}).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import atan2, hypot
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.mechanics.loads import Load, Loads, Shapes, Term
from rotfem.mechanics.motion import Motion

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Unbalance:
    """One unbalance.

    Attributes:
        x: place along the shaft, m.
        moment: m e, kg·m.
        phase: β, rad, from direction 2 towards direction 3.
        start: time after which it pushes, s, as after the loss of a blade; by default a history's begin.
    """

    x: float
    moment: float
    phase: float = 0.0
    start: float = 0.0

    @property
    def amplitude(self) -> npt.NDArray[np.complex128]:
        """Amplitude m e (e₂ − i e₃) e^{iβ}, components along directions 2 and 3, kg·m; of a spin about direction 1."""
        return np.asarray(self.moment * np.exp(1j * self.phase) * np.array([1.0, -1.0j]))

    def load(self, motion: Motion, turning: bool) -> Load:
        """Return its force in the fixed frame, or in one that turns with the shaft."""
        sense = float(np.sign(motion.axis[0]))

        def force(t: float) -> tuple[float, float]:
            if t <= self.start:
                return 0.0, 0.0
            angle = self.phase if turning else sense * motion.angle(t) + self.phase
            speed, rate = motion.speed(t) ** 2, sense * motion.rate(t)
            c, s = np.cos(angle), np.sin(angle)
            return self.moment * (speed * c + rate * s), self.moment * (speed * s - rate * c)

        both = Shapes.uniform([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        knots = tuple(sorted({self.start, *motion.sharp}))
        term = Term(both, lambda times: np.array([force(float(t)) for t in times]), knots, linear=False)
        return Load("dead", (term,))


def unbalances(structure: Any, given: Sequence[Any] = ()) -> tuple[Unbalance, ...]:
    """Return the unbalances of a shaft: of its masses off the axis, and of a scene's table."""
    masses = [(m.x, m.mass, m.offset) for m in structure.bodies.values()]
    own = [Unbalance(x, mass * hypot(y, z), atan2(z, y)) for x, mass, (_, y, z) in masses if mass * hypot(y, z) > 0]
    return (*own, *(Unbalance(u.x, u.moment, u.phase, u.start) for u in given))


def pushed(loads: Loads, found: Sequence[Unbalance], motion: Motion, turning: bool) -> Loads:
    """Return loads with the forces of unbalances at further places."""
    first = len(loads.places)
    named = {f"at.{first + i}.force": u.load(motion, turning) for i, u in enumerate(found)}
    places = (*loads.places, *((u.x,) for u in found))
    return replace(loads, named={**loads.named, **named}, places=places)
