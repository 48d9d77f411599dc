"""Relative equilibria: the steady state of a constant spin, the static shape of a tip displacement, and their paths.

A path F(q, s) = 0 is followed as speed and loads grow, past limit points where that is wanted. Loads, gravity, base
acceleration and Ω² are linear in s, so F is, too. The unknown is (q, s), and a step of length l along the unit tangent
t is corrected in the plane across it (Riks 1979; Keller's pseudo-arclength),

    [ K   F_s ] [dq]     [ F                          ]
    [ t_q t_s ] [ds] = − [ t·((q, s) − (q_0, s_0)) − l ],

by block elimination with one factor of K. A step is taken back where the tangent turns too far, or where K changes the
number of its negative eigenvalues though s has not turned: Newton was then on its way to another branch. What remains
of that at the shortest steps is a branch point on the path itself.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.analysis.load_steps import (
    SMALLEST_SHARE,
    LoadFactors,
    Raised,
    balance,
    check_inside_out,
    counted,
    less,
    limited,
    on_hinges,
    raised,
    recounted,
    richest_advice,
)
from rotfem.analysis.theory_error import KNOWN, rounded_compliance
from rotfem.equations.compiled import compile_system
from rotfem.equations.system import System
from rotfem.errors import ComputationError, InputError
from rotfem.mechanics.loads import ConstantLoad, Loads
from rotfem.mechanics.motion import Motion
from rotfem.mechanics.problem import Problem
from rotfem.numerics.linear import DirectSolver, negative_count
from rotfem.numerics.newton import Newton

Array = npt.NDArray[np.float64]


def steady_state(
    system: Any,
    omega: float,
    newton: Newton,
    start: Array | None = None,
    past_limits: bool = False,
    notes: list[str] | None = None,
) -> Array:
    """Return q (local dof array) with F(q, 0, 0) = 0 at constant speed: the equilibrium in the rotating frame.

    Speed and loads are raised together (on hinges the loads at the full speed), in one step where Newton allows and in
    smaller ones where not; the state is left in the system's functions. Where that ends at no minimum of the energy, or
    not at all, the path of equilibria is followed (`rotfem.analysis.equilibrium`): Newton may have left it.

    Args:
        system: equations of motion.
        omega: speed, rad/s.
        newton: iteration control.
        start: first guess, the equilibrium at a nearby speed; the whole load is then applied at once.
        past_limits: whether the path is followed past maxima of the load.
        notes: receives remarks on the path.

    Raises:
        ComputationError: no equilibrium was reached; says how far the load got.
    """
    notes = [] if notes is None else notes
    system, growth = system.held, LoadFactors(omega)
    loose = [hinge.name for hinge in system.structure.hinges.values() if hinge.stiffness == 0.0]
    if start is not None:
        try:
            return counted(system, growth, 1.0, balance(system, growth, 1.0, start, newton), newton)
        except ComputationError:
            pass
    if loose and not system.linear:
        growth = on_hinges(system, omega, newton)
    try:
        if system.linear:
            return balance(system, growth, 1.0, system.zeros(), newton)
        return _grown(system, growth, newton, past_limits, notes)
    except ComputationError as error:
        lost = not system.linear and _compliance_lost(system, growth)
        if lost and not loose:
            why = "round-off decides, as axial or shear stiffness outweighs what bends beyond its digits"
            advice = "stiffnesses closer to each other, or fewer elements"
            raise ComputationError(f"{error.what}; {why}", error.time, advice) from error
        if not (loose and (lost or growth.start is None)):
            raise
        raise ComputationError(
            f"nothing holds the root's hinge ({', '.join(loose)}): no steady state at {omega:g} rad/s: "
            "the load turns it, and no equilibrium was found that it turns to",
            advice=f"structure.root.{loose[0]}_stiffness, a speed whose tension holds it, or {less(system)}",
        ) from error


def _compliance_lost(system: Any, growth: LoadFactors) -> bool:
    """Return whether round-off of the stiffness is all of what the load does to the structure before it grows."""
    q = growth.begin(system)
    growth.set(system, 1.0)
    system.set_state(q)
    K, load = system.matrix(1.0, 0.0, 0.0, 1.0), system.residual()
    try:
        return rounded_compliance(system, K, system.local(DirectSolver(K).solve(load))) >= KNOWN
    except ComputationError:
        return False


def _grown(system: Any, growth: LoadFactors, newton: Newton, past_limits: bool, notes: list[str]) -> Array:
    """Return the equilibrium at full load that the growing load leads to, in a nonlinear theory.

    It is the one that is found first unless Newton left the path, or past maxima of the load its end.

    Raises:
        ComputationError: none was found, or the path ends at a limit point or elsewhere before the full load.
    """
    found: Raised | None = None
    failure: ComputationError | None = None
    total: Array = np.empty(0)
    if not past_limits:
        try:
            found = raised(system, growth, newton)
        except ComputationError as error:
            failure = error
        else:
            # the tangent of Newton's last iteration is at hand, and as good as that of the equilibrium
            if found.sure and not negative_count(system.A, sure=True):
                return found.q
            system.count_rotations_from(found.reference)
            total = system.structure.total(found.q)
            if found.sure and system.size(total) <= newton.tolerance:
                return found.q  # nothing bends it, as a shaft that spins about its axis: one state at all speeds
    path = _path(system, growth, newton, past_limits, notes)
    if path.share == 1.0:
        if found is not None and system.size(system.structure.total(path.q) - total) > 1e-6:
            notes.append("Newton met another equilibrium first; this is the one that the growing load leads to")
        return counted(system, growth, 1.0, path.q, newton)
    if past_limits:
        limits = f", past limit points at {_shares(path.limits)} of it" if path.limits else ""
        raise ComputationError(
            f"no steady state at {growth.omega:g} rad/s: the path of equilibria ends at {path.share:.6g} of the load"
            f"{limits}: {path.why}",
            advice=less(system),
        )
    if path.limits:
        raise ComputationError(
            f"no steady state at {growth.omega:g} rad/s to which a growing load leads: it has a maximum, a limit "
            f"point, at {growth.where(path.limits[0])}, where the structure snaps",
            advice=f'solver.continuation = "arc_length" to follow the path past it, or {less(system)}',
        ) from None
    if found is None:
        raise failure or ComputationError(path.why)
    if not found.sure:
        notes.append("whether this is the equilibrium that the growing load leads to, or another one, is not known")
    system.count_rotations_from(found.reference)
    return balance(system, growth, 1.0, found.q, newton)


def _path(system: Any, growth: LoadFactors, newton: Newton, past_limits: bool, notes: list[str]) -> LoadPath:
    """Return the path and note what there is on it."""
    try:
        path = Tracer(system, growth, newton).follow(past_limits)
    except ComputationError:
        return LoadPath(system.zeros(), why="its first step failed")
    if path.branches:
        notes.append(f"another path of equilibria crosses at {_shares(path.branches)} of the load: a bifurcation")
    if path.limits and path.share == 1.0:
        shares = _shares(path.limits)
        notes.append(f"limit points at {shares} of the load were passed: a growing load makes the structure snap there")
    return path


def _shares(shares: list[float]) -> str:
    return ", ".join(f"{share:.6g}" for share in shares)


def check_steady(problem: Problem) -> None:
    """Refuse what has no steady state in the rotating frame: gravity that turns with it.

    Raises:
        InputError: gravity has a component across the spin axis while the frame spins.
    """
    if problem.gravity_turns:
        raise InputError(
            "loads.gravity",
            list(problem.loads.gravity),
            "gravity across the spin axis turns in the rotating frame, so there is no steady state; give [time], or "
            "gravity along motion.axis, or leave gravity out of model.effects",
        )


def static_tip_shape(problem: Problem, displacement: float, newton: Newton, comm: MPI.Comm = MPI.COMM_WORLD) -> Array:
    """Return q (local dof array) of the beam at rest under the tip force F_2 that gives u_2(L) = displacement (m).

    The tip is led there in one step where Newton allows, and in smaller ones where not.

    Raises:
        ComputationError: no equilibrium with this displacement was found; says how far the tip was led.
    """
    still, force = Motion.constant_speed(0.0), Loads(tip_force=ConstantLoad((0.0, 1.0, 0.0)))
    resting = problem.replace(frame="rotating", effects=(), motion=still, loads=force, terms={}, outputs={})
    system = compile_system(resting, comm, moving=False)
    q: Array = system.zeros()
    F, done, share = 0.0, 0.0, 1.0
    while done < 1.0:
        target = min(1.0, done + share)
        try:
            q, F = _led(system, target * displacement, q, F, newton)
        except ComputationError as error:
            share /= 2
            if share < SMALLEST_SHARE:
                raise ComputationError(
                    f"no static shape with a tip displacement of {displacement:g} m: the tip was led to "
                    f"{done * displacement:.4g} m; {error.what}",
                    advice="a smaller initial.tip_displacement"
                    + ("" if problem.theory.exact else f", or {richest_advice()}"),
                ) from None
            continue
        done = target
        share *= 1.5
    return q


def _led(system: System, displacement: float, q: Array, F: float, newton: Newton) -> tuple[Array, float]:
    """Return (q, F) of the equilibrium with u_2(L) = displacement (m), from that of another displacement."""
    tip, x = system.structure.tip_values, np.append(q, F)

    def correction(before: Array | None) -> Array:
        q, F = x[:-1], float(x[-1])
        system.set_time(0.0, load_factor=F + 1.0)
        loaded = system.residual().copy()
        system.set_time(0.0, load_factor=F)
        residual = system.residual()
        loaded.axpy(-1.0, residual)
        solver = DirectSolver(system.tangent(1.0, 0.0, 0.0, before)[0])
        dq, per_force = system.local(solver.solve(residual)), system.local(solver.solve(loaded))
        if tip(per_force)[1] == 0.0:
            raise ComputationError("a force at the tip does not move it by anything above round-off")
        dF = (displacement - tip(q)[1] - tip(dq)[1]) / tip(per_force)[1]
        return np.append(dq + dF * per_force, dF)

    newton.solve(limited(system, x, correction, soon=0), lambda: float(system.size(x[:-1])))
    check_inside_out(system)
    return x[:-1], float(x[-1])


# --- the path of equilibria -------------------------------------------------------------------------------------------

#: Shortest step, in units of s and of the root mean square of q in its scales.
SHORTEST = 1e-6

#: Steps before the path is given up, and iterations of a step.
MOST_STEPS, ITERATIONS = 500, 8


@dataclass
class Point:
    """One equilibrium of the path.

    Attributes:
        q: local dof array.
        s: share of speed squared and loads.
        t_q, t_s: unit tangent.
        negative: number of eigenvalues of K that are negative beyond round-off; None where they are not counted.
    """

    q: Array
    s: float
    t_q: Array
    t_s: float
    negative: int | None


@dataclass
class LoadPath:
    """Where the path of equilibria led.

    Attributes:
        q: the equilibrium at the full load; the last one where that was not reached.
        share: of the load there.
        limits: shares at which the load has a maximum or minimum on the path, in their order.
        branches: shares at which another path crosses.
        why: why the full load was not reached; empty if it was.
    """

    q: Array
    share: float = 0.0
    limits: list[float] = field(default_factory=list)
    branches: list[float] = field(default_factory=list)
    why: str = ""


class Tracer:
    """Follows the path of a system at a speed.

    Args:
        system: equations of motion, the hub held.
        growth: what grows with s.
        newton: tolerance of the corrections; their count is added to.
    """

    def __init__(self, system: Any, growth: LoadFactors, newton: Newton):
        self.system, self.growth, self.newton = system, growth, newton
        self._count = system.V.dofmap.index_map.size_global * system.V.dofmap.index_map_bs

    def follow(self, past_limits: bool) -> LoadPath:
        """Return where the path leads from its start.

        Args:
            past_limits: whether to go on where the load has a maximum.
        """
        q = self.growth.begin(self.system)
        path, point, length = LoadPath(q), self._point(q, 0.0, None), 0.05
        for _ in range(MOST_STEPS):
            try:
                new, used = self._step(point, length)
            except ComputationError as error:
                if length <= SHORTEST:
                    path.why = error.what
                    break
                length = max(length / 4, SHORTEST)
                continue
            turned = new.t_s * point.t_s < 0.0
            crossed = new.negative != point.negative and not turned
            cosine = self._product(new.t_q, point.t_q) + new.t_s * point.t_s
            if length > SHORTEST and (crossed or cosine < 0.9):
                length = max(length / 4, SHORTEST)
                continue
            if turned:
                path.limits.append(self._limit(point, length))
                if not past_limits:
                    path.why = "limit point"
                    break
            elif crossed:
                path.branches.append((point.s + new.s) / 2)
            if new.s >= 1.0:
                path.q, path.share = self._end(point, new), 1.0
                return path
            if new.s < 0.0:
                path.why = "the load would have to be reversed"
                break
            point, length = self._counted(new), min(length * min(2.0, 4.0 / used), 0.25)
            path.q, path.share = point.q, point.s
        else:
            path.why = f"{MOST_STEPS} steps were not enough"
        path.q, path.share = point.q, point.s
        return path

    # --- one step ----------------------------------------------------------------------------------------------------

    def _step(self, point: Point, length: float) -> tuple[Point, int]:
        """Return the point at a distance along the path, and the iterations that it took."""
        q, s = point.q + length * point.t_q, point.s + length * point.t_s
        for iteration in range(1, ITERATIONS + 1):
            y, z = self._solutions(q, s)
            ahead = self._product(point.t_q, q - point.q) + point.t_s * (s - point.s) - length
            ds = -(ahead + self._product(point.t_q, y)) / (point.t_s + self._product(point.t_q, z))
            dq = y + ds * z
            q, s = q + dq, s + ds
            self.newton.iterations += 1
            size = max(self.system.size(dq), abs(ds))
            if not np.isfinite(size) or size > 10.0:
                raise ComputationError("the corrections of a step along the path diverged")
            if size <= self.newton.tolerance:
                self._set(q, s)
                check_inside_out(self.system)
                self.system.structure.check_range(q)
                self.system.check_reach(q)
                return self._point(q, s, point), iteration
        raise ComputationError(f"a step along the path did not converge in {ITERATIONS} iterations")

    def _counted(self, point: Point) -> Point:
        """Return a point with rotations that are counted from its own shape, where they are large."""
        turns = self.system.structure.turns
        if turns is None or not turns.is_due(point.q):
            return point
        q, t_q = recounted(self.system, point.q, point.t_q)
        size = np.sqrt(self._product(t_q, t_q) + point.t_s**2)
        return Point(q, point.s, t_q / size, point.t_s / size, point.negative)

    def _set(self, q: Array, s: float) -> None:
        self.growth.set(self.system, s)
        self.system.set_state(q)

    def _solutions(self, q: Array, s: float) -> tuple[Array, Array]:
        """Return −K⁻¹ F and −K⁻¹ F_s; F is linear in s, so a difference over any distance is exact."""
        self._set(q, s + 1.0)
        slope = self.system.residual().copy()
        self._set(q, s)
        residual = self.system.residual()
        slope.axpy(-1.0, residual)
        solver = DirectSolver(self.system.tangent(1.0, 0.0, 0.0)[0])
        return self.system.local(solver.solve(residual)), self.system.local(solver.solve(slope))

    def _point(self, q: Array, s: float, before: Point | None) -> Point:
        """Return an equilibrium with the tangent of the path there, in the direction from the one before."""
        z = self._solutions(q, s)[1]
        with np.errstate(all="ignore"):
            size = np.sqrt(self._product(z, z) + 1.0)
        if not np.isfinite(size):
            raise ComputationError("the slope of the path is beyond all numbers")
        t_q, t_s = z / size, 1.0 / size
        if before is not None and self._product(t_q, before.t_q) + t_s * before.t_s < 0.0:
            t_q, t_s = -t_q, -t_s
        K = self.system.matrix(1.0, 0.0, 0.0, 1.0)
        return Point(q, s, t_q, t_s, negative_count(K, sure=True))

    def _product(self, a: Array, b: Array) -> float:
        """Return the mean of the products of two arrays in the scales of the unknowns, over all ranks."""
        return float(self.system.product(a, b) / self._count)

    # --- special points ----------------------------------------------------------------------------------------------

    def _limit(self, point: Point, length: float) -> float:
        """Return the load where the tangent of the path has none in s, between a point and one at a distance.

        ds/dl = t_s has a simple zero there, so that the load itself is accurate to the square.
        """
        from scipy.optimize import brentq  # slow to load, and only paths beyond a limit point need it

        slopes = {0.0: point.t_s}

        def slope(distance: float) -> float:
            return slopes[distance] if distance in slopes else self._step(point, distance)[0].t_s

        return self._step(point, float(brentq(slope, 0.0, length, xtol=1e-5 * length)))[0].s

    def _end(self, before: Point, after: Point) -> Array:
        """Return q at the full load, between two points of the path."""
        part = (1.0 - before.s) / (after.s - before.s)
        q = before.q + part * (after.q - before.q)
        return balance(self.system, self.growth, 1.0, q, self.newton, checked=False)
