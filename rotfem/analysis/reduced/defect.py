"""The error of a motion with its foreshortening, by defect correction with an exact theory.

L(η) = 0 are the linear reduced equations. The displacement q(η) is that whose exact strains are the linear ones of V η,

    ∫ N(δq)·(Γ(q) − Γ'(0) V η) = 0,    q ← q − K₀⁻¹ ∫ N(δq)·(Γ(q) − Γ'(0) V η),

N the forces of a linear structure; to second order it is the manifold V η + ½ Θ η η. What an exact theory leaves of its
equations there, projected on V + Θ η, is R(η). The motion η₂ of second order gets a correction

    L(η₃) = L(η₂) − R(η₂),

a linear solution more (Zadunaisky 1976; Stetter 1978, section 2). The error of η₂ is to leading order the largest
difference of its tip to that of q(η₂) + V (η₃ − η₂).
"""

from __future__ import annotations

from copy import copy
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from scipy.interpolate import CubicSpline

from rotfem.analysis.reduced.response import Response, after
from rotfem.analysis.reduced.solution import Solution, States
from rotfem.equations.geometric import strain_work
from rotfem.errors import ComputationError
from rotfem.numerics import forms
from rotfem.numerics.projection import summed

Array = npt.NDArray[np.float64]

#: Iterations for q(η), each of which is right to one order more, and instants at once.
SWEEPS, AT_ONCE = 3, 64

#: Samples at most where they are more than steps, and angle between two by which a vibration goes on that they resolve:
#: an eighth of a period, rad.
MOST, SAMPLED = 4096, np.pi / 4

#: Part of the largest displacement of the tip that vibrations may have that samples do not resolve: in forces of third
#: order three times as much is lost.
UNSAMPLED = 0.02

#: Part of the time between samples by which the motion goes on and back for the rates of q(η).
PART = 0.01


def error_by_defect(response: Response, exact: Any, start: Array | None) -> float | None:
    """Return the error of the tip of a response with foreshortening, relative to its largest displacement.

    It is no more than the difference that the foreshortening makes; None without foreshortening.

    Args:
        response: a history of a linear theory.
        exact: equations of an exact theory on the same mesh, bordered if the hub is free.
        start: shape at the start in that theory, local dof array; undeformed if None.
    """
    manifold, bent, most, model = response.manifold, response.bent, response.foreshortening, response.model
    if manifold is None or bent is None or most is None or not model.size:
        return most
    defect, equations = Defect(response, exact), copy(response.equations)
    t, y = defect.times, [x[0] for x in bent.at(bent.ends[:1])]
    if not np.all(np.isfinite(defect.forces)):  # far beyond what the correction is small for
        return most
    equations.further = CubicSpline(t, defect.forces)
    if start is not None:
        y[0][: model.size] += model.coordinates(start - defect.displacements(equations.structure(y[0])[None, :])[:, 0])
    try:
        corrected = equations.coordinates(Solution(equations, bent.ends, *y[:2]), t)[0]
    except ComputationError:  # as far
        return most
    change = defect.change + (corrected - equations.coordinates(bent, t)[0]) @ model.tips().T
    return min(most, model.largest(change) / max(model.largest(response.tips), 1e-300))


class Defect:
    """R − L of samples of the motion on the manifold.

    Args:
        response: a history with foreshortening.
        exact: equations of an exact theory on the same mesh, bordered if the hub is free.

    Attributes:
        times: of the samples, s.
        forces: R − L, (n, unknowns).
        change: of the unknowns at the tip from the manifold to q(η), (n, components).
    """

    def __init__(self, response: Response, exact: Any):
        assert response.bent is not None
        assert response.manifold is not None
        self.model, self.manifold, self.equations = response.model, response.manifold, response.equations
        self.exact, system = exact, response.model.system
        self.times, states = self._samples(response.bent)
        self._q, self._linear = fem.Function(system.V), fem.Function(system.V)
        work = strain_work(system.model, self._q, self._linear, ufl.TestFunction(system.V))
        self._work = forms.form(work, once=True)
        self._little = PART * float(self.times[1] - self.times[0])
        parts = np.array_split(np.arange(len(self.times)), -(-len(self.times) // AT_ONCE))
        found = [self._at(self.times[i], tuple(x[i] for x in states)) for i in parts]
        self.forces, self.change = (np.concatenate(x) for x in zip(*found, strict=True))

    def _samples(self, bent: Solution) -> tuple[Array, States]:
        """Return times (n,), s, as many as steps or as resolve the vibrations of the tip, and the states there."""
        number, first, last = bent.steps, float(bent.ends[0]), float(bent.ends[-1])
        while True:
            apart = (last - first) / number
            t = after(first + apart * (np.arange(number) + 0.5))
            states, slow = bent.at(t), bent.at(t, SAMPLED / apart)
            tips, resolved = (self.equations.structure(x[0]) @ self.model.tips().T for x in (states, slow))
            if number >= MOST or self.model.largest(tips - resolved) <= UNSAMPLED * self.model.largest(tips):
                return t, slow
            number *= 2

    def _at(self, t: Array, states: tuple[Array, ...]) -> tuple[Array, Array]:
        """Return R − L (n, unknowns) and the change at the tip by q(η), of states at times (n,)."""
        model, m, s, owned = self.model, self.model.size, self._little, self.model.owned
        y, dy, ddy = (self.equations.structure(x) for x in states)
        back, here, on = (self.displacements(y + a * s * dy + 0.5 * (a * s) ** 2 * ddy) for a in (-1, 0, 1))
        full = here, (on - back) / (2 * s), (on - 2 * here + back) / s**2
        basis = np.hstack([model.V, self.manifold.Theta])[owned]
        left, rest = np.empty((len(t), basis.shape[1])), np.empty((len(t), states[0].shape[1] - m))
        for i, now in enumerate(t):
            self.exact.set_time(float(now))
            self.exact.set_state(*(np.append(x[:, i], of[i, m:]) for x, of in zip(full, states, strict=True)))
            F = -self.exact.imbalance()
            left[i], rest[i] = F[: owned.stop] @ basis, F[owned.stop :]
        left = np.asarray(summed(model.comm, left))
        R = np.hstack([left[:, :m] + self.manifold.along(y, left[:, m:]), rest])
        return R - self.equations.at(t)(*states), model.tips(here).T - self.manifold.tip(y)

    def displacements(self, y: Array) -> Array:
        """Return q(η) of coordinates (n, m), local dof arrays (dofs, n)."""
        model = self.model
        linear = model.V @ y.T
        out = np.stack([self.manifold.shape(row) for row in y], axis=1)
        right = np.empty((model.owned.stop, len(y)))
        for _ in range(SWEEPS):
            for i in range(len(y)):
                self._q.x.array[:], self._linear.x.array[:] = out[:, i], linear[:, i]
                right[:, i] = model.assembled(self._work)
            out = out - model.solve(model.system.material_solver, right)
        return out
