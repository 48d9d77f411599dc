"""What a harmonic load makes of a structure that spins steadily: amplitudes of small motions about its equilibrium.

A load Re(f̂ e^{iωt}) on (M, C, K) leaves, once everything else has died out, the motion Re(q̂ e^{iωt}) with

    (K + iω C − ω² M) q̂ = f̂

solved at every frequency. With y = G_K q + G_C q̇ + G_M q̈ + d f the complex amplitude of an output is, s = iω,

    ŷ = (G_K + s G_C + s² G_M) q̂ + d f̂.

Outputs `read` the first part; the second is `given`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rotfem.analysis.modal import ModalAnalysis, Spinning
from rotfem.equations.clamp import along_axis
from rotfem.equations.stations import StationChanges
from rotfem.equations.system import System
from rotfem.numerics.linear import ComplexSolver
from rotfem.numerics.projection import summed

Array = npt.NDArray[Any]

#: Points about a peak, in half its width at 1/√2 of its height.
ABOUT_PEAK = np.array([-4.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 4.0])


class HarmonicOutput(NamedTuple):
    """What is read of a motion x e^{st}.

    Attributes:
        names: of the outputs.
        read: (x of the owned unknowns, s) ↦ amplitudes.
        given: d f̂ (see `rotfem.analysis.frequency_response`).
    """

    names: tuple[str, ...]
    read: Callable[[Array, complex], Array]
    given: Any = 0.0


class FrequencyResponse:
    """Answers to a harmonic load.

    Args:
        analysis: compiled scene; of a free hub the angle is the last unknown.
        spinning: equilibrium, pencil and pairs at one speed.
        force: f̂, complex amplitude of the load's generalised forces on the owned unknowns, shape (n_local,).
        outputs: what is read of motions (see `rotfem.analysis.frequency_response`).

    Attributes:
        names: of the outputs.
        loose: whether a motion has no stiffness: the turn of a free hub, or of a hinge that nothing holds.
    """

    def __init__(self, analysis: ModalAnalysis, spinning: Spinning, force: Array, outputs: Sequence[HarmonicOutput]):
        self.analysis, self.spinning, self._outputs = analysis, spinning, outputs
        self.names = [name for output in outputs for name in output.names]
        self._given = np.concatenate([output.given + np.zeros(len(output.names)) for output in outputs])
        self.force = np.array(force, dtype=np.complex128)
        self.force[analysis.system.clamped] = 0.0
        pencil = spinning.pencil
        self.loose = analysis.free or bool(np.any(spinning.pairs.bounds >= 1.0))
        self._solver = ComplexSolver((pencil.K, pencil.C, pencil.M))

    def direct(self, omega: float) -> Array:
        """Return the complex amplitudes of the outputs at a frequency (rad/s)."""
        self._solver.factor((1.0, 1j * omega, -(omega**2)))
        x = self._solver.solve(self.force)
        read = np.concatenate([output.read(x, 1j * omega) for output in self._outputs])
        return np.asarray(read + self._given)

    def peaks(self, low: float, high: float) -> tuple[Array, list[int]]:
        """Return frequencies (rad/s) by which the peaks between two are seen, and which modes there have no damping."""
        found, undamped = [], []
        for j, lam in enumerate(self.spinning.pairs.values):
            omega, width = abs(lam.imag), abs(lam.real)
            if not low <= omega <= high or omega == 0.0:
                continue
            if width <= 1e-8 * abs(lam):
                undamped.append(j)
                width = 1e-3 * omega
                found.append(omega + width * ABOUT_PEAK[ABOUT_PEAK != 0.0])
            else:
                found.append(omega + width * ABOUT_PEAK)
        points = np.concatenate([*found, np.empty(0)])
        return points[(points >= low) & (points <= high)], undamped


def tip_output(system: System) -> HarmonicOutput:
    """Return the unknowns at the tip."""
    structure = system.structure
    names = tuple(f"tip_{name}" for name in structure.components)
    return HarmonicOutput(names, lambda x, s: structure.whole_values(structure.tip_values(x)))


def root_output(system: System, push: Array) -> HarmonicOutput:
    """Return force and moment of the hub on the structure; what is at the state in the system is the equilibrium."""
    K, C, M = system.clamp_tangents()

    def read(x: Array, s: complex) -> Array:
        x = x[: len(K)]
        return np.asarray(summed(system.comm, x @ K + s * (x @ C) + s**2 * (x @ M)))

    return HarmonicOutput(
        tuple(f"root_{name}" for name in system.root.names), read, np.asarray(summed(system.comm, push))
    )


def hub_output(system: System) -> HarmonicOutput:
    """Return the angle (rad) of a free hub, the last unknown on the last process."""
    last = system.comm.size - 1

    def read(x: Array, s: complex) -> Array:
        psi = x[-1] if system.comm.rank == last else 0.0
        return np.array([psi if last == 0 else system.comm.bcast(psi, last)])

    return HarmonicOutput(("psi",), read)


def root_of_free_hub(system: System, push: Array, speed: float) -> HarmonicOutput:
    """Return the same as `root_output` where the hub is free, in balance with its equation."""
    plain, angle, row = root_output(system, push), hub_output(system), system.row
    assert row is not None

    def forces(speed: float, rate: float) -> Array:
        row.angle.values[:] = 0.0, speed, rate
        system.set_time(system.time)
        return np.asarray(summed(system.comm, system.clamp_forces()))

    # Of the second degree in the speed and linear in its rate: these differences are exact.
    by_speed = (forces(speed + 1.0, 0.0) - forces(speed - 1.0, 0.0)) / 2
    by_rate = forces(speed, 1.0) - forces(speed, 0.0)

    def in_balance(values: Array, about_axis: complex) -> Array:
        """Return force and moment with that moment about the axis, of a hub that feels the structure."""
        if not row.coupled:
            return values
        arms, turn = along_axis(system.root.names, system.root.place, system.motion.axis)
        return np.asarray(values + (about_axis - arms @ values) * turn)

    def read(x: Array, s: complex) -> Array:
        (psi,) = angle.read(x, s)
        about_axis = -(s**2 * row.hub.inertia + s * row.hub.damping) * psi
        return in_balance(plain.read(x, s) + psi * (s * by_speed + s**2 * by_rate), about_axis)

    return HarmonicOutput(plain.names, read, in_balance(plain.given, 0.0))


def station_output(system: System, positions: tuple[float, ...], names: tuple[str, ...]) -> HarmonicOutput:
    """Return section forces, strains and unknowns at stations of a beam; the equilibrium is written into the system."""
    changes, owned = StationChanges(system, positions), len(system.root.weights)
    columns = [changes.names.index(name) for name in names]

    def read(x: Array, s: complex) -> Array:
        x, v = x[:owned], s * x[:owned]
        return np.asarray(changes.of(x.real, v.real) + 1j * changes.of(x.imag, v.imag))[:, columns].ravel()

    return HarmonicOutput(tuple(f"{name}@{x:g}" for x in positions for name in names), read)
