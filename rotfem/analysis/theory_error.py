"""The error that a theory makes: the difference to the answer of a richer theory, and what that one lacks.

A linear theory without stress stiffness lacks a term of first order, a nonlinear one of moderate rotations terms whose
effect grows with the time: what either does to an answer is its difference to that of the theory which has them
(`rotfem.mechanics.theories.compared`), over a history by a companion (see `rotfem.refinement.companion`).

What a linear theory with stress stiffness lacks is of second order, and estimated at a state. Its strains Γ and those
Γ_e of the exact theory differ by ΔΓ. In the exact equations

    ∫ C Γ_e(q + Δq)·DΓ_e(q + Δq)[δq] = (forces)[δq],    Γ_e = Γ + ΔΓ,

what is of first order in Δq and ΔΓ is a linear equation for the error Δq of the theory,

    K Δq = −r,    r[δq] = ∫ C ΔΓ·DΓ[δq] + C Γ·DΔΓ[δq] − G q·δq,

with K the tangent at q, and G = ∫ N D²Γ_1 the stress stiffness, which the theory has in its own forces. It is Newton's
first correction but for the forces C ΔΓ·DΔΓ, which the correction itself relaxes (of a bent line that is not
foreshortened, the membrane force). Forces on the masses are kept. What these terms do to a frequency is not in it.

A history that starts in balance has the error Δq₀ of that equilibrium at first, and masses keep it from growing: a
constant force f moves a mass m that nothing holds by f t²/2m in the time t. So

    (K + 2M/t²) Δq = −r + 2M/t² Δq₀,

which bounds what a hinge does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from ufl.algorithms import expand_derivatives

from rotfem.equations.nonlinear import assembled
from rotfem.equations.pieces import geometric_stiffness
from rotfem.errors import ComputationError
from rotfem.mechanics.motion import Motion
from rotfem.mechanics.theories import Theory, compared, richest, stiffened
from rotfem.numerics import compat, forms
from rotfem.numerics.eigenproblem import Pencil, RoundOff
from rotfem.numerics.forms import added
from rotfem.numerics.linear import DirectSolver
from rotfem.numerics.projection import times

Array = npt.NDArray[np.float64]

T = TypeVar("T")

#: Relative error of a theory from which it is warned of.
NOTICED = 0.05

#: Relative error of a component of the tip from which it is reported, and above which it is computed.
REPORTED = 0.01

#: Part of the largest component below which one is round-off: Newton's method accepts such increments.
RESOLVED = 1e-9

#: Bound of the relative error by round-off from which it is warned of, and the largest that is given as a number.
DIGITS, KNOWN = 1e-2, 1.0


@dataclass(frozen=True)
class TheoryError:
    """What a theory leaves out, relative to the size of displacements or to frequencies.

    Attributes:
        estimate: relative error.
        basis: what it was estimated from, in a few words.
        theory: name of the theory.
        components: components of the tip ↦ error relative to their own size, of those in error by more than REPORTED.
    """

    estimate: float
    basis: str
    theory: str
    components: dict[str, float] = field(default_factory=dict)

    def summary(self) -> dict[str, Any]:
        """Return what a summary has of it."""
        out: dict[str, Any] = {"estimate": self.estimate, "basis": self.basis}
        return out | ({"components": self.components} if self.components else {})

    def warning(self) -> str:
        """Return the warning of an error that is to be noticed, or of components in error; empty of others."""
        if self.estimate > NOTICED:
            how = "out of its range" if self.estimate >= 1.0 else f"in error by about {100 * self.estimate:.2g} %"
            return f'model.theory = "{self.theory}" is {how} here ({self.basis}); "{richest().name}" is exact'
        wrong = {name: error for name, error in self.components.items() if error > NOTICED}
        if not wrong:
            return ""
        sizes = {name: f"by {100 * error:.2g} % of it" if error < 1.0 else "unknown" for name, error in wrong.items()}
        listed = ", ".join(f"{name} ({size})" for name, size in sizes.items())
        how = f'in error by what the theory "{self.theory}" leaves out: {listed}'
        return f'small components of the tip are {how}; "{richest().name}" is exact'

    def of_poorer(self, theory: Theory, apart: float, components: dict[str, float]) -> TheoryError:
        """Return the error of a poorer theory, whose answer differs from the one that this is the error of.

        Args:
            theory: the poorer one.
            apart: distance of both answers, relative.
            components: of the tip ↦ the same, relative to their own size.
        """
        names = components.keys() | self.components.keys()
        sums = {name: components.get(name, 0.0) + self.components.get(name, 0.0) for name in sorted(names)}
        listed = {name: x for name, x in sums.items() if x > REPORTED}
        return TheoryError(self.estimate + apart, f'its answer against that of "{self.theory}"', theory.name, listed)


def is_estimated(system: Any) -> bool:
    """Return whether the error of a system's theory is estimated at states, and there are strains to do it by."""
    theory, kind = system.model.theory, system.structure.type
    if theory.exact or compared(theory, kind) is not None:
        return False
    return richest().holds_for(kind) and kind in stiffened().prestress


