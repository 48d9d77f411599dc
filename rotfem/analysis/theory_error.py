"""How far a theory's own strains are off at a state, as an error of its displacements: what leaves its range is said.

Two things are estimated, neither by solving the exact equations.

*Kinematics.* At a state q the strains Γ of the theory and Γ_e of the exact one differ by ΔΓ. What hangs on a strain
that is wrong by ΔΓ is displaced by ∫ΔΓ, and by ∫∫Δκ where it is a curvature, so that

    |Δu| ≲ a (L rms(ΔΓ) + ½ L² rms(Δκ))

with a ≥ 1 what the forces at the state amplify displacements by, which grows without bound towards a buckling load; in
nonlinear theories twice that, as forces then act on displaced lines, an error of the same order.

*Stress stiffness.* A linear theory that has none lacks G = ∫ N D²Γ_1, N the force at the state. The forces that it
balances by K q would be balanced by (K + G) q', so Δu = q' − q; where K + G has negative eigenvalues and K has not, the
structure buckles and the theory does not see it. Of a mode x it changes ω² by x·G x / x·M x.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc

from rotfem.equations.geometric import geometric_stiffness
from rotfem.mechanics.motion import Motion
from rotfem.mechanics.theories import richest, theories
from rotfem.numerics import forms
from rotfem.numerics.eigenproblem import Pencil
from rotfem.numerics.inertia import negative_eigenvalues
from rotfem.numerics.linear import DirectSolver, Increment, set_diagonal

Array = npt.NDArray[np.float64]

#: What the error of nonlinear strains is multiplied by for that of the lines that forces act on.
LINES = 2.0

#: Relative error of a theory from which it is warned of.
NOTICED = 0.05

#: Relative error up to which the largest rotation alone says it, and what forces amplify is not asked.
PLAIN = 0.002

#: The same of strains of first order, whose error is mostly a foreshortening.
PLAIN_LINEAR = 0.04

#: Relative error up to which nothing is compiled to look closer.
NEAR = 0.02


@dataclass(frozen=True)
class TheoryError:
    """What a theory leaves out, relative to the size of displacements or to frequencies.

    Attributes:
        estimate: relative error.
        basis: what it was estimated from, in a few words.
        theory: name of the theory.
        lacking: part of the stiffness that it lacks, as it leaves out that stress stiffens or softens.
    """

    estimate: float
    basis: str
    theory: str
    lacking: float = 0.0

    def summary(self) -> dict[str, Any]:
        """Return what a summary has of it."""
        return {"estimate": self.estimate, "basis": self.basis}

    def warning(self) -> str:
        """Return what is to be said of an error that is to be noticed; empty of others."""
        if not self.estimate > NOTICED:
            return ""
        how = "out of its range" if self.estimate >= 1.0 else f"off by about {100 * self.estimate:.2g} %"
        return f'model.theory = "{self.theory}" is {how} here ({self.basis}); "{richest().name}" is exact'


class TheoryCheck:
    """Estimates the error of the theory of a system; compiles what it needs when it needs it.

    Args:
        system: equations of motion, the hub held.
        motion: of the frame; that of the system if None.
    """

    def __init__(self, system: Any, motion: Motion | None = None):
        self.system, self.structure, self.motion = system, system.structure, motion or system.motion
        self.theory = system.model.theory
        self._forms: tuple[Any, Any] | None = None

    @cached_property
    def known(self) -> bool:
        """Whether there is anything to estimate, and strains to do it by."""
        kind = self.structure.type
        return not self.theory.exact and richest().holds_for(kind) and kind in stiffened().prestress

    @property
    def unstiffened(self) -> bool:
        """Whether the theory leaves out that stress stiffens or softens."""
        return self.theory.linear and not self.theory.prestress

    def of_state(self, q: Array) -> TheoryError:
        """Return the error of the displacements of a state (local dof array); the time that is set is that of it."""
        if not self.known:
            return self._as(0.0, "its strains are exact" if self.theory.exact else "there is none to compare it with")
        displacement, rotation = self._sizes(q)
        plain = rotation / 2 if self.theory.linear else LINES * rotation**2 / 4
        out = self._as(plain, f"the largest rotation is {rotation:.2g}")
        if plain > (PLAIN_LINEAR if self.theory.linear else PLAIN) and displacement > 0.0:
            amplified = self._amplification(q)
            if not np.isfinite(amplified):
                return self._as(1.0, "buckled: terms that it has not to order decide how far")
            out = self._as(plain * amplified, out.basis)
            if out.estimate > NEAR:
                lines = 1.0 if self.theory.linear else LINES
                error = max(lines * amplified * self._displaced(q) / min(displacement, 2.0), plain / LINES)
                out = self._as(error, "its strains against the exact ones at the state of the largest rotation")
        if self.unstiffened and displacement > 0.0:
            stress = self._without_stress(q)
            largest = max(out, stress, key=lambda error: error.estimate)
            out = replace(largest, lacking=min(1.0, stress.estimate))
        return out

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

    def _amplification(self, q: Array) -> float:
        """Return max(1, |(K_0 + G)⁻¹ f| / |K_0⁻¹ f|) with forces f like the displacements; infinite beyond buckling.

        So much softer is the structure under the forces at the state than it is without. Strains of first order
        amplify by the root only: most of their error is a foreshortening, which nothing amplifies.
        """
        system, t = self.system, self.system.time
        G = self._stress_stiffness(q)
        system.set_time(t, system.motion.at_speed(0.0), 0.0)
        system.set_state(np.zeros_like(q))
        K = system.matrix(1.0, 0.0, 0.0, 1.0)
        system.set_time(t, self.motion)
        system.set_state(q)
        force, sizes = K.createVecs()[0], []
        moves = np.array([name.startswith("u") for name in self.structure.unknowns])
        local = force.getLocalSize()
        force.array[:] = q[:local] * np.tile(moves, local // len(moves))
        for stress in (0.0, 1.0):
            K.axpy(stress, G)
            sizes.append(self._sizes(Increment(system.V).solve(DirectSolver(K), force))[0])
        if negative_eigenvalues(K) > 0:
            return float(np.inf)
        ratio = sizes[1] / sizes[0]
        return float(max(1.0, np.sqrt(ratio) if self.theory.linear else ratio))

    # --- kinematics --------------------------------------------------------------------------------------------------

    def _displaced(self, q: Array) -> float:
        """Return L rms(ΔΓ) + ½ L² rms(Δκ), over L."""
        if self._forms is None:
            self._forms = self._mismatch()
        form, switch = self._forms
        self.system.set_state(q)
        totals = []
        for one in np.eye(3):
            switch.value[:] = one
            totals.append(max(self.system.total(form), 0.0))
        strain, curvature, size = totals
        return float(np.sqrt(strain / size) + self.structure.length / 2 * np.sqrt(curvature / size))

    def _mismatch(self) -> tuple[Any, Any]:
        """Return the compiled form of (∫|ΔΓ|², ∫|Δκ|², ∫1), each times an entry of a constant, and that constant."""
        structure, apart = self.structure, list[Any]()
        own, exact = (theory.measures(structure.type) for theory in (self.theory, richest()))

        def both(*arguments: Any) -> tuple[Any, ...]:
            values = own(*arguments)
            apart.extend(e - o for e, o in zip(exact(*arguments), values, strict=True))
            return values

        structure.strains(both)
        *strains, curvature = apart
        switch = structure.constant(np.zeros(3))
        parts = (sum(ufl.inner(d, d) for d in strains), ufl.inner(curvature, curvature), 1)
        return forms.form(sum(switch[i] * part for i, part in enumerate(parts)) * structure.dx), switch

    # --- stress stiffness --------------------------------------------------------------------------------------------

    def _without_stress(self, q: Array) -> TheoryError:
        """Return the error of a linear theory that leaves out that stress stiffens, at a state."""
        basis = "it leaves out that stress stiffens or softens"
        K, G = self.system.matrix(1.0, 0.0, 0.0, 1.0), self._stress_stiffness(q)
        own = negative_eigenvalues(K)
        x = self.system.V.dofmap.index_map.size_local * self.system.V.dofmap.index_map_bs
        load, state = K.createVecs()
        state.array[:] = q[:x]
        G.mult(state, load)
        K.axpy(1.0, G)
        if own == 0 and negative_eigenvalues(K) > 0:
            return self._as(1.0, f"{basis}: it is above a buckling load that it does not see")
        change = Increment(self.system.V).solve(DirectSolver(K), load)
        before, after = self._sizes(q)[0], self._sizes(q - change)[0]
        return self._as(self._sizes(change)[0] / max(min(before, after), 1e-300), basis)

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
