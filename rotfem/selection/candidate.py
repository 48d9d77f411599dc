"""One model that is tried out: the system of its theory with some effects left out, and what it gives."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from rotfem.analysis.equilibrium import steady_state
from rotfem.analysis.first_motion import FirstMotion
from rotfem.analysis.modal import ModalAnalysis
from rotfem.analysis.time_loop import LARGEST_LINEAR_DEFLECTION, March, Steps
from rotfem.equations.affine import PRESTRESS
from rotfem.errors import ComputationError
from rotfem.mechanics.problem import Problem
from rotfem.mechanics.theories import Theory, theories
from rotfem.numerics.eigenproblem import ZERO, Pencil
from rotfem.selection.case import Case
from rotfem.selection.distance import Beyond, Bound, Outputs

Array = npt.NDArray[Any]
T = TypeVar("T")

#: What a history starts from, (q, q̇): local dof arrays.
Start = tuple[Array | None, Array | None]

#: Share of halved steps, and of steps in which Newton strayed, from which on steps are too long to be trusted.
HALVED, STRAYED = 0.01, 0.1


class Halved(ComputationError):
    """So many steps had to be halved that the others are too long to be trusted."""


class Strayed(ComputationError):
    """Newton strayed in so many steps that the others are too long to be trusted, and there may be shorter ones."""


@dataclass(frozen=True)
class Candidate:
    """A model of a case.

    Attributes:
        case: what is computed, on the coarse mesh.
        system: equations of motion that hold its theory.
        without: what is left out of them.
    """

    case: Case
    system: Any
    without: frozenset[str]

    def switched(self) -> Any:
        """Return the system with everything switched as this model has it, and a free hub where it starts."""
        self.system.leave_out(self.without)
        return self.system

    def tip(self, q: Array) -> Array:
        """Return the displacement of the tip (m) of a state."""
        structure = self.system.structure
        moved = [name.startswith("u") for name in structure.components]
        return np.asarray(structure.tip_values(q)[moved])

    # --- outputs ------------------------------------------------------------------------------------------------------

    def equilibrium(self) -> Array:
        """Return the equilibrium at the speed of the case, a local dof array.

        Raises:
            ComputationError: there is none.
        """
        system, speed = self.switched(), self.case.problem.motion.speed(0.0)
        return self.plainly(lambda: steady_state(system, speed, self.case.newton()))

    def in_motion(self, q: Array | None, first: FirstMotion) -> tuple[Array | None, Array]:
        """Return (q, q̇) at t = 0, local dof arrays, of a history that starts with a mode or velocities.

        Args:
            q: equilibrium that it starts from; None where it is undeformed.
            first: mode or velocities.

        Raises:
            ComputationError: no equilibrium, or eigenpairs not to be trusted.
        """
        system, state = self.switched(), "steady" if self.case.from_steady else "undeformed"
        modal = ModalAnalysis(system.model.problem, state, self.case.newton(), system.comm, system)
        return self.plainly(lambda: first.beside(q, modal, self.case.newton()))

    def plainly(self, compute: Callable[[], T]) -> T:
        """Return what is computed with plain tangents, or where that fails with those that take longer to compile."""
        held = self.system.held
        held.plain = True
        try:
            return compute()
        except (Beyond, Strayed):
            raise
        except ComputationError:
            if held.linear:
                raise
            held.plain = False
            return compute()
        finally:
            held.plain = False

    def steady(self, out: Outputs) -> None:
        """Write the equilibrium into the outputs.

        Raises:
            ComputationError: there is none.
        """
        q = self.equilibrium()
        out.tip, out.sizes = self.tip(q)[None, :], self.system.sizes(q)

    def eigenvalues(self, speeds: Collection[float]) -> Array:
        """Return λ of the wanted modes at all speeds (rad/s), without those of a rigid body.

        Raises:
            ComputationError: no equilibrium, or eigenpairs not to be trusted.
        """
        self.switched()
        return np.concatenate([self._eigenvalues(speed) for speed in speeds])

    def _eigenvalues(self, speed: float) -> Array:
        held, count = self.system.held, self.case.mode_count
        if self.case.about == "undeformed" or held.linear:
            held.set_time(0.0, self.case.problem.motion.at_speed(speed))
            held.set_state(held.zeros())
        else:
            self.plainly(lambda: steady_state(held, speed, self.case.newton()))
        matrices = held.mass_damping_stiffness()
        pencil = Pencil(*matrices)
        if self.system.hub is None:
            return pencil.lasting(count)
        whole = Pencil(*self.system.with_hub(matrices))
        values: Array = whole.lasting(count, pencil.scale())
        flexible: Array = np.abs(values) > ZERO * np.median(np.abs(values))
        return values[flexible][: count - int(not flexible.all())]

    def history(self, steps: Steps, start: Start, out: Outputs, watch: Watch) -> None:
        """Write a history into the outputs, as far as it goes.

        Args:
            steps: its steps.
            start: (q, q̇) at t = 0; None where it is undeformed, or at rest.
            out: where its samples go.
            watch: what ends it early.

        Raises:
            Beyond: it is farther from another one than was asked for.
            Halved: more steps were halved than is allowed.
            Strayed: Newton strayed in more than is allowed.
            ComputationError: a step failed, or a linear theory has lost its meaning.
        """
        count = sum(steps.parts or ())

        def compute() -> None:
            few = HALVED * count if self.system.held.plain and count else watch.halved
            here = replace(watch, halved=min(few, watch.halved), shorter=np.isfinite(watch.halved))
            self._history(steps, start, out, here)

        self.plainly(compute)

    def _history(self, steps: Steps, start: Start, out: Outputs, watch: Watch) -> None:
        system, scheme = self.switched(), self.case.scheme
        assert scheme is not None
        newton, strayed = self.case.newton(foreseeing=True), 0
        march = March(system, scheme, steps, newton, *start)
        most = STRAYED * len(steps.parts or ()) if np.isfinite(watch.halved) else np.inf
        tips: list[Array] = []
        out.sizes = np.zeros(len(system.structure.components))
        try:
            for state in march:
                tips.append(self.tip(state.q))
                out.sizes = np.maximum(out.sizes, system.sizes(state.q))
                if watch.bound is not None and watch.bound.passed(len(tips) - 1, tips[-1]):
                    raise Beyond(f"it is beyond the bound from t = {state.t:.4g} s on")
                if system.linear and not out.size <= LARGEST_LINEAR_DEFLECTION:
                    raise ComputationError(f"it diverges at t = {state.t:.4g} s")
                if march.stepper.substeps > watch.halved:
                    raise Halved(f"{march.stepper.substeps} steps were halved by t = {state.t:.4g} s")
                strayed += newton.strayed
                if strayed > most:  # where it ends may be no motion of this model, and no energy may tell
                    why = f"Newton strayed in {strayed} steps by t = {state.t:.4g} s"
                    raise Strayed(why) if watch.shorter else Halved(why)
        finally:
            out.tip = np.array(tips) if tips else out.tip


@dataclass(frozen=True)
class Watch:
    """What ends a history early.

    Attributes:
        bound: what it may not go beyond; None if nothing.
        halved: so many steps may be halved.
        shorter: whether it may be tried again in shorter steps, which take the place of another tangent.
    """

    bound: Bound | None = None
    halved: float = np.inf
    shorter: bool = False


def theories_of(problem: Problem) -> dict[str, Theory]:
    """Return all theories by name that this kind of structure has, its own among them, from the poorest on."""
    kind, own = problem.structure.type, problem.theory
    found = {theory.name: theory for theory in theories() if theory.holds_for(kind)} | {own.name: own}
    return {theory.name: theory for theory in sorted(found.values(), key=lambda theory: theory.rank)}


def stand_in(theory: Theory, others: Mapping[str, Theory], kind: str) -> tuple[Theory, frozenset[str]]:
    """Return the theory whose system a theory is tried out on, and what is to be left out of it.

    A linear theory without prestress is any other one of the same strains without its geometric stiffness, so that one
    system serves both.

    Args:
        theory: to be tried out.
        others: all theories there are.
        kind: type of the structure.
    """
    if theory.linear and not theory.prestress:
        for other in others.values():
            if other.linear and kind in other.prestress and other.measures(kind) is theory.measures(kind):
                return other, frozenset({PRESTRESS})
    return theory, frozenset()