def error_of_state(
    system: Any, q: Array, tips: Array | None = None, time: float = np.inf, first: Array | None = None
) -> TheoryError:
    """Return the error of the displacements of a state, whose time is set, by a linear theory with stress stiffness.

    Args:
        system: equations of motion, the hub held.
        q: the state, a local dof array.
        tips: sizes that the components of the tip have (m, rad), (components,); those of the state if None.
        time: since a state of balance (s); of an equilibrium the error is all there.
        first: that state, a local dof array; undeformed if None.
    """
    name = system.model.theory.name
    if not is_estimated(system):
        exact = system.model.theory.exact
        return TheoryError(0.0, "its strains are exact" if exact else "there is none to compare it with", name)
    displacement, rotation = _sizes(system, q)
    tips = np.abs(_tip(system, q)) if tips is None else tips
    moves, neglected = system.structure.moves, max(displacement, rotation) / 2
    largest = np.where(moves, np.max(tips[moves]), np.max(tips[~moves], initial=0.0))
    resolved = tips > RESOLVED * largest  # more than round-off of displacements or of rotations
    small = neglected * np.max(tips[resolved], initial=0.0) <= REPORTED * np.min(tips[resolved], initial=np.inf)
    if small:
        return TheoryError(neglected, f"the largest rotation is {rotation:.2g}", name)
    change = _correction(system, q, time, None if first is None or not first.any() else first)
    smaller = min(displacement, _sizes(system, q + change)[0])  # of the states before and after
    estimate = _sizes(system, change)[0] / max(smaller, 1e-300)
    if rotation > 1.0:  # expansions in it converge too slowly for an estimate
        estimate = max(estimate, rotation)
    if system.model.problem.inactive:  # among them are the displacements that bending makes along the structure
        estimate = max(estimate, rotation / 2)
    errors = np.abs(_tip(system, change))[resolved] / tips[resolved]
    names = [f"tip_{component}" for component in np.array(system.structure.components)[resolved]]
    wrong = {component: float(x) for component, x in zip(names, errors, strict=True) if x > REPORTED}
    return TheoryError(float(estimate), "its strains against the exact ones at the farthest state", name, wrong)


def error_under_load(system: Any, motion: Motion, factor: DirectSolver | None = None) -> TheoryError:
    """Return the error of the displacements under what is constant, which modes of a linear theory are not about.

    Args:
        system: equations of motion, the hub held.
        motion: of the frame, at the speed of the modes.
        factor: solver with the stiffness there, if there is one.
    """
    system.set_time(0.0, motion)
    system.set_state(system.zeros())
    return error_of_state(system, _static(system, factor) if is_estimated(system) else system.zeros())


def _static(system: Any, factor: DirectSolver | None = None) -> Array:
    """Return what the forces at the undeformed state and time set displace the structure by, a local dof array."""
    solver = factor or DirectSolver(system.matrix(1.0, 0.0, 0.0, 1.0))
    return np.asarray(system.local(solver.solve(system.residual())))


def _tip(system: Any, x: Array) -> Array:
    """Return all components of a displacement at the tip, relative to the turning frame."""
    structure = system.structure
    whole = structure.whole_values(structure.tip_values(x))
    return np.asarray(system.seen_from_hub(whole[None, :], structure.length, system.time)[0])


def _sizes(system: Any, q: Array) -> tuple[float, float]:
    """Return the size of displacements of sections' points over L, and the largest rotation component (rad)."""
    rotations = system.sizes(q)[~system.structure.moves]
    return float(np.linalg.norm(system.displaced(q))) / system.structure.length, float(np.max(rotations, initial=0.0))


def _correction(system: Any, q: Array, time: float = np.inf, first: Array | None = None) -> Array:
    """Return Δq of a state a time after another one (see `error_of_state`), a local dof array."""
    r = _residual(system, q)
    if first is not None:
        now = system.time
        system.set_time(0.0)
        before = _correction(system, first)
        system.set_time(now)
        r.array[:] -= times(system.matrix(0.0, 0.0, 2.0 / time**2, 0.0), before[: len(r.array), None])[:, 0]
    system.set_state(q)
    K = system.matrix(1.0, 0.0, 2.0 / time**2, 1.0)
    return -np.asarray(system.local(DirectSolver(K).solve(r)))


