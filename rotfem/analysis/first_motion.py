"""Initial motions: a mode, or velocities along a beam."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.equilibrium import limited
from rotfem.analysis.modal import ModalAnalysis
from rotfem.equations.system import System
from rotfem.errors import ComputationError, InputError
from rotfem.numerics.eigenproblem import Pencil
from rotfem.numerics.linear import DirectSolver
from rotfem.numerics.newton import Newton
from rotfem.numerics.projection import summed, with_ghosts

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class FirstMotion:
    """An initial mode or initial velocities; one of them is given.

    Attributes:
        mode: number of the mode about the state the history starts from, from 1; None of velocities.
        amplitude: largest displacement of the tip in it, m.
        phase: of the mode, rad: at 0 the tip is displaced, at π/2 it moves.
        velocity: rows (x, v1, v2, v3) of a beam's axis relative to the turning frame, m and m/s.
    """

    mode: int | None = None
    amplitude: float = 0.0
    phase: float = 0.0
    velocity: Sequence[Sequence[float]] | None = None

    def about(self, q: Array | None, analysis: ModalAnalysis, newton: Newton) -> tuple[Array | None, Array]:
        """Return (q, q̇) at t = 0, local dof arrays, about the state that the history starts from."""
        system = analysis.system
        if self.velocity is not None:
            return q, of_velocities(system, self.velocity)
        signal, patterns = self.of_mode(analysis)
        state = system.zeros() if q is None else q
        if system.linear:
            return state + signal[0], signal[1]
        try:
            return in_mode(system, state, signal, patterns, newton)
        except ComputationError as error:
            what = f"no motion in mode {self.mode} with an amplitude of {self.amplitude:g} m: {error.what}"
            raise ComputationError(what, advice="a smaller initial.amplitude") from error

    def of_mode(self, analysis: ModalAnalysis) -> tuple[Array, Array]:
        """Return q and its three rates in the mode x, local dof arrays (4, n), and its patterns.

        The tip moves by one in the direction in which it moves most; then the rates are Re(λᵏ a x e^{iφ}), and the
        patterns are M Re x and M Im x, owned unknowns (k, m), if they have 1 % of the kinetic energy.
        """
        number, system = self.mode or 1, analysis.system
        analysis.check_count(number, "initial.mode")
        spinning = analysis.at(system.motion.speed(0.0), number)
        if len(spinning.pairs.values) < number:
            raise InputError("initial.mode", number, f"there are {len(spinning.pairs.values)} modes")
        structure, value = system.structure, spinning.pairs.values[number - 1]
        x = spinning.right[:, number - 1]
        whole = with_ghosts(system.V, x.real) + 1j * with_ghosts(system.V, x.imag)
        moves = [i for i, name in enumerate(structure.unknowns) if name.startswith("u")]
        tip = structure.tip_values(whole)[moves]
        largest = tip[np.argmax(np.abs(tip))]
        if abs(largest) <= 1e-6 * system.size(np.abs(whole)) * structure.length:  # it does not take part
            raise InputError("initial.mode", number, "does not move the tip, which initial.amplitude is of")
        factor = self.amplitude * np.exp(1j * self.phase)
        signal = np.array([(value**k * factor * whole / largest).real for k in range(4)])
        shape, mass = (x / largest, spinning.mass_right[:, number - 1] / largest)
        energies = summed(system.comm, np.array([shape.real @ mass.real, shape.imag @ mass.imag]))
        return signal, np.array([mass.real, mass.imag])[energies > 1e-2 * energies.sum()]


def in_mode(system: System, state: Array, signal: Array, patterns: Array, newton: Newton) -> tuple[Array, Array]:
    """Return (q, q̇) of the nonlinear motion that a mode is of, local dof arrays.

    The linear shape q₁ alone lacks the foreshortening by bending; the axial stiffness would give it far more energy
    than the mode has. Its part in the patterns b_i = M x_i is prescribed; the rest is in equilibrium with the inertia
    of the mode (d'Alembert) and the residual at the state q₀,

        F(q, q̇₁, q̈₁) + Σ μ_i b_i = F(q₀, 0, 0),    b_i·(q − q₀ − q₁) = 0.

    q̇ follows by differentiation. To first order q₁ and q̇₁ solve both, with μ = 0.
    """
    shape, rate, acceleration, jerk = signal
    n, motion = patterns.shape[1], system.motion.at_speed(system.motion.speed(0.0))
    system.set_time(0.0, motion)
    system.set_state(state)
    left, q = system.residual().array.copy(), state + shape

    def along(x: Array) -> Array:
        return np.asarray(summed(system.comm, patterns @ x[:n]))

    def constrained(A: Any, right: Array, part: Array) -> Array:
        """Return x with A x + Σ μ b = right and b·x = part."""
        y, *z = DirectSolver(A).solve_all(np.column_stack([right, *patterns])).T
        mu = np.linalg.solve(np.array([along(column) for column in z]).T, along(y) - part)
        return with_ghosts(system.V, y - mu @ np.array(z))

    def correction(before: Array | None) -> Array:
        system.set_state(q, rate, acceleration)
        right = system.residual().array - left
        return constrained(system.tangent(1.0, 0.0, 0.0, before)[0], right, along(state + shape - q))

    newton.solve(limited(system, q, correction), lambda: float(system.size(q)))
    system.set_state(q, rate, acceleration)
    system.check_inside_out()
    pencil = Pencil(*system.mass_damping_stiffness())
    forces = pencil.apply(pencil.C, acceleration[:n, None]) + pencil.apply(pencil.M, jerk[:n, None])
    return q, constrained(pencil.K, -np.real(forces[:, 0]), along(rate))


def of_velocities(system: System, rows: Any) -> Array:
    """Return q̇ (local dof array) of a beam whose axis has the velocities of rows (x, v1, v2, v3), linear between.

    Its sections turn with the slope of the axis. Clamped unknowns rest.
    """
    structure, table = system.structure, np.array(rows, dtype=float)
    x = structure.V.tabulate_dof_coordinates()[:, 0]
    out = np.zeros((len(x), structure.size))
    slopes = np.diff(table[:, 1:], axis=0) / np.diff(table[:, 0])[:, None]
    piece = np.clip(np.searchsorted(table[:, 0], x, side="right") - 1, 0, len(slopes) - 1)
    turns = {"alpha": (1, 1.0), "theta2": (2, -1.0), "theta3": (1, 1.0)}
    for column, name in zip(out.T, structure.unknowns, strict=True):
        if name.startswith("u"):
            column[:] = np.interp(x, table[:, 0], table[:, int(name[1])])
        elif name in turns:
            component, sign = turns[name]
            column[:] = sign * slopes[piece, component]
    rates: Array = out.ravel()
    rates[structure.clamped_unknowns(structure.clamped)] = 0.0
    return rates
