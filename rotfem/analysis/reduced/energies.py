"""Energies of a motion in the coordinates of a basis, to the second order that a linear theory is.

T = T2 + T1 + T0 with T2 = ½ v·M v; T0 and T1 follow from what they do: the centrifugal force is ∂T0/∂q, and that of
Euler's acceleration d(∂T1/∂q̇)/dΩ · Ω̇.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx.fem import petsc as fem_petsc

from rotfem.analysis.reduced.model import ReducedModel
from rotfem.equations.pieces import PRESTRESS
from rotfem.numerics import compat, forms
from rotfem.numerics.projection import summed

Array = npt.NDArray[np.float64]


class ReducedEnergies:
    """Kinetic and strain energy and the Jacobi integral of a reduced model.

    Args:
        model: the reduced model.
    """

    def __init__(self, model: ReducedModel):
        self.model, self.system = model, model.system
        names = self.system.model.energies()
        self._T0 = self._of("centrifugal", 2) if "T0" in names else None
        self._T1 = self._linear_part(names) if "T1" in names else None

    def __call__(self, c: Array, speed: Array, q: Array, v: Array) -> dict[str, Array]:
        """Return the energies (n,), J, of coordinates and rates (n, m).

        Args:
            c: factors of all pieces, (n, pieces).
            speed: of the frame, rad/s.
            q: coordinates.
            v: rates.
        """
        M, _, K, f = self.model.operators(c)
        inertia = self.system.rest_inertia if self._T0 is not None else 0.0
        moving, strain = 0.5 * _form(M, v, v), 0.5 * np.einsum("ni,ni->n", q, q)
        kinetic = moving + inertia * speed**2
        if self._T0 is not None:
            load, stiffness = self._T0
            kinetic -= speed**2 * (q @ load + 0.5 * np.einsum("ni,ij,nj->n", q, stiffness, q))
        if self._T1 is not None:
            load, coupling = self._T1
            kinetic += speed * (v @ load + np.einsum("ni,ij,nj->n", v, coupling, q))
        jacobi = moving + 0.5 * _form(K, q, q) + np.einsum("ni,ni->n", f, q) - inertia * speed**2
        return {"kinetic": kinetic, "strain": strain, "jacobi": jacobi}

    def momentum(self, speed: Array, q: Array, v: Array) -> Array:
        """Return the angular momentum of the structure about the axis, ∂T/∂Omega, (n,), kg·m²/s (see `__call__`)."""
        out = np.zeros(len(speed))
        if self._T0 is not None:
            load, stiffness = self._T0
            turned = self.system.rest_inertia - q @ load - 0.5 * np.einsum("ni,ij,nj->n", q, stiffness, q)
            out += 2 * speed * turned
        if self._T1 is not None:
            load, coupling = self._T1
            out += v @ load + np.einsum("ni,ij,nj->n", v, coupling, q)
        return out

    def _of(self, effect: str, degree: int) -> tuple[Array, Array]:
        """Return f (m,) and K (m, m) of an effect at unit speed or rate about the axis; prestress is none of it."""
        model, axis, m = self.model, self.system.motion.axis, self.model.size
        load, stiffness = np.zeros(m), np.zeros((m, m))
        components = axis[2:] if self.system.structure.planar else axis
        for kind, out in (("f", load), ("K", stiffness)):
            for place, i in enumerate(model.kinds[kind]):
                piece = self.system.pieces[i]
                if effect in piece.of and PRESTRESS not in piece.of and len(piece.key) == degree:
                    out += np.prod([components[j] for _, j in piece.key]) * model.small[kind][place]
        return load, stiffness

    def _linear_part(self, names: dict[str, Any]) -> tuple[Array, Array]:
        """Return ∂T1/∂v at q = 0 (m,) and ∂²T1/∂v∂q (m, m) at unit speed about the axis."""
        if "euler" in self.system.model.effects:
            return self._of("euler", 1)
        system, k, model = self.system, self.system.structure.k, self.model
        V, owned = model.V, model.owned
        form = forms.form(ufl.derivative(names["T1"], k.v, k.dq))
        spin = system.model.frame.constants["w"]
        kept = spin.value.copy()
        spin.value[...] = system.motion.axis[-spin.value.size :]

        def slope(q: Array) -> Array:
            system.set_state(q)
            b = compat.create_vector(system.V)
            fem_petsc.assemble_vector(b, form)
            b.ghostUpdate(addv=compat.ADD, mode=compat.REVERSE)
            return np.asarray(summed(system.comm, V[owned].T @ b.array[owned]))

        sizes = np.array([1e-3 / max(system.size(column), 1e-300) for column in V.T])
        pairs = [(slope(s * x) - slope(-s * x)) / (2 * s) for s, x in zip(sizes, V.T, strict=True)]
        load = slope(system.zeros())
        spin.value[...] = kept
        return load, np.array(pairs).reshape(len(pairs), -1).T


def _form(A: Array, x: Array, y: Array) -> Array:
    """Return x·A y (n,)."""
    return np.asarray(np.einsum("ni,nij,nj->n", x, A, y))