def _residual(system: Any, q: Array) -> Any:
    """Return r at a state, a PETSc vector, zero at clamped unknowns; the state is set."""
    model, k, test = system.model, system.structure.k, ufl.TestFunction(system.V)
    state = fem.Function(system.V)
    work = [-1 * geometric_stiffness(model, (system.q, state), test, state, stiffened())]
    exact = model.strains(richest().measures(system.structure.type))
    for own, other in zip(model.mechanics.strains, exact, strict=True):
        lack = other.value - own.value
        work.append(ufl.inner(own.force(lack), k.variation(own.value)) * own.measure)
        work.append(ufl.inner(own.force(own.value), k.variation(lack)) * own.measure)
    whole = added(work)
    system.set_state(q)
    state.x.array[:] = q
    if isinstance(whole, int) or expand_derivatives(whole).empty():
        return compat.create_vector(system.V)
    return assembled(forms.form(whole, once=True), system.V, system.clamped)


class Farthest:
    """Remembers the largest state of a motion, where a theory is farthest from the exact one.

    Args:
        system: equations of motion.

    Attributes:
        seen: largest component of displacements over the length or of rotations (rad), time (s) and state.
        first: the first state.
    """

    def __init__(self, system: Any):
        self.system = system
        self.seen: tuple[float, float, Array] = (-1.0, 0.0, system.zeros())
        self.first: Array | None = None

    def __call__(self, q: Array, t: float) -> None:
        """Take note of a state (local dof array) of time t (s)."""
        if not self.system.linear:
            return
        self.first = np.array(q) if self.first is None else self.first
        size = float(np.max(self.system.sizes(q), initial=0.0))
        if size > 1.02 * self.seen[0]:  # so that not every state of a growing motion is copied
            self.seen = (size, t, np.array(q))

    def error(self, system: Any, tips: Array | None, in_balance: bool) -> TheoryError | None:
        """Return the error of a theory there; None where that fails. State and time of its system stay.

        Args:
            system: of the theory, on the mesh of the motion.
            tips: largest size of every component of the tip in the motion (m, rad); those of the state if None.
            in_balance: whether it is a motion that began at rest, in balance or undeformed.
        """
        held, time = system.held, (self.seen[1] if in_balance else 0.0) or np.inf
        if not is_estimated(held):
            return error_of_state(held, held.zeros())
        first = None if self.first is None or time == np.inf else self.first[: len(held.q.x.array)]
        return self._there(held, partial(error_of_state, held, tips=tips, time=time, first=first))

    def conditioning(self) -> float | None:
        """Return what round-off of the stiffness may have done there, relative; None where that is unknown."""
        return self._there(self.system.held, partial(conditioning, self.system.held, time=self.seen[1] or np.inf))

    def _there(self, system: Any, of_state: Callable[[Array], T]) -> T | None:
        """Return a function of the state, with its time set; None where nothing was seen, or it fails."""
        size, t, q = self.seen
        if size < 0.0:
            return None
        state, time = [x.x.array.copy() for x in (system.q, system.v, system.a)], system.time
        system.set_time(t)
        try:
            return of_state(q[: len(state[0])])
        except ComputationError:
            return None
        finally:
            system.set_time(time)
            system.set_state(*state)


def conditioning(system: Any, q: Array, time: float = np.inf) -> float:
    """Return a bound of the relative error that round-off of K makes in a state of a linear theory; 0 of others.

    K is summed once, and what rounding did to it stays: the work of its forces on a displacement q is in error by up to
    |qᵀ δK q|, and so is, relative to qᵀ K q, the compliance. Nonlinear theories evaluate their forces at every state
    from strains, whose round-off is another one each time.

    Args:
        system: equations of motion of the structure, hub held, with the time of the state set.
        q: the state, a local dof array.
        time: since the motion began (s), in which masses keep the error small; infinite of an equilibrium.
    """
    if not system.linear:
        return 0.0
    system.set_state(q)
    return rounded_compliance(system, system.matrix(1.0, 0.0, 2.0 / time**2, 1.0), q)


def rounded_compliance(system: Any, K: Any, q: Array) -> float:
    """Return |qᵀ δK q| / qᵀ K q of a displacement q, with a bound of the round-off δK of a stiffness."""
    pencil = Pencil(K, K, K)
    X = q[: K.getLocalSize()[0], None].astype(complex)
    local = float(np.real(np.sum(X * pencil.apply(K, X))))
    work = abs(system.comm.allreduce(local) if system.comm.size > 1 else local)
    return float(RoundOff(pencil).stiffness(X, X)[0]) / work if work > 0.0 else 0.0


def said_of(bound: float) -> str:
    """Return a warning of an error bound; empty of one that is small."""
    if not bound > DIGITS:
        return ""
    how = f"by up to {100 * bound:.2g} %" if bound < KNOWN else "beyond recognition"
    return (
        f"unreliable: round-off may have changed the displacements {how}, as axial or shear stiffness outweighs what "
        f'bends; fewer elements, cells less oblong, or model.theory = "{richest().name}", which sums its strains anew '
        "in every iteration"
    )
