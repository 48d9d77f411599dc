"""What is read of a small harmonic motion q̂ e^{iωt} about an equilibrium: the tip, the root, the stations of a beam.

With y = G_K q + G_C q̇ + G_M q̈ + d f of small motions, the complex amplitude of an output is

    ŷ = (G_K + iω G_C − ω² G_M) q̂ + d f̂.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.equations.stations import StationChanges

Array = npt.NDArray[Any]


class TipOutput:
    """The unknowns at the tip.

    Args:
        system: equations of motion of the structure, the hub held.
    """

    def __init__(self, system: Any):
        self._system = system
        self.names = [f"tip_{name}" for name in system.structure.components]

    def __call__(self, x: Array, omega: float) -> Array:
        """Return the amplitudes of owned unknowns x at a frequency (rad/s)."""
        read, full = self._system.structure.tip_values, np.zeros(len(self._system.zeros()), dtype=np.complex128)
        full[: len(x)] = x
        return np.asarray(read(full.real) + 1j * read(full.imag))


class RootOutput:
    """Force and moment of the hub on the structure; what is at the state in the system is the equilibrium.

    Args:
        system: equations of motion of the structure, the hub held.
        push: part of this process in what the harmonic loads add to the forces of the clamp, (motions,).
    """

    def __init__(self, system: Any, push: Array):
        self._comm = system.comm
        self.names = [f"root_{name}" for name in system.root.names]
        self._tangents, self._push = system.clamp_tangents(), push

    def __call__(self, x: Array, omega: float) -> Array:
        """Return the amplitudes of owned unknowns x at a frequency (rad/s)."""
        K, C, M = self._tangents
        here = self._push + x @ K + 1j * omega * (x @ C) - omega**2 * (x @ M)
        return np.asarray(here if self._comm.size == 1 else self._comm.allreduce(here))


class StationOutput:
    """Section forces, strains and unknowns at stations along a beam; the equilibrium is written into the system.

    Args:
        system: equations of motion of the beam, the hub held.
        positions: of the stations, m.
        names: of the quantities that are wanted.
    """

    def __init__(self, system: Any, positions: tuple[float, ...], names: tuple[str, ...]):
        self._changes = StationChanges(system, positions)
        self._columns = [self._changes.names.index(name) for name in names]
        self.names = [f"{name}@{x:g}" for x in positions for name in names]

    def __call__(self, x: Array, omega: float) -> Array:
        """Return the amplitudes of owned unknowns x at a frequency (rad/s)."""
        v = 1j * omega * x
        real, imaginary = self._changes.of(x.real, v.real), self._changes.of(x.imag, v.imag)
        return np.asarray(real + 1j * imaginary)[:, self._columns].ravel()
