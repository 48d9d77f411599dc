"""What a history starts with that does not start at rest: one of its modes, or velocities along a beam."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.modal import ModalAnalysis
from rotfem.errors import InputError

Array = npt.NDArray[np.float64]

#: Part of its largest displacement below which the tip does not take part in a mode.
STILL = 1e-6


@dataclass(frozen=True, kw_only=True)
class FirstMotion:
    """A mode that a structure is in at the start, or velocities; one of them is given.

    Attributes:
        mode: number of the mode about the state the history starts from, from 1; None of velocities.
        amplitude: largest displacement of the tip in it, m.
        phase: of the mode, rad: at 0 the tip is displaced, at π/2 it moves.
        velocity: rows (x, v1, v2, v3) of a beam's axis relative to the turning frame, m and m/s.
    """

    mode: int | None = None
    amplitude: float = 0.0
    phase: float = 0.0
    velocity: Sequence[Sequence[float]] | None = None

    def beside(self, q: Array | None, analysis: ModalAnalysis) -> tuple[Array | None, Array]:
        """Return (q, q̇) at t = 0, local dof arrays, beside the state that the history starts from.

        Args:
            q: that state; None where it is undeformed.
            analysis: of modes about it, or of nothing but its system where there are velocities.

        Raises:
            InputError: there is no such mode, or it does not move the tip.
            ComputationError: no equilibrium, or eigenpairs not to be trusted.
        """
        if self.velocity is not None:
            return q, of_velocities(analysis.system.held, self.velocity)
        shape, rates = self.of_mode(analysis)
        return (shape if q is None else q + shape), rates

    def of_mode(self, analysis: ModalAnalysis) -> tuple[Array, Array]:
        """Return displacements and velocities, Re(a x e^{iφ}) and Re(λ a x e^{iφ}), of the mode x.

        Its tip moves by one in the direction in which it moves most.

        Raises:
            InputError: there is no such mode, or it does not move the tip.
            ComputationError: no equilibrium, or eigenpairs not to be trusted.
        """
        number, system = self.mode or 1, analysis.system.held
        analysis.check_count(number)
        spinning = analysis.at(system.motion.speed(0.0), number)
        if len(spinning.pairs.values) < number:
            raise InputError("initial.mode", number, f"there are {len(spinning.pairs.values)} modes")
        structure, value = system.structure, spinning.pairs.values[number - 1]
        x = analysis.right(spinning)[:, number - 1]
        whole = np.zeros(len(system.zeros()), dtype=complex)
        whole[: len(x)] = x
        moves = [i for i, name in enumerate(structure.unknowns) if name.startswith("u")]
        tip = (structure.tip_values(whole.real) + 1j * structure.tip_values(whole.imag))[moves]
        largest = tip[np.argmax(np.abs(tip))]
        if abs(largest) <= STILL * system.size(np.abs(whole)) * structure.length:
            raise InputError("initial.mode", number, "does not move the tip, which initial.amplitude is of")
        turned = self.amplitude / largest * np.exp(1j * self.phase) * whole
        return turned.real.copy(), (value * turned).real.copy()


def of_velocities(system: Any, rows: Any) -> Array:
    """Return q̇ (local dof array) of a beam whose axis has the velocities of rows (x, v1, v2, v3), linear between.

    Its sections turn with the slope of the axis. What the clamp holds rests.
    """
    structure, table = system.structure, np.array(rows, dtype=float)
    x = structure.V.tabulate_dof_coordinates()[:, 0]
    out = np.zeros((len(x), structure.size))
    slopes = np.diff(table[:, 1:], axis=0) / np.diff(table[:, 0])[:, None]
    piece = np.clip(np.searchsorted(table[:, 0], x, side="right") - 1, 0, len(slopes) - 1)
    turns = {"alpha": (1, 1.0), "theta2": (2, -1.0), "theta3": (1, 1.0)}
    for column, name in zip(out.T, structure.unknowns, strict=True):
        if name.startswith("u"):
            column[:] = np.interp(x, table[:, 0], table[:, int(name[1])])
        elif name in turns:
            component, sign = turns[name]
            column[:] = sign * slopes[piece, component]
    rates: Array = out.ravel()
    rates[structure.clamped_unknowns(structure.clamped)] = 0.0
    return rates
