"""Whether an equilibrium in the rotating frame is stable: by its energy, and where that does not decide, by motions.

K = ∂F/∂q at an equilibrium of a conservative structure is the second derivative of the amended potential W + V − T0. If
it is positive, the equilibrium is stable (Lagrange and Dirichlet), with damping or without. If n of its eigenvalues are
negative, then by the theorems of Kelvin, Tait and Chetaev an odd n means instability, any n does with complete damping,
and an even n may be stabilised by gyroscopic forces. That is decided by the eigenvalues λ of λ² M + λ C + K, and
whether all that matter have been found is counted: without damping

    n = k_r + 2 k_c + 2 k_i

with k_r real λ > 0, k_c pairs of complex λ with a positive real part and k_i pairs of imaginary λ of negative energy;
with complete damping n is the number of λ with a positive real part (Merkin 1997, chapter 6; Kapitula & Promislow 2013,
section 7.1). Where follower forces make K unsymmetric, there is no such count, and the first eigenvalues decide.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc
from slepc4py import SLEPc

from rotfem.analysis.equilibrium import balance
from rotfem.analysis.modal import GROWTH
from rotfem.equations.affine import AffineSystem
from rotfem.equations.compiled import with_all_unknowns
from rotfem.equations.system import System
from rotfem.errors import ComputationError
from rotfem.mechanics.problem import Problem
from rotfem.numerics.eigenproblem import EQUAL_EIGENVALUES, Eigenpairs, Pencil
from rotfem.numerics.linear import (
    negative_count,
    righted,
    symmetric,
    unknown_scale,
    use_direct_solver,
)
from rotfem.numerics.newton import Newton
from rotfem.numerics.projection import summed
from rotfem.structures.structure import Structure
from rotfem.units import speed_text

Array = npt.NDArray[np.float64]


#: Part of a motion that cells of one degree less would not have, above which the mesh does not resolve it: half a wave
#: over a cell of degree 2 has 0.19 of it, a quarter of a wave 0.01.
UNRESOLVED = 0.1


@dataclass(frozen=True)
class Stability:
    """What becomes of small disturbances of an equilibrium.

    Attributes:
        negative: number of negative eigenvalues of K; None where K is not symmetric.
        growth: largest growth rate found, 1/s; 0 where nothing grows.
        frequency: of the motion that grows at that rate, rad/s; 0 for a divergence.
        complete: whether no faster growth can have been missed.
        lost: whether a motion's growth is smaller than what round-off does to it.
        coarse: whether the mesh does not resolve the motion that grows at that rate.
    """

    negative: int | None = 0
    growth: float = 0.0
    frequency: float = 0.0
    complete: bool = True
    lost: bool = False
    coarse: bool = False

    @property
    def stable(self) -> bool | None:
        """Whether no small disturbance grows; None where round-off or the mesh hides it."""
        if self.coarse or (self.lost and self.growth == 0.0):
            return None
        return self.growth == 0.0 and (self.complete or not self.negative)

    @property
    def held_by_spin(self) -> bool:
        """Whether the energy has no minimum there, and gyroscopic forces alone hold the equilibrium."""
        return self.stable is True and bool(self.negative)

    def warning(self) -> str:
        """Return a warning; empty for an equilibrium that is plainly stable."""
        if self.held_by_spin:
            return (
                "the equilibrium is no minimum of the energy (negative eigenvalues of the stiffness: "
                f"{self.negative}): gyroscopic forces alone hold it, and damping in the structure makes it unstable"
            )
        if self.stable:
            return ""
        if self.coarse:
            return (
                "unresolved equilibrium: on this mesh a disturbance with waves as short as its cells grows as "
                f"exp({self.growth:.6g} t), which a finer mesh may not have; more mesh.elements, or cells less oblong"
            )
        if self.stable is None:
            return "whether the equilibrium is stable is lost in round-off"
        if self.growth == 0.0:
            return (
                f"unstable equilibrium: the stiffness has {self.negative} negative eigenvalues; the growth rate could "
                "not be computed"
            )
        kind = "static instability" if self.frequency == 0.0 else f"flutter at {speed_text(self.frequency)}"
        count = "" if self.negative is None else f", negative eigenvalues of the stiffness: {self.negative}"
        return f"unstable equilibrium: a small disturbance grows as exp({self.growth:.6g} t) ({kind}{count})"

    def summary(self) -> dict[str, Any]:
        """Return what a summary has of it."""
        out: dict[str, Any] = {"stable": self.stable, "growth_rate": self.growth}
        if self.negative is not None:
            out["negative_eigenvalues"] = self.negative
        if self.growth > 0.0:
            out["frequency"] = self.frequency
        return out | ({"held_by_gyroscopic_forces": True} if self.held_by_spin else {})


def stability_of(system: System, q: Array, speed: float) -> Stability:
    """Return the stability of an equilibrium q (local dof array) at constant speed (rad/s), hub held or free.

    The state and the speed are left in the system's functions.
    """
    system.set_time(0.0, system.motion.at_speed(speed))
    system.set_state(q[: len(system.q.x.array)])
    K = system.matrix(1.0, 0.0, 0.0, 1.0)
    if negative_count(K) == 0:
        return Stability()
    matrices = (system.matrix(0.0, 0.0, 1.0, 0.0), system.matrix(0.0, 1.0, 0.0, 0.0), K)
    clamped = Pencil(*matrices)
    pencil = clamped if system.hub is None else Pencil(*system.with_hub(matrices))
    return stability_of_pencil(system.structure, pencil, clamped)


def stability_of_pencil(structure: Structure, pencil: Pencil, clamped: Pencil) -> Stability:
    """Return the stability of the equilibrium of a structure that M, C and K are about."""
    negative = None if clamped.factor is None else clamped.factor.negative
    negative = negative_count(clamped.K) if negative is None else negative
    if negative == 0:
        return Stability()
    if pencil is clamped:
        return by_motions(structure, pencil, negative)
    # A free hub keeps its momentum, not its speed: K of the structure alone decides nothing.
    return by_motions(structure, pencil, None, clamped.scale())


def by_motions(structure: Structure, pencil: Pencil, negative: int | None, target: float = 0.0) -> Stability:
    """Return the stability that the eigenvalues of M, C and K decide."""
    count = 8 if negative is None else max(8, 2 * negative + 2)
    gyroscopic = negative is not None and not symmetric(pencil.C)  # forces that may stabilise it
    if negative and negative_count(pencil.K, sure=True) == 0:
        return Stability(negative, complete=False, lost=True)
    found = Stability(negative)
    while True:
        try:
            pairs = pencil.solve(count, target)
        except ComputationError:
            return replace(found, complete=False)
        if target > 0.0:
            pairs = pairs.select(np.flatnonzero(pairs.bounds < 1.0))
        values = pairs.values
        # Growth that round-off can have made is none.
        grows = np.flatnonzero(values.real > np.maximum(GROWTH, pairs.bounds) * np.abs(values))
        found = replace(found, lost=len(grows) < int(np.sum(values.real > GROWTH * np.abs(values))))
        if len(grows):
            fastest = grows[np.argmax(values.real[grows])]
            rate, omega = float(values[fastest].real), float(values[fastest].imag)
            omega = omega if omega > EQUAL_EIGENVALUES * abs(values[fastest]) else 0.0
            coarse = structure.unresolved(pairs.right[:, fastest]) > UNRESOLVED
            found = replace(found, growth=rate, frequency=omega, coarse=coarse)
        if negative is None:
            return found
        growing, swinging = _counted(pencil, pairs, gyroscopic)
        if swinging >= negative:  # they leave none to what grows
            return Stability(negative)
        if growing + swinging >= negative:
            return found
        if count >= 64 or count >= pencil.K.getSize()[0]:
            # A negative eigenvalue that makes nothing grow, and that nothing holds, is one of round-off.
            return replace(found, complete=False, lost=found.lost or not gyroscopic)
        count *= 2


def _counted(pencil: Pencil, pairs: Eigenpairs, gyroscopic: bool) -> tuple[int, int]:
    """Return (k_r + 2 k_c, 2 k_i): the negative eigenvalues of K that the eigenpairs found account for."""
    values = pairs.values
    real = values.imag <= EQUAL_EIGENVALUES * np.abs(values)
    grows = values.real > GROWTH * np.abs(values)
    growing = int(np.sum(grows & real)) + 2 * int(np.sum(grows & ~real))
    if not (gyroscopic and pencil.conservative):
        return growing, 0
    swings = ~real & (np.abs(values.real) <= GROWTH * np.abs(values))
    return growing, 2 * int(np.sum(_energies(pencil, pairs)[swings] < 0.0))


def _energies(pencil: Pencil, pairs: Eigenpairs) -> Array:
    """Return x^H (|λ|² M + K) x of every eigenpair, twice the energy of the motion."""
    X = pairs.right
    kinetic, potential = (np.real(X.conj() * pencil.apply(A, X)).sum(axis=0) for A in (pencil.M, pencil.K))
    local = np.abs(pairs.values) ** 2 * kinetic + potential
    return np.asarray(summed(pencil.comm, local))


# --- constant conditions: an equilibrium that a history moves about ---------------------------------------------------


def are_constant(problem: Problem) -> bool:
    """Return whether speed, base acceleration, loads and gravity are constant in a frame that turns with the hub."""
    motion, applied = problem.motion, problem.loads.named.values()
    turning = problem.frame == "rotating" and motion.hub is None
    return turning and motion.constant and all(load.constant for load in applied) and not problem.gravity_turns


def act_at_start(problem: Problem) -> bool:
    """Return whether the hub spins, or is accelerated, or a load acts, at t = 0."""
    motion, applied = problem.motion, [load for load in problem.loads.named.values() if not load.is_zero]
    forces = [np.asarray(problem.loads.gravity), motion.base_acceleration(0.0), *(load.at(0.0) for load in applied)]
    return motion.speed(0.0) != 0.0 or any(force.any() for force in forces)


def constant_stability(system: System, newton: Newton) -> Stability | None:
    """Return the stability of the equilibrium of constant conditions; None where there is none that is found at once.

    A symmetric structure under symmetric loads never leaves an unstable equilibrium by itself: its history looks calm.
    """
    problem = system.model.problem
    if not are_constant(problem):
        return None
    system, speed = with_all_unknowns(system), problem.motion.speed(0.0)
    try:
        q = balance(system, speed, 1.0, system.zeros(), newton, checked=False)
        return stability_of(system, q, speed)
    except ComputationError:
        return None


# --- the speed at which a linear theory loses its stiffness -----------------------------------------------------------


#: Least part of an upper bound of Omega² that is tried, the ratio to which it is enclosed before it is computed,
#: and the one to which it is enclosed where eigenvalues are too close to each other.
LEAST, NEAR, NEAREST = 1e-24, 2.0, 1.0 + 1e-9


def critical_speed(system: System) -> float | None:
    """Return the lowest speed (rad/s) at which the stiffness of a linear theory is singular; None if there is none.

    Of a nonlinear theory there is none: its stiffness is that of each equilibrium.

    K = K_1 + s K_2, s = Omega²: the least positive s of K_1 x = −s K_2 x, at most that of a single unknown. Where spin
    stiffens, most 1/s are negative and far larger. About a lower s' with a definite stiffness, by Cholesky's factor,
    they are 1/(s − s'), above −1/s', so that the largest one stands apart if s' is near it.
    """
    if not system.linear:
        return None
    K_1, K_2 = cast(AffineSystem, system).stiffness_pieces()
    if K_2.norm() == 0.0:
        return None
    d = unknown_scale(K_2, K_1, 1.0)
    K_1.diagonalScale(d, d)
    K_2.diagonalScale(d, d)
    if negative_count(righted(K_1, -1.0)) != 0:  # of a hinge without a spring round-off makes a stiffness, of any sign
        K_1 = righted(K_1)
    single = K_2.getDiagonal()
    single.pointwiseDivide(single, K_1.getDiagonal())
    if (softest := single.min()[1]) >= 0.0:
        return None

    def at(square: float) -> Any:
        K = K_1.copy()
        K.axpy(square, K_2, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        return K

    low, high, ratio = -LEAST / softest, -1.0 / softest, NEAR
    while high > NEAREST * low:
        while high > ratio * low:
            middle = float(np.sqrt(low * high))
            low, high = (middle, high) if negative_count(at(middle)) == 0 else (low, middle)
        if (nu := _largest(K_2, at(low))) is not None:
            return float(np.sqrt(low + 1.0 / nu))
        ratio = max(ratio**0.01, NEAREST)
    return float(np.sqrt(low))


def _largest(A: Any, B: Any) -> float | None:
    """Return the largest eigenvalue of −A x = nu B x; None where others are too near to find it soon."""
    eps, opposite = SLEPc.EPS().create(A.comm), A.copy()
    opposite.scale(-1.0)
    # B is definite, but round-off can have taken that away, so it is no inner product.
    eps.setOperators(opposite, B)
    eps.setProblemType(SLEPc.EPS.ProblemType.GNHEP)
    eps.setWhichEigenpairs(SLEPc.EPS.Which.LARGEST_REAL)
    eps.setDimensions(1, min(A.getSize()[0], 30))
    eps.setTolerances(1e-12, 4)
    B.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    use_direct_solver(eps.getST().getKSP(), A.getSize()[0], symmetric=True)
    eps.solve()
    return float(eps.getEigenvalue(0).real) if eps.getConverged() else None
