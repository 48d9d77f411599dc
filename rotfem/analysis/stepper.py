"""Time stepping: generalised-α and Newmark as data, one step as update maps, and step control.

One step from t_n to t_{n+1} = t_n + h satisfies F(q, v, q̈) = 0 at t_{n+1}, with (Arnold & Brüls 2007, eqs. 2–3)

    q_{n+1} = q_n + h v_n + h² (½ − β) a_n + h² β a_{n+1}
    v_{n+1} = v_n + h (1 − γ) a_n + h γ a_{n+1}
    (1 − α_m) a_{n+1} + α_m a_n = (1 − α_f) q̈_{n+1} + α_f q̈_n

where a is an auxiliary acceleration; Newmark is α_m = α_f = 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from rotfem.equations.system import System
from rotfem.errors import ComputationError
from rotfem.numerics.linear import DirectSolver, Increment
from rotfem.numerics.newton import Newton
from rotfem.scene import Scene

Array = npt.NDArray[np.float64]


#: Unknowns from which a factor is kept over steps, by the dimension of the mesh: a plate's matrix is dear to factorise.
KEPT_FROM = {1: 5000, 2: 300}

#: Iterations with an old factor after which the next step gets a new one.
LONG = 5

#: After an old factor has failed k times in a row, none is tried for 2^k steps; k grows to this.
PATIENCE = 5

#: A linear step is refined with an old factor up to this relative error, as long as that shrinks at this rate, or to
#: where it stays at round-off.
REFINED, RATE, ROUND_OFF = 1e-11, 0.3, 1e-8

#: Part of K, relative to M in norm, that makes a singular M regular.
TRACE = 1e-9


@dataclass(frozen=True)
class Scheme:
    """Parameters of one member of the family; second-order accurate when γ = ½ + α_f − α_m."""

    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float

    @classmethod
    def generalised_alpha(cls, rho_inf: float) -> Scheme:
        """Return the scheme of spectral radius rho_inf at infinite frequency (Chung & Hulbert 1993, eqs. 17, 25)."""
        alpha_m = (2 * rho_inf - 1) / (rho_inf + 1)
        alpha_f = rho_inf / (rho_inf + 1)
        return cls(alpha_m, alpha_f, (1 - alpha_m + alpha_f) ** 2 / 4, 0.5 - alpha_m + alpha_f)

    @classmethod
    def newmark(cls, beta: float = 0.25, gamma: float = 0.5) -> Scheme:
        """Return Newmark's scheme; (1/4, 1/2) is the trapezoidal rule."""
        return cls(0.0, 0.0, beta, gamma)

    @classmethod
    def of(cls, scene: Scene) -> Scheme:
        """Return the scheme a scene's [time] table asks for."""
        assert scene.time is not None
        t = scene.time
        if t.spectral_radius is not None:
            return cls.generalised_alpha(t.spectral_radius)
        assert t.beta is not None and t.gamma is not None
        return cls.newmark(t.beta, t.gamma)

    def shifts(self, h: float) -> tuple[float, float, float]:
        """Return (∂q/∂q, ∂v/∂q, ∂q̈/∂q) at t_{n+1}: the factors of K, C, M in the tangent of a step h."""
        c_a = 1 / (self.beta * h * h)
        return 1.0, self.gamma * h * c_a, (1 - self.alpha_m) / (1 - self.alpha_f) * c_a


@dataclass
class State:
    """q, v = q̇, a = q̈ and the auxiliary acceleration, local dof arrays, at time t (s).

    Of a free hub, `hub` holds angle, speed, acceleration, auxiliary acceleration, and the work (J) and angular impulse
    (N·m·s) that torque and brake have given it since t = 0, shape (6,).
    """

    t: float
    q: Array
    v: Array
    a: Array
    auxiliary: Array
    hub: Array | None = None


