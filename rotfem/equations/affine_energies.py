"""Energies of linear theories, quadratic forms of the assembled operators."""

from __future__ import annotations

from abc import ABC
from functools import cached_property
from typing import Any

import numpy as np

from rotfem.equations.system import System


class AffineEnergies(System, ABC):
    """The energies of a system whose operators are assembled (see `rotfem.equations.affine.AffineSystem`)."""

    _operators: dict[str, Any]
    _load: Any
    _work: Any
    _qva: list[Any]

    def energies(self) -> dict[str, float]:
        """Return kinetic and strain energy and the Jacobi integral ½ v·Mv + ½ q·Kq + f·q − T0(0), J."""
        e = super().energies()
        q, v, _ = self._qva
        half = [self._quadratic(self._operators[k], x) / 2 for k, x in (("M", v), ("K", q))]
        e["jacobi"] = sum(half) + self._load.dot(q) - self._rest_energy()
        return e

    def _quadratic(self, A: Any, x: Any) -> float:
        A.mult(x, self._work)
        return float(self._work.dot(x))

    def _rest_energy(self) -> float:
        """Return T0 of the undeformed structure at the present speed, J: the constant of the Jacobi integral."""
        spin = self.model.frame.constants.get("w")
        if spin is None or "T0" not in self._energies.names:
            return 0.0
        if self.motion.pitch is not None:
            return self._undeformed_rest_energy()
        return self.rest_inertia * float(np.dot(spin.value, spin.value))

    def _undeformed_rest_energy(self) -> float:
        state = self.q.x.array.copy()
        self.q.x.array[:] = 0.0
        energy = self._energies()["T0"]
        self.q.x.array[:] = state
        return energy

    @cached_property
    def rest_inertia(self) -> float:
        """T0 of the undeformed structure at unit speed, kg·m²: half its moment of inertia about the axis."""
        spin = self.model.frame.constants["w"]
        w = spin.value.copy()
        spin.value[...] = self.motion.axis[-spin.value.size :]
        inertia = self._undeformed_rest_energy()
        spin.value[...] = w
        return inertia
