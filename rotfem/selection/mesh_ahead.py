"""How fine a mesh has to be for an accuracy, from a reduced answer: what it puts the frequencies off that move the tip.

The modes of a reduced model at its start are shapes of the structure, whose errors by the mesh are told from themselves
(`rotfem.analysis.shape_error`). With n elements for each they fall as n^{−2k} with the degree k. A line of the spectrum
has the error of the mode at its frequency: what stretches is followed by far coarser meshes than what bends as fast.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.reduced.response import Response
from rotfem.analysis.shape_error import ShapeError
from rotfem.selection.spectrum import UNKNOWN, Vibrating
from rotfem.selection.steps_ahead import Motion

Array = npt.NDArray[np.float64]

#: Elements along the longer edge that a mesh of a plate keeps at least, where it becomes coarser, and what one of a
#: beam may become, which costs little as it is.
FEWEST, COARSER = 4, 0.6

#: Modes whose errors are told, smallest error of one, and growths of the number of elements that are tried.
MODES, LEAST, GROWTHS = 12, 1e-14, np.append(np.arange(0.15, 0.96, 0.05), np.geomspace(1.0, 8.0, 25))

#: Instants at which the lowest frequency and the least damping are looked for.
LOOKS = 17


@dataclass
class ModeShapes:
    """Modes in the locally owned unknowns, (n, r), the forces of their masses, and the communicator."""

    V: Array
    massed: Array
    comm: Any


@dataclass(frozen=True)
class MeshAhead:
    """What a mesh puts frequencies off.

    Attributes:
        omega: frequencies, increasing, rad/s, (n,).
        off: their relative errors, (n,).
        stretches: which modes stretch rather than bend, (n,).
        elements: number of elements, (nx, ny) of a plate.
        degree: of the elements.
        structure: what is known of its vibrations in the whole history.
    """

    omega: Array
    off: Array
    stretches: npt.NDArray[np.bool_]
    elements: int | tuple[int, int]
    degree: int
    structure: Vibrating = UNKNOWN

    @classmethod
    def of(cls, response: Response, elements: int | tuple[int, int], degree: int) -> MeshAhead | None:
        """Return what the mesh of a response does; None where it has no vibrations."""
        model, shapes = response.model, ShapeError(response.model.system)
        if model.size == 0:
            return None
        c = response.factors()[:1]
        M, _, K, _ = (x[0] for x in model.operators(c))
        squares, modes = np.linalg.eig(np.linalg.solve(M, K))
        chosen = np.argsort(squares.real)[:MODES]
        chosen = chosen[squares.real[chosen] > 0.0]
        if not len(chosen):
            return None
        X = modes[:, chosen].real
        found = ModeShapes(model.V[model.owned] @ X, model.forces("M", c[0]) @ X, model.comm)
        off = np.maximum(LEAST, shapes.of_modes(found))
        omega = np.sqrt(squares.real[chosen])
        return cls(omega, off, ~shapes.bend(found), elements, degree, vibrating(response))

    @property
    def stretching(self) -> float:
        """Frequency of the lowest mode that stretches, rad/s; infinite where there is none among those known."""
        return float(self.omega[self.stretches].min(initial=np.inf))

    def growth(self, motions: Sequence[Motion], allowed: float) -> tuple[float, float]:
        """Return how many times more elements are expected to keep to an error, and what they leave.

        Args:
            motions: of the tip, whose most demanding one counts.
            allowed: relative error.
        """
        left = np.inf
        coarsest = min(1.0, FEWEST / max(self.elements)) if isinstance(self.elements, tuple) else COARSER
        for growth in (g for g in GROWTHS if g >= coarsest):
            left = max((self.error(motion, growth) for motion in motions), default=0.0)
            if left <= allowed:
                break
        return float(growth), left

    def error(self, motion: Motion, growth: float = 1.0) -> float:
        """Return the relative error that so many times more elements leave of a motion of the tip."""
        omega = motion.whole.omega
        slope = np.log(np.maximum(omega, self.omega[0]) / self.omega[-1])
        inside = np.exp(np.interp(np.log(np.maximum(omega, self.omega[0])), np.log(self.omega), np.log(self.off)))
        beyond = self.off[-1] * np.exp(self.degree * np.maximum(slope, 0.0))
        off = np.minimum(1.0, np.where(omega > self.omega[-1], beyond, inside) / growth ** (2 * self.degree))
        return motion.whole.error_of_mesh(off)


def vibrating(response: Response) -> Vibrating:
    """Return the lowest frequency and the damping of a reduced model in its history; 0 where it has none."""
    c, m = response.factors(), response.model.size
    M, C, K, _ = response.model.operators(c[np.unique(np.linspace(0, len(c) - 1, LOOKS).astype(int))])
    rates = np.zeros((len(M), 2 * m, 2 * m))
    rates[:, :m, m:] = np.eye(m)
    rates[:, m:, :m], rates[:, m:, m:] = -np.linalg.solve(M, K), -np.linalg.solve(M, C)
    squares, values = np.linalg.eigvals(-rates[:, m:, :m]), np.linalg.eigvals(rates)
    # of those that do not vibrate the one that fades least comes last
    ordered = [v[np.lexsort((v.real, np.abs(v.imag)))] for v in values]
    known = tuple((np.abs(v.imag), np.maximum(0.0, -v.real)) for v in ordered)
    lowest, fading = float(np.sqrt(max(0.0, squares.real.min()))), max(0.0, -float(values.real.max()))
    return Vibrating(lowest, fading, known, float(response.model.system.structure.length))
