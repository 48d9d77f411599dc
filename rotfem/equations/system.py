"""The equations of motion F(q, v, a; δq) = 0 of a scene, and their tangents.

F = Σ virtual work of inertia, effects, stress, damping and loads; M = ∂F/∂a, C = ∂F/∂v, K = ∂F/∂q by `ufl.derivative`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem, la
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI

from rotfem.equations.model import Model, integral_count
from rotfem.mechanics.motion import IDENTITY, Motion
from rotfem.numerics import compat, forms
from rotfem.structures.turning_clamp import TurningClamp

Array = npt.NDArray[np.float64]


class System:
    """A compiled nonlinear system: residual and tangent at (q, v, a, t).

    Attributes:
        q, v, a: dolfinx functions that hold the state the forms are evaluated at.
        linear: False; the affine system of a linear theory says True.
        settled: whether M, C and K are those of the time before; a linear theory may know they are.
        scale: size of each local unknown (m or 1), by which increments are judged.
    """

    linear = False
    settled = False

    def __init__(self, model: Model):
        self.model, self.structure, self.motion = model, model.structure, model.motion
        k = self.structure.k
        self.q, self.v, self.a, self.V = k.q, k.v, k.a, self.structure.V
        self._state = tuple(x.x.array for x in (self.q, self.v, self.a))
        self.scale = self.structure.scales()
        self.time = 0.0
        #: Time spent on assembly while compiling, s.
        self.assembled = 0.0
        self.bcs = [fem.dirichletbc(fem.Function(self.V), self.structure.clamped)]
        owned = self.V.dofmap.index_map.size_local
        nodes = self.structure.clamped[self.structure.clamped < owned]
        bs = self.V.dofmap.index_map_bs
        self.clamped = (nodes[:, None] * bs + np.arange(bs)).ravel()
        self._shift_values: tuple[float, ...] = (1.0, 0.0, 1.0)
        self._shifts = [self.structure.constant(c) for c in self._shift_values]
        self.clamp = TurningClamp(self.structure, self.motion) if model.fixed else None
        self._energies = {name: forms.form(form) for name, form in model.energies().items()}
        self._b = la.vector(self.V.dofmap.index_map, self.V.dofmap.index_map_bs)
        self._b_array = self._b.array
        self.b = compat.wrap(self._b)
        self._compile()

    def _compile(self) -> None:
        F, du = self.model.residual, ufl.TrialFunction(self.V)
        parts = (ufl.derivative(F, x, du) for x in (self.q, self.v, self.a))
        J = sum(c * form for c, form in zip(self._shifts, parts, strict=True))
        self.integrals = {"F": integral_count(F), "J": integral_count(J)}
        self._F, self._J = forms.form(F), forms.form(J)
        self.A = fem_petsc.create_matrix(self._J)

    @property
    def current(self) -> bool:
        """Whether the last tangent is that of this time, but for its shifts; a linear theory may know it is."""
        return False

    def set_state(self, q: Array, v: Array, a: Array) -> None:
        """Write local dof arrays into the functions q, v, a that the forms are evaluated at."""
        for target, value in zip(self._state, (q, v, a), strict=True):
            target[:] = value

    def set_time(self, t: float, motion: Motion | None = None, load_factor: float = 1.0) -> None:
        """Write the frame and load constants of time t (s), for the scene's motion unless another is given.

        Args:
            t: time, s.
            motion: another motion than the scene's.
            load_factor: multiplies loads, gravity and base acceleration (not the spin).
        """
        motion = motion or self.motion
        self.time = t
        values = self.model.frame.values(motion, t)
        self.model.frame.set({n: v * load_factor if n in ("a_o", "gravity") else v for n, v in values.items()})
        for name, value in self.load_values(t, motion).items():
            self.structure.load_constants[name][0].value[...] = load_factor * value

    def load_values(self, t: float, motion: Motion) -> dict[str, Array]:
        """Return the amplitude of every load constant at time t (s); in a fixed frame dead loads turn with the hub."""
        if not self.structure.load_constants:
            return {}
        Q = motion.rotation(t) if self.model.fixed else IDENTITY
        turning = {load.name for load in self.model.applied if load.dead and self.model.fixed}
        values = {}
        for name, (_, at) in self.structure.load_constants.items():
            value = np.atleast_1d(np.asarray(at(t), dtype=float))
            n = value.size
            values[name] = Q[:n, :n] @ value if name in turning and n > 1 else value
        return values

    def residual(self) -> Any:
        """Return −F at the state in q, v, a as a PETSc vector (reused), zero at clamped unknowns."""
        b = self._b_array
        b[:] = 0.0
        fem.assemble_vector(b, self._F)
        if self.model.comm.size > 1:
            self._b.scatter_reverse(la.InsertMode.add)
        np.negative(b, out=b)
        b[self.clamped] = 0.0
        return self.b

    def tangent(self, c_k: float, c_v: float, c_m: float) -> tuple[Any, bool]:
        """Return (c_k K + c_v C + c_m M at the state, whether it changed); clamped rows are identity rows."""
        self._set_shifts(c_k, c_v, c_m)
        self.A.zeroEntries()
        fem_petsc.assemble_matrix(self.A, self._J, self.bcs)
        self.A.assemble()
        return self.A, True

    def _set_shifts(self, *shifts: float) -> None:
        if shifts != self._shift_values:
            for constant, value in zip(self._shifts, shifts, strict=True):
                constant.value = value
            self._shift_values = shifts

    def matrix(self, c_k: float, c_v: float, c_m: float, diagonal: float) -> Any:
        """Return a new matrix c_k K + c_v C + c_m M at the state with `diagonal` at clamped unknowns."""
        self._set_shifts(c_k, c_v, c_m)
        A = fem_petsc.create_matrix(self._J)
        fem_petsc.assemble_matrix(A, self._J, self.bcs, diagonal)
        A.assemble()
        return A

    def mass_damping_stiffness(self, keep: bool = True) -> tuple[Any, Any, Any]:
        """Return (M, C, K) at the state and time set; clamped unknowns have 1 in K, 0 in M and C.

        Args:
            keep: whether they must outlast the next state or time that is set.
        """
        return self.matrix(0, 0, 1, 0.0), self.matrix(0, 1, 0, 0.0), self.matrix(1, 0, 0, 1.0)

    def size(self, x: Array) -> float:
        """Return the largest entry of a local dof array in units of `scale`, over all ranks."""
        here = float(np.max(np.abs(x) / self.scale)) if x.size else 0.0
        return here if self.model.comm.size == 1 else self.model.comm.allreduce(here, op=MPI.MAX)

    def sizes(self, x: Array) -> Array:
        """Return the largest entry of each component in units of `scale`, over all ranks, shape (components,)."""
        here = (np.abs(x) / self.scale).reshape(-1, self.V.dofmap.index_map_bs).max(axis=0, initial=0.0)
        if self.model.comm.size > 1:
            self.model.comm.Allreduce(MPI.IN_PLACE, here, op=MPI.MAX)
        return np.asarray(here)

    def shape(self) -> dict[str, Array]:
        """Return the deflected structure at the state: position x (m), u1, u2 (m), alpha, … in the turning frame."""
        coordinates, q = self.structure.nodes(self.q.x.array)
        if self.clamp is not None:
            q = self.clamp.relative(q, coordinates["x"], self.time)
        return {**coordinates, **{name: q[:, i] for i, name in enumerate(self.structure.components)}}

    def energies(self) -> dict[str, float]:
        """Return kinetic and strain energy and the Jacobi integral T2 − T0 + W + V, J.

        V is the potential of dead loads, gravity and base acceleration; the integral is constant while these and the
        spin are constant in the frame and nothing dissipates.
        """
        comm = self.model.comm
        e = {name: comm.allreduce(float(fem.assemble_scalar(form))) for name, form in self._energies.items()}
        kinetic = e["T2"] + e.get("T1", 0.0) + e.get("T0", 0.0)
        if "momentum" in e:
            jacobi = kinetic - self._spin() * e["momentum"] + e["strain"]
        else:
            jacobi = e["T2"] - e.get("T0", 0.0) + e["strain"]
        potential = e.get("potential", 0.0)
        if self.clamp is not None and "tip_moment" in self.structure.load_constants:
            # A dead moment works on the rotation relative to the hub, alpha − psi.
            potential += float(self.structure.load_constants["tip_moment"][0].value[0]) * self.clamp.angle(self.time)
        return {"kinetic": kinetic, "strain": e["strain"], "jacobi": jacobi + potential}

    def _spin(self) -> float:
        return self.motion.speed(self.time) * float(self.motion.axis[2])


def compile_system(model: Model) -> System:
    """Return the affine system of a linear theory, the nonlinear one otherwise."""
    from rotfem.equations.affine import AffineSystem

    return AffineSystem(model) if model.theory.linear else System(model)
