"""The error that a theory makes at a state: what its strains lack against the exact ones, as displacements.

At a state q the strains Γ of the theory and Γ_e of the exact one differ by ΔΓ. In the exact equations

    ∫ C Γ_e(q + Δq)·DΓ_e(q + Δq)[δq] = (forces)[δq],    Γ_e = Γ + ΔΓ,

what is of first order in Δq and ΔΓ is a linear equation for the error Δq of the theory,

    K Δq = −r,    r[δq] = ∫ C ΔΓ·DΓ[δq] + C Γ·DΔΓ[δq],

with K the tangent at q, the stress stiffness G = ∫ N D²Γ_1 in it. A linear theory with stress stiffness has G q in its
own forces, so r is less by that. Where K has negative eigenvalues and the stiffness of the theory has none, the
structure buckles and the theory does not see it. It is Newton's first correction but for the forces C ΔΓ·DΔΓ, which the
correction itself relaxes (of a bent line that is not foreshortened, the membrane force). Forces on the masses are kept.

Of a mode x, stress stiffness changes ω² by x·G x / x·M x.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from ufl.algorithms import expand_derivatives

from rotfem.equations.geometric import geometric_stiffness
from rotfem.errors import ComputationError
from rotfem.mechanics.motion import Motion
from rotfem.mechanics.sums import added
from rotfem.mechanics.theories import richest, theories
from rotfem.numerics import compat, forms
from rotfem.numerics.eigenproblem import Pencil, RoundOff
from rotfem.numerics.inertia import negative_eigenvalues
from rotfem.numerics.linear import DirectSolver, Increment, set_diagonal

Array = npt.NDArray[np.float64]

T = TypeVar("T")

#: Relative error of a theory from which it is warned of.
NOTICED = 0.05

#: Relative error of a component of the tip from which it is reported, and above which it is computed.
REPORTED = 0.01

#: Part of the largest component below which one is round-off: Newton's method accepts such increments.
RESOLVED = 1e-9

#: What is said of a theory without stress stiffness.
OF_STRESS = "it leaves out that stress stiffens or softens"

#: By how much a state must exceed the largest one so far to take its place.
MORE = 1.02

#: Bound of the relative error by round-off from which it is warned of, and the largest that is given as a number.
DIGITS, KNOWN = 1e-2, 1.0

#: Largest rotation (rad) up to which expansions in it converge quickly enough for an estimate.
EXPANDED = 1.0


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
        if not self.estimate > NOTICED:
            return self._of_components()
        how = "out of its range" if self.estimate >= 1.0 else f"off by about {100 * self.estimate:.2g} %"
        return f'model.theory = "{self.theory}" is {how} here ({self.basis}); "{richest().name}" is exact'

    def _of_components(self) -> str:
        """Return the warning of components that are far smaller than the error allows them to be known."""
        wrong = {name: error for name, error in self.components.items() if error > NOTICED}
        if not wrong:
            return ""
        sizes = {name: f"by {100 * error:.2g} % of it" if error < 1.0 else "unknown" for name, error in wrong.items()}
        listed = ", ".join(f"{name} ({size})" for name, size in sizes.items())
        how = f'in error by what the theory "{self.theory}" leaves out: {listed}'
        return f'small components of the tip are {how}; "{richest().name}" is exact'


class TheoryCheck:
    """Estimates the error of the theory of a system; compiles what it needs when it needs it.

    Args:
        system: equations of motion, the hub held.
        motion: of the frame; that of the system if None.
    """

    def __init__(self, system: Any, motion: Motion | None = None):
        self.system, self.structure, self.motion = system, system.structure, motion or system.motion
        self.theory = system.model.theory
        self._form: Any = None

    @cached_property
    def known(self) -> bool:
        """Whether there is anything to estimate, and strains to do it by."""
        kind = self.structure.type
        return not self.theory.exact and richest().holds_for(kind) and kind in stiffened().prestress

    @property
    def unstiffened(self) -> bool:
        """Whether the theory leaves out that stress stiffens or softens."""
        return self.theory.linear and not self.theory.prestress

    def of_state(self, q: Array, tips: Array | None = None) -> TheoryError:
        """Return the error of the displacements of a state, whose time is set.

        Args:
            q: the state, a local dof array.
            tips: sizes that the components of the tip have (m, rad), (components,); those of the state if None.
        """
        if not self.known:
            return self._as(0.0, "its strains are exact" if self.theory.exact else "there is none to compare it with")
        displacement, rotation = self._sizes(q)
        if displacement == 0.0:
            return self._as(rotation / 2, f"the largest rotation is {rotation:.2g}")
        tips = np.abs(self._tip(q)) if tips is None else tips
        resolved, neglected = self._resolved(tips), max(displacement, rotation) / 2
        small = neglected * np.max(tips[resolved], initial=0.0) <= REPORTED * np.min(tips[resolved], initial=np.inf)
        if small and self.theory.prestress:
            return self._as(neglected, f"the largest rotation is {rotation:.2g}")
        return self._computed(q, tips, resolved, rotation)

    def _computed(self, q: Array, tips: Array, resolved: Array, rotation: float) -> TheoryError:
        """Return the error by the correction Δq of a state."""
        system, model = self.system, self.system.model
        r = self._residual(q)
        K, state = system.matrix(1.0, 0.0, 0.0, 1.0), r.duplicate()
        stress = state.duplicate()
        if self.theory.linear:
            G = self._stress_stiffness(q)
            state.array[:] = q[: r.getLocalSize()]
            G.mult(state, stress)
            if self.unstiffened:
                own = negative_eigenvalues(K)
                K.axpy(1.0, G)
                if negative_eigenvalues(K) > own:
                    return self._as(1.0, f"{OF_STRESS}: it is above a buckling load that it does not see")
            else:
                r.axpy(-1.0, stress)
        solver, solution = DirectSolver(K), Increment(system.V)
        change = -solution.solve(solver, r).copy()
        estimate = self._relative(q, change)
        lacking = self._relative(q, -solution.solve(solver, stress)) if self.unstiffened else 0.0
        basis = OF_STRESS if lacking > estimate / 2 else "its strains against the exact ones at the farthest state"
        if rotation > EXPANDED:
            estimate = max(estimate, rotation)
        if model.problem.inactive:  # among them are the displacements that bending makes along the structure
            estimate = max(estimate, rotation / 2)
        errors = np.abs(self._tip(change))[resolved] / tips[resolved]
        names = [f"tip_{name}" for name in np.array(self.structure.components)[resolved]]
        wrong = {name: float(x) for name, x in zip(names, errors, strict=True) if x > REPORTED}
        return replace(self._as(estimate, basis), components=wrong)

    def _relative(self, q: Array, change: Array) -> float:
        """Return the size of a change of displacements over that of the smaller of the states before and after."""
        return self._sizes(change)[0] / max(min(self._sizes(q)[0], self._sizes(q + change)[0]), 1e-300)

    def _tip(self, x: Array) -> Array:
        """Return all components of a displacement at the tip, relative to the turning frame."""
        whole = self.structure.whole_values(self.structure.tip_values(x))
        return np.asarray(self.system.seen_from_hub(whole[None, :], self.structure.length, self.system.time)[0])

    def _resolved(self, tips: Array) -> Array:
        """Return which components are more than round-off of displacements or of rotations."""
        moves = np.array([name.startswith("u") for name in self.structure.components])
        largest = np.where(moves, np.max(tips[moves]), np.max(tips[~moves], initial=0.0))
        return np.asarray(tips > RESOLVED * largest)

    def of_modes(self, q: Array, values: Any, modes: Any, massed: Any) -> TheoryError:
        """Return the error of frequencies about an equilibrium.

        Args:
            q: equilibrium of a nonlinear theory; a linear one has another, which is found here.
            values: λ of the modes.
            modes: x, one column each, of the locally owned unknowns (that of a free hub may follow them).
            massed: M x.
        """
        self.system.set_time(0.0, self.motion)
        if self.known and self.theory.linear:
            q = self._under_load()
        out = self.of_state(q)
        if not (self.known and self.unstiffened):
            return out
        G = self._stress_stiffness(q)
        X = modes[: G.getLocalSize()[0]]
        products = ((X, Pencil(G, G, G).apply(G, X)), (modes, massed))
        sums = np.array([np.real(x.conj() * Ax).sum(axis=0) for x, Ax in products])
        stress, mass = self.system.comm.allreduce(sums) if self.system.comm.size > 1 else sums
        squares = np.real(-(values**2))  # ω², negative for a divergence
        own, stressed = (np.sqrt(np.maximum(square, 0.0)) for square in (squares, squares + stress / mass))
        errors = np.abs(stressed - own) / np.maximum(np.abs(values), 1e-300)
        return self._as(float(errors.max(initial=0.0)), "it leaves out that stress stiffens or softens modes")

    def _under_load(self) -> Array:
        """Return the equilibrium of a linear theory at the time and speed set, which modes are not about."""
        system, out = self.system, Increment(self.system.V)
        system.set_state(system.zeros())
        return out.solve(DirectSolver(system.matrix(1.0, 0.0, 0.0, 1.0)), system.residual()).copy()

    def _as(self, estimate: float, basis: str) -> TheoryError:
        return TheoryError(float(estimate), basis, self.theory.name)

    def _sizes(self, q: Array) -> tuple[float, float]:
        """Return the size of displacements over L, and the largest rotation component (rad)."""
        sizes, names = self.system.sizes(q), self.structure.components
        u = [size for size, name in zip(sizes, names, strict=True) if name.startswith("u")]
        turns = [size for size, name in zip(sizes, names, strict=True) if not name.startswith("u")]
        return float(np.linalg.norm(u)), float(max(turns, default=0.0))

    # --- stress stiffness --------------------------------------------------------------------------------------------

    def _residual(self, q: Array) -> Any:
        """Return r at a state, a PETSc vector, zero at clamped unknowns; the state is set."""
        system, model = self.system, self.system.model
        if self._form is None:
            k, work = self.structure.k, []
            exact = model.strains(richest().measures(self.structure.type))
            for own, other in zip(model.mechanics.strains, exact, strict=True):
                lack = other.value - own.value
                work.append(ufl.inner(own.force(lack), k.variation(own.value)) * own.measure)
                work.append(ufl.inner(own.force(own.value), k.variation(lack)) * own.measure)
            whole = added(work)
            vanishes = isinstance(whole, int) or expand_derivatives(whole).empty()
            self._form = () if vanishes else forms.form(whole, once=True)
        system.set_state(q)
        r = compat.create_vector(system.V)
        if self._form != ():
            fem_petsc.assemble_vector(r, self._form)
            r.ghostUpdate(addv=compat.ADD, mode=compat.REVERSE)
            r.array[system.clamped] = 0.0
        return r

    def _stress_stiffness(self, q: Array) -> Any:
        """Return G = ∫ N D²Γ_1 at a state as a PETSc matrix, zero at clamped unknowns."""
        system, model = self.system, self.system.model
        system.set_state(q)
        u, w, base = ufl.TestFunction(system.V), ufl.TrialFunction(system.V), fem.Function(system.V)
        base.x.array[:] = q
        out = geometric_stiffness(model, (system.q, base), u, w, stiffened())
        if isinstance(out, int):
            G = system.matrix(1.0, 0.0, 0.0, 0.0)
            G.zeroEntries()
            return G
        G = fem_petsc.create_matrix(compiled := forms.form(out, once=True))
        fem_petsc.assemble_matrix(G, compiled, system.bcs, 0.0)
        G.assemble()
        set_diagonal(system.clamped, G, 0.0)
        return G


def stiffened() -> Any:
    """Return the poorest linear theory that has the stiffening by stress."""
    return next(theory for theory in theories() if theory.linear and theory.prestress)


class Farthest:
    """Remembers the largest state of a motion, where a theory is farthest from the exact one.

    Args:
        system: equations of motion.

    Attributes:
        seen: largest component of displacements over the length or of rotations (rad), time (s) and state.
    """

    def __init__(self, system: Any):
        self.system, self.check = system, TheoryCheck(system.held)
        self.seen: tuple[float, float, Array] = (-1.0, 0.0, system.zeros())

    def __call__(self, q: Array, t: float) -> None:
        """Look at a state (local dof array) of time t (s)."""
        if not (self.check.known or self.system.linear):
            return
        size = float(np.max(self.system.sizes(q), initial=0.0))
        if size > MORE * self.seen[0]:
            self.seen = (size, t, np.array(q))

    def error(self, tips: Array | None = None) -> TheoryError | None:
        """Return the error of the theory there; None where that fails. State and time of the system stay.

        Args:
            tips: largest size of every component of the tip in the motion (m, rad); those of the state if None.
        """
        if not self.check.known:
            return self.check.of_state(self.seen[2])
        return self._there(partial(self.check.of_state, tips=tips))

    def lost_digits(self) -> float | None:
        """Return what round-off of the stiffness may have done there, relative; None where that cannot be said."""
        return self._there(partial(lost_digits, self.system.held))

    def _there(self, of_state: Callable[[Array], T]) -> T | None:
        """Return a function of the state, with its time set; None where nothing was seen, or it fails."""
        system, (size, t, q) = self.system.held, self.seen
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


def lost_digits(system: Any, q: Array) -> float:
    """Return a bound of the relative error that round-off of K makes in a state of a linear theory; 0 of others.

    K is summed once, and what rounding did to it stays: the work of its forces on a displacement q is off by up to
    |qᵀ δK q|, and so is, relative to qᵀ K q, the compliance. Nonlinear theories evaluate their forces at every state
    from strains, whose round-off is another one each time.

    Args:
        system: equations of motion of the structure, hub held, with the time of the state set.
        q: the state, a local dof array.
    """
    if not system.linear:
        return 0.0
    system.set_state(q)
    K = system.matrix(1.0, 0.0, 0.0, 1.0)
    pencil = Pencil(K, K, K)
    X = q[: K.getLocalSize()[0], None].astype(complex)
    local = float(np.real(np.sum(X * pencil.apply(K, X))))
    work = abs(system.comm.allreduce(local) if system.comm.size > 1 else local)
    return float(RoundOff(pencil).stiffness(X, X)[0]) / work if work > 0.0 else 0.0


def said_of(bound: float) -> str:
    """Return what is to be said of an error bound; empty of one that is small."""
    if not bound > DIGITS:
        return ""
    how = f"by up to {100 * bound:.2g} %" if bound < KNOWN else "beyond recognition"
    return (
        f"unreliable: round-off may have changed the displacements {how}, as axial or shear stiffness outweighs what "
        f'bends; fewer elements, cells less oblong, or model.theory = "{richest().name}", which sums its strains anew '
        "in every iteration"
    )
