"""What is read of a small harmonic motion q̂ e^{iωt} about an equilibrium: the tip, the root, the stations of a beam.

With y = G_K q + G_C q̇ + G_M q̈ + d f of small motions x e^{st}, the complex amplitude of an output is

    ŷ = (G_K + s G_C + s² G_M) x + d f̂.

Outputs are called for the first part, of a forced motion with s = iω, of a mode with s = λ; the second is `given`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.equations.stations import StationChanges
from rotfem.structures.root_reaction import along_axis

Array = npt.NDArray[Any]


class TipOutput:
    """The unknowns at the tip.

    Args:
        system: equations of motion of the structure, the hub held.
    """

    def __init__(self, system: Any):
        self._system = system
        self.names = [f"tip_{name}" for name in system.structure.components]
        self.given: Array = np.zeros(len(self.names))

    def __call__(self, x: Array, s: complex) -> Array:
        """Return the amplitudes of a motion x e^{st} of the owned unknowns."""
        read, full = self._system.structure.tip_values, np.zeros(len(self._system.zeros()), dtype=np.complex128)
        n = len(self._system.root.weights)  # without the angle of a free hub
        full[:n] = x[:n]
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
        self._tangents = system.clamp_tangents()
        self.given: Array = np.asarray(push if system.comm.size == 1 else system.comm.allreduce(push))

    def __call__(self, x: Array, s: complex) -> Array:
        """Return the amplitudes of a motion x e^{st} of the owned unknowns."""
        here = self._part(x, s)
        return np.asarray(here if self._comm.size == 1 else self._comm.allreduce(here))

    def _part(self, x: Array, s: complex) -> Array:
        """Return the part of this process."""
        K, C, M = self._tangents
        x = x[: len(K)]
        return np.asarray(x @ K + s * (x @ C) + s**2 * (x @ M))


class HubOutput:
    """The angle of a free hub.

    Args:
        system: equations of motion of hub and structure.
    """

    names = ("psi",)

    def __init__(self, system: Any):
        self._comm = system.comm
        self.given: Array = np.zeros(1)

    def __call__(self, x: Array, s: complex) -> Array:
        """Return the amplitude (rad) of owned unknowns x, the angle last on the last process."""
        last = self._comm.size - 1
        psi = x[-1] if self._comm.rank == last else 0.0
        return np.array([psi if last == 0 else self._comm.bcast(psi, last)])


class RootOfFreeHub(RootOutput):
    """The same where the hub is free, in balance with its equation (see `BorderedSystem.root_reaction`).

    Args:
        system: equations of motion of hub and structure.
        push: see `RootOutput`.
        speed: of the equilibrium, rad/s.
    """

    def __init__(self, system: Any, push: Array, speed: float):
        super().__init__(system.held, push)
        self._system, self._angle = system, HubOutput(system)
        self.given = self._in_balance(self.given, 0.0)

        def forces(speed: float, rate: float) -> Array:
            system.angle.values[:] = 0.0, speed, rate
            system.held.set_time(system.held.time)
            return np.asarray(system.held.clamp_forces())

        # Of the second degree in the speed and linear in its rate: these differences are exact.
        self._by_speed = (forces(speed + 1.0, 0.0) - forces(speed - 1.0, 0.0)) / 2
        self._by_rate = forces(speed, 1.0) - forces(speed, 0.0)

    def __call__(self, x: Array, s: complex) -> Array:
        """Return the amplitudes of a motion x e^{st} of the owned unknowns."""
        (psi,) = self._angle(x, s)
        here = self._part(x, s) + psi * (s * self._by_speed + s**2 * self._by_rate)
        hub = self._system.hub
        about_axis = -(s**2 * hub.inertia + s * hub.damping) * psi
        return self._in_balance(here if self._comm.size == 1 else self._comm.allreduce(here), about_axis)

    def _in_balance(self, values: Array, about_axis: complex) -> Array:
        """Return force and moment with that moment about the axis, of a hub that feels the structure."""
        system = self._system
        if not system.row.coupled:
            return np.asarray(values)
        root = system.held.root
        arms, turn = along_axis(root.names, root.place, system.held.motion.axis)
        return np.asarray(values + (about_axis - arms @ values) * turn)


class StationOutput:
    """Section forces, strains and unknowns at stations along a beam; the equilibrium is written into the system.

    Args:
        system: equations of motion of the beam, the hub held.
        positions: of the stations, m.
        names: of the quantities that are wanted.
    """

    def __init__(self, system: Any, positions: tuple[float, ...], names: tuple[str, ...]):
        self._changes = StationChanges(system, positions)
        self._owned = len(system.root.weights)
        self._columns = [self._changes.names.index(name) for name in names]
        self.names = [f"{name}@{x:g}" for x in positions for name in names]
        self.given: Array = np.zeros(len(self.names))

    def __call__(self, x: Array, s: complex) -> Array:
        """Return the amplitudes of a motion x e^{st} of the owned unknowns."""
        x = x[: self._owned]
        v = s * x
        real, imaginary = self._changes.of(x.real, v.real), self._changes.of(x.imag, v.imag)
        return np.asarray(real + 1j * imaginary)[:, self._columns].ravel()
