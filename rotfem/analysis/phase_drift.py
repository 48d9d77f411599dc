"""The phase by which a linear theory with stress stiffness drifts from the exact one in a vibration left to itself.

Its stress stiffness is that of the undeformed structure, the exact one that of the structure which spin and loads have
deformed. So eigenvalues λ of a mode differ in both theories, each about its own equilibrium. What a start with q₀ and
v₀, relative to the equilibrium, has of a mode with right and left vectors x and y is c x with

    c = yᴴ[(λM + C)q₀ + Mv₀] / yᴴ(2λM + C)x

(Tisseur & Meerbergen, SIAM Review 43 (2001) 235, section 3). After the time T, or where damping −Re λ ends the
vibration sooner, it is out of phase by |dλ| T. What drives a motion keeps its phase: this is of motions that nothing
drives.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.equilibrium import steady_state
from rotfem.equations.compiled import compile_system
from rotfem.mechanics.problem import Problem
from rotfem.mechanics.theories import richest
from rotfem.numerics.eigenproblem import Pencil
from rotfem.numerics.newton import Newton

Array = npt.NDArray[np.float64]


def drift(problem: Problem, system: Any, start: tuple[Array, Array], time: float, newton: Newton) -> float:
    """Return by how much the phase moves the tip, m.

    Args:
        problem: a linear theory's, at constant speed, with nothing that drives its motion.
        system: equations of motion, the hub held; its state and time are set.
        start: q and v at t = 0, local dof arrays.
        time: that passes, s.
        newton: iteration control.

    Raises:
        ComputationError: there is no equilibrium in one of both theories, or no mode.
    """
    speed, (q, v) = float(problem.motion.speed(0.0)), start
    rest = steady_state(system, speed, newton)
    if not np.any(rest) or not (np.any(q - rest) or np.any(v)):
        return 0.0
    exact = compile_system(problem.replace(theory=richest(), outputs={}), system.comm, moving=False)
    exact.set_state(steady_state(exact, speed, newton))
    system.set_state(rest)
    pencil, other = (Pencil(*each.mass_damping_stiffness()) for each in (system, exact))
    pairs, there = pencil.solve(8), other.solve(8)  # a free vibration from a smooth start has little of higher ones
    lam, x, y = pairs.values, pairs.right, pairs.left

    def times(A: Any, vector: Array) -> Array:
        return pencil.apply(A, vector[: len(x), None].astype(complex))

    def product(columns: Array) -> Array:
        return np.asarray(system.comm.allreduce(y.conj().T @ columns))

    away, (M, C) = q - rest, (pencil.M, pencil.C)
    norms = np.diag(product(2 * lam * pencil.apply(M, x) + pencil.apply(C, x)))
    share = (lam * product(times(M, away))[:, 0] + product(times(C, away) + times(M, v))[:, 0]) / norms
    same = np.argmax(np.abs(product(pencil.apply(M, there.right))), axis=1)
    change = np.abs(there.values[same] - lam)
    lasting = np.minimum(time, 1.0 / np.maximum(-lam.real, 1.0 / time))
    out = np.abs(share) * np.minimum(change * lasting, 2.0)  # which is out of phase
    moves = [i for i, name in enumerate(system.structure.components) if name.startswith("u")]

    def tip(owned: Array) -> Array:
        return np.asarray(system.structure.tip_values(_filled(system, owned))[moves])

    lengths = [np.linalg.norm([tip(x[:, k].real), tip(x[:, k].imag)]) for k in range(len(lam))]
    return float(np.sum(out * lengths, where=lam.imag > 0.0) * 2.0)  # with the conjugate pairs


def _filled(system: Any, owned: Array) -> Array:
    """Return the values of owned unknowns with those of ghosts, a local dof array."""
    f = system.structure.k.q.copy()
    f.x.array[:] = 0.0
    f.x.array[: len(owned)] = owned
    f.x.scatter_forward()
    return np.asarray(f.x.array)
