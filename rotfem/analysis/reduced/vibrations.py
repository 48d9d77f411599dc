"""What the steps of a collocation put vibrations off in all of a history, those that they damp away among them.

A step of Radau IIA of order 5 multiplies a vibration e^{λt} by

    R(z) = (1 + 2z/5 + z²/20) / (1 − 3z/5 + 3z²/20 − z³/60),    z = λh,

(Hairer & Wanner, Solving Ordinary Differential Equations II, IV.5) instead of e^z. Steps that are long for a vibration
take it away, and steps half as long do so too: their difference does not show it. How large it is does: a history
starts with all of it, and ζ̇/λ of its coordinate ζ is what is not static.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rotfem.analysis.reduced.model import SINGULAR, ReducedModel
from rotfem.analysis.reduced.tips import tips_of

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Vibrations:
    """Vibrations of a reduced model in a history.

    Attributes:
        rates: λ of each, 1/s.
        sizes: largest displacement of the tip by each, m.
    """

    rates: npt.NDArray[np.complex128]
    sizes: Array

    @classmethod
    def of(cls, model: ReducedModel, c: Array, v: Array, a: Array) -> Vibrations:
        """Return the vibrations in rows of a history.

        Args:
            model: the reduced model.
            c: factors of all pieces whose matrices are taken, (pieces,).
            v: rates of the coordinates in the rows, (n, m).
            a: accelerations, (n, m).
        """
        M, C, K = (x[0] for x in model.operators(c[None, :])[:3])
        m = model.size
        if m == 0 or np.linalg.cond(M) > SINGULAR:
            return cls.none()
        A = np.block([[np.zeros((m, m)), np.eye(m)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
        rates, shapes = np.linalg.eig(A)
        moving = rates.imag > 0.0
        coordinates = np.linalg.solve(shapes, np.hstack([v, a]).T)[moving]
        names = model.system.structure.components
        rows = tips_of(model)[[name.startswith("u") for name in names]]
        tips = np.linalg.norm(rows @ shapes[:m, moving], axis=0)
        rates = rates[moving]
        return cls(rates, 2 * tips * np.abs(coordinates).max(axis=1, initial=0.0) / np.abs(rates))

    @classmethod
    def none(cls) -> Vibrations:
        """Return no vibrations."""
        return cls(np.empty(0, dtype=complex), np.empty(0))

    def beyond(self, least: float) -> Vibrations:
        """Return those that move the tip by so much (m): ζ̇/λ of a slow motion is small, but not nothing."""
        kept = self.sizes > least
        return Vibrations(self.rates[kept], self.sizes[kept])

    def off(self, ends: Array, parts: int) -> float:
        """Return what steps put the tip off, m, if each is cut in so many parts.

        Args:
            ends: of the steps, s.
            parts: of each.
        """
        whole = float(ends[-1] - ends[0])
        # steps that round-off alone tells apart are one
        shares, number = np.unique(np.round(np.diff(ends) / (parts * whole), 12), return_counts=True)
        z, number = self.rates[:, None] * whole * shares, parts * number
        taken = (1 + 2 * z / 5 + z**2 / 20) / (1 - 3 * z / 5 + 3 * z**2 / 20 - z**3 / 60)
        true = np.exp(z)
        lost = np.abs(taken - true) @ number
        kept = np.exp(np.minimum(0.0, np.log(np.abs(taken) / np.maximum(np.abs(true), 1e-300)) @ number))
        # one that is damped does not gather more than it does until it is gone
        decay = np.maximum(-self.rates.real, 1e-300) * whole
        lost *= np.minimum(1.0, 1 / (np.e * decay))
        return float(self.sizes @ np.minimum(lost, 1 + kept))