class Stepper:
    """Advances a system in time.

    Args:
        system: equations of motion; its functions q, v, a are overwritten.
        scheme: parameters.
        newton: iteration control, shared by all steps so that it learns the quadratic constant.
    """

    def __init__(self, system: System, scheme: Scheme, newton: Newton):
        self.system, self.scheme, self.newton = system, scheme, newton
        self._solver: DirectSolver | None = None
        self._dx = Increment(system.V)
        self.seconds = {"assemble": 0.0, "solve": 0.0}
        #: Steps that were halved because Newton failed, and adaptive ones that were taken back.
        self.substeps = self.rejected = 0
        self._hub_increment = 0.0
        self.clamp = system.clamp
        #: Whether a factor is kept for the steps that follow, where factorising is dear.
        self._keeps = system.A.getSize()[0] > KEPT_FROM[system.structure.mesh.topology.dim]
        self._held: tuple[float, float, float] | None = None
        #: How often in a row an old factor has failed, and for how many steps none is tried for that.
        self._failed = self._pause = 0

    @property
    def factorisations(self) -> int:
        """Number of matrix factorisations so far."""
        return self._solver.factorisations if self._solver else 0

    def start(self, t: float, q: Array, v: Array) -> State:
        """Return the state at t with the acceleration that the equations of motion give: M q̈ = −F(q, v, 0).

        Unknowns without inertia (the rotation, where rotary inertia is absent or off) follow the others at once: their
        acceleration keeps their equation in balance, K q̈ = 0 in their rows.
        """
        s = self.system
        s.set_time(t)
        state = State(t, q.copy(), v.copy(), np.zeros_like(q), np.zeros_like(q))
        self._prescribe(state)
        self._write(state)
        solver, massless = self._mass_solver()
        b = s.residual()
        b.array[massless] = 0.0
        state.a += self._dx.solve(solver, b)
        state.auxiliary[:] = state.a
        return state

    def _mass_solver(self) -> tuple[DirectSolver, Array]:
        """Return a solver with M, where it has to be completed with K, and which owned unknowns have no inertia.

        A tip mass beside the axis can leave a rotation without inertia in a direction that is no unknown of its own;
        then so little of K is added to all of M that no motion with inertia feels it.
        """
        s = self.system
        M = s.matrix(0.0, 0.0, 1.0, 1.0)
        without = M.getDiagonal()
        without.array[:] = without.array == 0.0
        massless = np.asarray(without.array > 0.0)
        if without.norm() > 0.0:
            K = s.matrix(1.0, 0.0, 0.0, 1.0)
            K.diagonalScale(without)
            M.axpy(1.0, K, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        solver = DirectSolver(M)
        try:
            self._dx.solve(solver, s.residual())
        except ComputationError:
            K = s.matrix(1.0, 0.0, 0.0, 1.0)
            M.axpy(TRACE * M.norm() / K.norm(), K, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
            solver = DirectSolver(M)
        return solver, massless

    def step(self, state: State, h: float, end: float | None = None) -> State:
        """Return the state at state.t + h.

        Args:
            state: where the step starts.
            h: length of the step, s.
            end: its last instant, where state.t + h must not be off by a rounding (a jump, that is before it).

        Raises:
            ComputationError: Newton failed; the given state is untouched.
        """
        end = state.t + h if end is None else end
        if self._keeps and self._held == self.scheme.shifts(h) and not self._new_factor_pays(end):
            if self._pause == 0:
                try:
                    new = self._step(state, h, end, chord=True)
                except ComputationError:  # the old factor does not serve here; nor will the next ones, perhaps
                    self._held, self._failed = None, min(self._failed + 1, PATIENCE)
                    self._pause = 2**self._failed
                else:
                    self._failed = 0
                    return new
            self._pause = max(self._pause - 1, 0)
        return self._step(state, h, end)

    def _new_factor_pays(self, t: float) -> bool:
        """Whether the matrix stays what it is now, though the factor is that of another: a last one serves for long."""
        s = self.system
        if not s.linear:
            return False
        s.set_time(t)
        return s.settled and not s.current

    def _step(self, state: State, h: float, end: float, chord: bool = False) -> State:
        """One step, by Newton's method, or with the factor of an earlier step throughout."""
        s, p = self.system, self.scheme
        c_q, c_v, c_m = p.shifts(h)
        new = self._predict(state, h, end)
        s.set_time(end)
        self._prescribe(new)

        def increment() -> float:
            self._write(new)
            dq = self._chord(new) if chord else self._correction(new, (c_q, c_v, c_m), h)
            new.q += dq
            new.v += c_v * dq
            new.a += c_m * dq
            new.auxiliary += dq / (p.beta * h * h)
            return max(s.size(dq), self._hub_increment)

        try:
            if s.linear and new.hub is None:
                iterations = self._solve_linear(increment, new, chord)
            else:
                iterations = self.newton.solve(increment, lambda: s.size(new.q), chord)
            self._held = p.shifts(h) if self._keeps and not (chord and iterations > LONG) else None
        except ComputationError as error:
            raise ComputationError(error.what, time=new.t, advice=error.advice) from None
        return new

    def _solve_linear(self, increment: Callable[[], float], new: State, chord: bool) -> int:
        """Solve the linear equations of a step; return the iterations: one, or those that refine with an old factor.

        Raises:
            ComputationError: not finite, or the old factor is too far from the matrix.
        """
        previous = np.inf
        for k in range(1, LONG + 3):
            d = increment()
            self.newton.iterations += 1
            if not np.isfinite(d):
                raise ComputationError("the solution is not finite")
            size = self.system.size(new.q)
            if not chord or self.system.current or d <= REFINED * size:
                return k
            if d > RATE * previous:
                if d <= ROUND_OFF * size:
                    return k
                break
            previous = d
        raise ComputationError("the old factor is too far from the matrix")

    def _chord(self, new: State) -> Array:
        """Return the correction of q at the state written into the system, with the factor at hand."""
        started = perf_counter()
        b = self.system.residual()
        assembled = perf_counter()
        assert self._solver is not None
        dq = self._dx.solve(self._solver, b)
        self.seconds["assemble"] += assembled - started
        self.seconds["solve"] += perf_counter() - assembled
        return dq

    def _correction(self, new: State, shifts: tuple[float, float, float], h: float) -> Array:
        """Return the Newton correction of q at the state written into the system (a local array, reused)."""
        started = perf_counter()
        b = self.system.residual()
        A, changed = self.system.tangent(*shifts)
        assembled = perf_counter()
        self._factor(A, changed)
        assert self._solver is not None
        dq = self._dx.solve(self._solver, b)
        self.seconds["assemble"] += assembled - started
        self.seconds["solve"] += perf_counter() - assembled
        return dq

    def _factor(self, A: Any, changed: bool) -> None:
        if self._solver is None:
            self._solver = DirectSolver(A)
        elif changed:
            self._solver.refresh()

    def advance(self, state: State, h: float, end: float | None = None, halvings: int = 5) -> State:
        """Return the state at state.t + h (see `step`), in halved steps where Newton does not manage the whole one.

        Raises:
            ComputationError: Newton failed at the smallest step too; says how small it was.
        """
        try:
            return self.step(state, h, end)
        except ComputationError as error:
            if self.system.linear:
                raise
            if halvings == 0:
                raise ComputationError(
                    f"{error.what} (the step was cut down to {h:.3g} s)",
                    time=error.time,
                    advice="a smaller time.step, or a look at the load and speed at this time",
                ) from None
            self.substeps += 1
            middle = self.advance(state, h / 2, None, halvings - 1)
            return self.advance(middle, h / 2, state.t + h if end is None else end, halvings - 1)

    def resize(self, state: State, last: State, h: float) -> None:
        """Prepare a state for a step h other than the last one.

        The auxiliary acceleration stands for q̈ at t + h (α_m − α_f), so it moves when h does; without this a change of
        step would cost an order.
        """
        h_last = state.t - last.t
        lag = (self.scheme.alpha_m - self.scheme.alpha_f) * (h - h_last)
        state.auxiliary += lag / h_last * (state.auxiliary - last.auxiliary)

    def local_error(self, state: State, last: State) -> float:
        """Return the scaled local error of the step from last to state: |β − 1/6| h² |a_{n+1} − a_n|.

        Zienkiewicz & Xie 1991, eq. (14): the term of the Taylor series that Newmark's β does not match.
        """
        h = state.t - last.t
        return self.system.size(abs(self.scheme.beta - 1 / 6) * h * h * (state.auxiliary - last.auxiliary))

    def _predict(self, state: State, h: float, end: float) -> State:
        """Return the step that keeps q̈, which is free of residual when the acceleration is constant."""
        p = self.scheme
        auxiliary: Array = np.divide(state.a - p.alpha_m * state.auxiliary, 1 - p.alpha_m, dtype=np.float64)
        q = state.q + h * state.v + h * h * ((0.5 - p.beta) * state.auxiliary + p.beta * auxiliary)
        v = state.v + h * ((1 - p.gamma) * state.auxiliary + p.gamma * auxiliary)
        new = State(end, q, v, state.a.copy(), auxiliary)
        if self.clamp is not None:
            self._shift(new, state, h, self.clamp.turned(state.q, state.v, state.t, new.t))
        return new

    def _shift(self, new: State, state: State, h: float, q: Array) -> None:
        """Move the prediction to another q, keeping the update maps."""
        _, c_v, c_m = self.scheme.shifts(h)
        d = q - new.q
        new.q, new.v, new.a = q, new.v + c_v * d, new.a + c_m * d
        new.auxiliary = new.auxiliary + d / (self.scheme.beta * h * h)

    def _prescribe(self, state: State) -> None:
        """Write the motion of the clamp, exact in q, v and q̈, where the frame does not turn with it."""
        if self.clamp is not None:
            dofs = self.clamp.dofs
            state.q[dofs], state.v[dofs], state.a[dofs] = self.clamp.at(state.t)

    def _write(self, state: State) -> None:
        self.system.set_state(state.q, state.v, state.a)
