"""Derivatives dλ/dp of eigenvalues to section properties, hub radius, tip mass and speed.

With Q(λ; p) = λ² M + λ C + K about the equilibrium q̄(p), and left and right vectors of λ at p,

    dλ/dp = − y^H Q_p x / [ y^H (2λ M + C) x ],     Q_p = dQ(λ; q̄(p), p)/dp

(Adhikari & Friswell 2001). Of an eigenvalue that several modes share, the derivatives are the eigenvalues of the matrix
of these numbers for each two of them (Tisseur 2000, section 2.2). Q_p is the central difference of fourth order, of
matrices assembled anew, each about its own equilibrium. Matrices are polynomials of most parameters, of a degree at
which it is exact.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from scipy.optimize import linear_sum_assignment

from rotfem.analysis.modal import ModalAnalysis, Spinning
from rotfem.equations.affine import AffineSystem
from rotfem.equations.modal_damping import DAMPING_KEY
from rotfem.errors import InputError
from rotfem.numerics.eigenproblem import repeated
from rotfem.numerics.projection import summed

Array = npt.NDArray[Any]

#: Steps relative to the parameter, and the weights of the central difference of fourth order (Abramowitz & Stegun
#: 1964, table 25.2), which leaves some 1e-8 of the derivative as round-off does.
DIFFERENCE_STEPS = 1e-2 * np.array([-2.0, -1.0, 1.0, 2.0])
WEIGHTS = np.array([1.0, -8.0, 8.0, -1.0]) / 12e-2


class Parameter(NamedTuple):
    """A quantity of the scene.

    Attributes:
        name: "EI", "hub_radius", "speed", …
        value: its value; a tapered property counts as 1 and its derivative is that of a common factor.
        numbers: those in the forms that are changed; None for the speed.
    """

    name: str
    value: float
    numbers: Any = None


def parameters(analysis: ModalAnalysis, speed: float) -> list[Parameter]:
    """Return the parameters of a scene that its forms contain, at a speed (rad/s)."""
    structure, out = analysis.structure, list[Parameter]()
    for name, symbol in (structure.section | structure.scalars).items():
        uniform = isinstance(symbol, fem.Constant)
        out.append(
            Parameter(name, float(symbol.value) if uniform else 1.0, symbol.value if uniform else symbol.x.array)
        )
    return [*out, Parameter("speed", speed)] if "w" in analysis.model.frame.constants else out


def products(analysis: ModalAnalysis, spinning: Spinning, speed: float) -> Array:
    """Return y_i^H Q(λ_j) x_j, (m, m), with the parameters that are set, about the equilibrium at a speed (rad/s)."""
    system, pencil, pairs = analysis.system, spinning.pencil, spinning.pairs
    if system.linear:
        system = AffineSystem(analysis.model, False)
        system.set_time(0.0, system.motion.at_speed(speed))
    else:
        analysis.equilibrium(speed, spinning)
    M, C, K = (pencil.apply(A, pairs.right) for A in system.mass_damping_stiffness(True))
    Qx = pairs.values**2 * M + pairs.values * C + K
    return np.asarray(summed(analysis.comm, pairs.left.conj().T @ Qx))


def derivatives(analysis: ModalAnalysis, spinning: Spinning, p: Parameter) -> Array:
    """Return dλ/dp of every pair, per unit of p."""
    unit, own, pairs = p.value or 1.0, np.array(p.numbers), spinning.pairs
    total: Any = 0.0
    for step, weight in zip(DIFFERENCE_STEPS, WEIGHTS, strict=True):
        if p.numbers is None:
            total = total - weight / unit * products(analysis, spinning, spinning.speed + step * unit)
            continue
        try:
            p.numbers[...] = own * (1.0 + step) if p.value else step
            total = total - weight / unit * products(analysis, spinning, spinning.speed)
        finally:
            p.numbers[...] = own
    out: Array = np.diag(total) / np.diag(spinning.own)
    for group in (np.array(g) for g in repeated(pairs.values, pairs.bounds) if len(g) > 1):
        each = np.ix_(group, group)
        slopes, mixed = np.linalg.eig(np.linalg.solve(spinning.own[each], total[each]))
        _, order = linear_sum_assignment(-np.abs(mixed))  # of the mode that is most of it
        out[group] = slopes[order]
    return out


def sensitivities(analysis: ModalAnalysis, spinning: Spinning) -> list[dict[str, Any]]:
    """Return one row a mode and parameter: dω/dp, dσ/dp (λ = σ + iω) and the relative p/ω dω/dp.

    Rows hold `mode` (from 1), `parameter`, `value`, `dfrequency` (rad/s per unit), `dgrowth` (1/s per unit) and
    `relative`.
    """
    analysis.needs_fixed_hub("sensitivities")
    if analysis.system.by_mode is not None:
        damping = analysis.problem.structure.damping.modal
        raise InputError(
            DAMPING_KEY, damping, "sensitivities need damping whose derivatives are known; leave it out for them"
        )
    known = [(p, derivatives(analysis, spinning, p)) for p in parameters(analysis, spinning.speed)]
    analysis.equilibrium(spinning.speed, spinning)
    rows = []
    for j, omega in enumerate(spinning.pairs.values.imag.tolist()):
        for p, slopes in known:
            rows.append(
                {
                    "mode": j + 1,
                    "parameter": p.name,
                    "value": p.value,
                    "dfrequency": float(slopes[j].imag),
                    "dgrowth": float(slopes[j].real),
                    "relative": float(p.value * slopes[j].imag / omega) if omega > 0 else 0.0,
                }
            )
    return rows
