"""What a harmonic load makes of a structure that spins steadily: amplitudes of small motions about its equilibrium.

A load Re(f̂ e^{iωt}) on (M, C, K) leaves, once everything else has died out, the motion Re(q̂ e^{iωt}) with

    (K + iω C − ω² M) q̂ = f̂

solved at every frequency (the direct response), or from the pairs of the pencil with their left vectors,

    q̂ = Σ_j x_j y_j^H f̂ / (n_j (iω − λ_j)),   n_j = y_j^H (2 λ_j M + C) x_j,

over some λ_j and their conjugates, with the static response of all others added (the modal response).

With y = G_K q + G_C q̇ + G_M q̈ + d f of small motions x e^{st}, the complex amplitude of an output is

    ŷ = (G_K + s G_C + s² G_M) x + d f̂.

Outputs are called for the first part, of a forced motion with s = iω, of a mode with s = λ; the second is `given`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.analysis.modal import ModalAnalysis, Spinning
from rotfem.equations.stations import StationChanges
from rotfem.errors import ComputationError
from rotfem.numerics.linear import ComplexSolver
from rotfem.numerics.projection import summed
from rotfem.structures.root_reaction import along_axis

Complex = npt.NDArray[np.complex128]

#: Correction, relative to the solution, that ends the rounds; one that is good enough where they end; most rounds.
DONE, GOOD, ROUNDS = 1e-13, 1e-8, 60


def solve_by_nearby(
    times: Callable[[Complex], Complex], nearby: Callable[[Complex], Complex], b: Complex, comm: MPI.Comm
) -> Complex:
    """Return x of A x = b, owned rows.

    Args:
        times: x ↦ A x.
        nearby: b ↦ N⁻¹ b of an N that is nearly A.
        b: right-hand side.
        comm: communicator that the rows are distributed over.

    Raises:
        ComputationError: A is singular to working precision.
    """

    def dot(x: Complex, y: Complex) -> Any:
        return summed(comm, complex(np.vdot(x, y)))

    def size(x: Complex) -> float:
        return float(np.sqrt(abs(dot(x, x))))

    x: Complex = np.zeros_like(b)
    left = nearby(b)
    directions: list[tuple[Complex, Complex]] = []
    for _ in range(ROUNDS):
        z, w = left, nearby(times(left))
        for old, image in directions:
            share = dot(image, w)
            z, w = z - share * old, w - share * image
        length = size(w)
        if length == 0.0:
            break
        z, w = z / length, w / length
        directions.append((z, w))
        step = dot(w, left)
        x, left = x + step * z, left - step * w
        if size(left) <= DONE * size(x):
            break
    if not size(left) <= GOOD * size(x):
        raise ComputationError("the matrix is singular: its solution was not found")
    return x


Array = npt.NDArray[Any]

#: Points about a peak, in half its width at 1/√2 of its height.
ABOUT_PEAK = np.array([-4.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 4.0])

#: Damping ratio below which a mode has none, and the distance from its frequency at which its peak is then sampled.
UNDAMPED = 1e-8
BESIDE = 1e-3

#: Part of the inertia that brakes the motion in a matrix near by, where the damping of low rank is none of what is
#: factorised: that of the structure alone would be singular at its resonances.
BRAKED = 0.05

#: Frequencies, as parts of the lowest one of a free hub's vibrating modes, at which its rigid turn is reported.
BELOW = np.array([0.2, 0.4, 0.6])


class FrequencyResponse:
    """Answers to a harmonic load.

    Args:
        analysis: compiled scene; of a free hub the angle is the last unknown.
        spinning: equilibrium, pencil and pairs at one speed.
        force: f̂, complex amplitude of the load's generalised forces on the owned unknowns, shape (n_local,).
        outputs: what is read of motions (see `rotfem.analysis.frequency_response`).

    Attributes:
        names: of the outputs.
    """

    def __init__(self, analysis: ModalAnalysis, spinning: Spinning, force: Array, outputs: Sequence[Any]):
        self.analysis, self.spinning, self._outputs = analysis, spinning, outputs
        self.names = [name for output in outputs for name in output.names]
        self._given = np.concatenate([output.given for output in outputs])
        self.force = np.array(force, dtype=np.complex128)
        self.force[analysis.system.held.clamped] = 0.0
        pencil = spinning.pencil
        self._solver = ComplexSolver((pencil.K, pencil.C, pencil.M))

    def direct(self, omega: float) -> Array:
        """Return the complex amplitudes of the outputs at a frequency (rad/s), from one solution.

        Raises:
            ComputationError: there is no answer, at the frequency of a mode that has no damping.
        """
        return np.asarray(self._read(self._solved(omega), 1j * omega) + self._given)

    def _read(self, x: Array, s: complex) -> Array:
        return np.concatenate([output(x, s) for output in self._outputs])

    def _solved(self, omega: float) -> Array:
        """Return q̂ of the owned unknowns."""
        if not self._solver.updates:
            self._solver.factor((1.0, 1j * omega, -(omega**2)))
            return np.asarray(self._solver.solve(self.force))
        self._solver.factor((1.0, 1j * omega, -(1 - 1j * BRAKED) * omega**2))
        return np.asarray(
            solve_by_nearby(lambda x: self._times(omega, x), self._solver.solve, self.force, self.analysis.comm)
        )

    def _times(self, omega: float, x: Array) -> Array:
        """Return (K + iω C − ω² M) x."""
        pencil = self.spinning.pencil
        K, C, M = (pencil.apply(A, x[:, None])[:, 0] for A in (pencil.K, pencil.C, pencil.M))
        return np.asarray(K + 1j * omega * C - omega**2 * M)

    def modal(self, frequencies: Array, count: int) -> Array:
        """Return the amplitudes of the outputs at frequencies (n,), rad/s, by modes; shape (n, outputs).

        Args:
            frequencies: rad/s.
            count: modes taken; what all others answer statically is added.
        """
        pairs = self.spinning.pairs.select(np.arange(min(count, len(self.spinning.pairs.values))))
        n = np.diag(self.spinning.pencil.gram(pairs.left, pairs.values, pairs.right, pairs.values))
        seen = np.array([self._read(x, s) for x, s in zip(pairs.right.T, pairs.values, strict=True)]).T
        gains = self._summed(pairs.left.conj().T @ self.force) / n
        others = self._summed(pairs.left.T @ self.force) / n.conj()  # of the conjugate pairs
        twice = pairs.values.imag > 0.0

        def at(omega: float) -> Array:
            plain = seen @ (gains / (1j * omega - pairs.values))
            mirrored = seen.conj() @ np.where(twice, others / (1j * omega - pairs.values.conj()), 0.0)
            return np.asarray(plain + mirrored)

        left_out = self._left_out(at)
        return np.array([at(omega) + left_out(omega) for omega in frequencies])

    def _left_out(self, at: Callable[[float], Array]) -> Callable[[float], Array]:
        """Return what all other modes answer, as a function of the frequency: what is static, and a free hub's turn.

        Args:
            at: response of the modes that are taken, of the frequency.
        """
        if not self.analysis.free:
            static = self.direct(0.0) - at(0.0)
            return lambda omega: static
        values = self.spinning.pairs.values
        vibrating = values[values.imag > 0.0]
        known = BELOW * float(np.min(np.abs(vibrating if len(vibrating) else values)))
        powers = np.array([[1.0, 1 / (1j * w), 1 / (1j * w) ** 2] for w in known])
        parts = np.linalg.solve(powers, np.array([self.direct(w) - at(w) for w in known]))
        return lambda omega: np.asarray(np.array([1.0, 1 / (1j * omega), 1 / (1j * omega) ** 2]) @ parts)

    def peaks(self, low: float, high: float) -> tuple[Array, list[int]]:
        """Return frequencies (rad/s) by which the peaks between two are seen, and which modes there have no damping."""
        found, undamped = [], []
        for j, lam in enumerate(self.spinning.pairs.values):
            omega, width = abs(lam.imag), abs(lam.real)
            if not low <= omega <= high or omega == 0.0:
                continue
            if width <= UNDAMPED * abs(lam):
                undamped.append(j)
                width = BESIDE * omega
                found.append(omega + width * ABOUT_PEAK[ABOUT_PEAK != 0.0])
            else:
                found.append(omega + width * ABOUT_PEAK)
        points = np.concatenate([*found, np.empty(0)])
        return points[(points >= low) & (points <= high)], undamped

    def _summed(self, local: Array) -> Array:
        comm = self.analysis.comm
        return np.asarray(comm.allreduce(local) if comm.size > 1 else local)


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
