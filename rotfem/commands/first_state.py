"""What a history starts from: a shape, an equilibrium, a mode, velocities along a beam."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.equilibrium import limited, static_tip_shape, steady_state
from rotfem.analysis.modal import ModalAnalysis
from rotfem.analysis.stability import Stability, constant_stability, stability_of
from rotfem.equations.compiled import compile_system, with_all_unknowns
from rotfem.equations.system import System
from rotfem.errors import ComputationError, InputError
from rotfem.mechanics.problem import Problem
from rotfem.numerics.eigenproblem import Pencil
from rotfem.numerics.linear import DirectSolver
from rotfem.numerics.newton import Newton
from rotfem.numerics.projection import summed, with_ghosts
from rotfem.scene import Scene
from rotfem.scene.settings import Initial

Array = npt.NDArray[np.float64]

#: What there is to be done where a history has no equilibrium to start from.
WITHOUT = 'initial.state = "undeformed" to start without an equilibrium'


@dataclass
class Start:
    """What a history starts from.

    Attributes:
        q, v: shape in the turning frame and velocities relative to it, local dof arrays; None where it is undeformed,
            or at rest.
        stability: of the equilibrium that it starts from, or that constant conditions hold it in; None without one.
        warnings: what is to be known of it.
    """

    q: Array | None = None
    v: Array | None = None
    stability: Stability | None = None
    warnings: list[str] = field(default_factory=list)


def first_state(scene: Scene, problem: Problem, system: System, judged: bool = True) -> Start:
    """Return what the history of a scene starts from."""
    initial, newton, start = scene.initial, Newton.of(scene.solver), Start()
    if initial.state == "steady":
        start = _equilibrium(scene, problem, system, judged)
    elif judged:
        start.stability = constant_stability(system, newton)
        if start.stability is not None and (said := start.stability.warning()):
            start.warnings.append(f"what constant conditions hold in balance: {said}")
    if initial.tip_displacement is not None:
        start.q = static_tip_shape(problem, initial.tip_displacement, newton, system.comm)
    if initial.velocity is not None:
        start.v = of_velocities(system, initial.velocity)
    if initial.mode is not None:
        analysis = ModalAnalysis(problem, initial.state, comm=system.comm, system=system)
        signal, patterns = of_mode(initial, initial.mode, analysis)
        state = system.zeros() if start.q is None else start.q
        start.q, start.v = state + signal[0], signal[1]
        if not system.linear:
            start.q, start.v = in_mode(system, state, signal, patterns, newton)
    return start


def _equilibrium(scene: Scene, problem: Problem, system: System, judged: bool) -> Start:
    """Return the equilibrium under the speed, loads and pitch of t = 0 (see `first_state`); undeformed without any."""
    solver, start, speed = scene.solver, Start(), problem.motion.speed(0.0)
    if problem.frame == "inertial":
        system = compile_system(problem.turning(), system.comm, moving=False)
    if speed == 0.0:
        system.set_time(0.0, system.motion.at_speed(0.0))
        system.set_state(system.zeros())
        if not system.residual().norm() > 0.0:  # nothing acts on it
            return start

    def found(system: System, notes: list[str]) -> Array:
        return steady_state(system, speed, Newton.of(solver), notes=notes)

    try:
        start.q = found(system, start.warnings)
        if not judged:
            return start
        whole = with_all_unknowns(system)
        start.stability = stability_of(whole, start.q if whole is system else found(whole, []), speed)
    except ComputationError as error:
        raise ComputationError(f"no equilibrium to start from: {error.what}", advice=WITHOUT) from error
    said, growth = start.stability.warning(), start.stability.growth
    end = 0.0 if scene.time is None else scene.time.end
    if said and 0.0 < growth * end < 1.0:
        said = f"{said}; by a factor of {math.exp(growth * end):.4g} in the {end:g} s of the history"
    elif start.stability.stable is False or growth > 0.0:
        raise ComputationError(f"the history would start from an {said}", advice=WITHOUT)
    if said:
        start.warnings.append(f"what the history starts from: {said}")
    return start


# --- initial motions --------------------------------------------------------------------------------------------------


def of_mode(initial: Initial, number: int, analysis: ModalAnalysis) -> tuple[Array, Array]:
    """Return q and its three rates in the mode x, local dof arrays (4, n), and its patterns.

    The tip moves by one in the direction in which it moves most; then the rates are Re(λᵏ a x e^{iφ}), and the
    patterns are M Re x and M Im x, owned unknowns (k, m), if they have 1 % of the kinetic energy.
    """
    system = analysis.system
    analysis.check_count(number, "initial.mode")
    spinning = analysis.at(system.motion.speed(0.0), number)
    if len(spinning.pairs.values) < number:
        raise InputError("initial.mode", number, f"there are {len(spinning.pairs.values)} modes")
    structure, value = system.structure, spinning.pairs.values[number - 1]
    x = spinning.right[:, number - 1]
    whole = with_ghosts(system.V, x.real) + 1j * with_ghosts(system.V, x.imag)
    tip = structure.whole_values(structure.tip_values(whole))[structure.moves]
    largest = tip[np.argmax(np.abs(tip))]
    if abs(largest) <= 1e-6 * system.size(np.abs(whole)) * structure.length:  # it does not take part
        raise InputError("initial.mode", number, "does not move the tip, which initial.amplitude is of")
    factor = (initial.amplitude or 0.0) * np.exp(1j * initial.phase)
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

    try:
        newton.solve(limited(system, q, correction), lambda: float(system.size(q)))
        system.set_state(q, rate, acceleration)
        system.check_inside_out()
    except ComputationError as error:
        raise ComputationError(f"no motion in the mode: {error.what}", advice="a smaller initial.amplitude") from error
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
    rates[structure.clamped_unknowns(ghosts=True)] = 0.0
    return rates
