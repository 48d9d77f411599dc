"""What the stiffness of a linear theory is made of: strains, prestress, and effects.

The pieces say what they are of (see `rotfem.equations.pieces`), so that a part can be taken by itself, or weighed.
"""

from __future__ import annotations

from abc import ABC
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.equations.pieces import PRESTRESS, Piece, Pieces
from rotfem.equations.system import System
from rotfem.mechanics.effects import INTERNAL
from rotfem.mechanics.theories import Theory
from rotfem.numerics.linear import DirectSolver, Increment, combine

Array = npt.NDArray[np.float64]


class AffineStiffness(System, ABC):
    """The parts of the stiffness of a system of pieces (see `rotfem.equations.affine.AffineSystem`)."""

    pieces: list[Piece]
    _decomposed: Pieces
    _increment: Increment | None
    _weights: Array
    _coefficients: Array | None
    _load: Any

    @property
    def prestressing(self) -> Any:
        """The function that N⁰ of the form G is of: the displacement under the loads, by the material alone."""
        return self._decomposed.prestressed

    @contextmanager
    def of_material(self) -> Iterator[None]:
        """Let the form K be that of the strains alone."""
        switches = self.model.switches
        values = {name: float(switch.value) for name, switch in switches.items()}
        for name, switch in switches.items():
            switch.value = float(name == INTERNAL.name)
        try:
            yield
        finally:
            for name, switch in switches.items():
                switch.value = values[name]

    def displaced(self) -> Array:
        """Return the displacement (local dof array) of the structure at rest under the loads at the time set."""
        if self._increment is None:
            self._increment = Increment(self.V)
        return -self._increment.solve(self.material_solver, self._load)

    def scale_stiffness(self, strains: float, prestress: float) -> None:
        """Multiply the stiffness of the strains and the geometric one by factors, until effects are switched."""
        of = [strains if p.kind == "K" and INTERNAL.name in p.of else 1.0 for p in self.pieces]
        self._weights *= [prestress if PRESTRESS in p.of else f for f, p in zip(of, self.pieces, strict=True)]
        self._coefficients = None

    @property
    def material(self) -> Any:
        """Stiffness of the strains alone, clamped rows 1."""
        return self._decomposed.material

    @property
    def material_solver(self) -> DirectSolver:
        """Solver of the `material`."""
        return self._decomposed.material_solver

    @property
    def only_strains(self) -> bool:
        """Whether the stiffness at rest is that of the strains alone, and regular."""
        at_rest = [p for p in self.pieces if p.kind == "K" and not p.key and PRESTRESS not in p.of]
        return not self.structure.hinges and all(INTERNAL.name in p.of for p in at_rest)

    def geometric(self, u: Any, w: Any, base: Any, theory: Theory | None = None) -> Any:
        """Return ∫ N⁰ D²Γ₁[u, w], a UFL form (see `Pieces.geometric`)."""
        return self._decomposed.geometric(u, w, base, theory)

    def matrices_at_rest(self) -> tuple[Any, Any]:
        """Return (M, K) of the undeformed structure at rest without spin and loads (see `System`)."""
        out = []
        for kind in "MK":
            A = self.A.duplicate()
            chosen = [p.operator for p in self.pieces if p.kind == kind and not p.key and PRESTRESS not in p.of]
            combine(A, chosen, np.ones(len(chosen)))
            out.append(A)
        return out[0], out[1]

    @property
    def prestressed(self) -> bool:
        """Whether there is geometric stiffness at the time set."""
        weights = self._coefficients if self._coefficients is not None else np.zeros(len(self.pieces))
        return any(PRESTRESS in p.of and value != 0.0 for p, value in zip(self.pieces, weights, strict=True))

    def add_other_stiffness(self, A: Any) -> None:
        """Add to a matrix the stiffness at the time set that is not that of the strains: of effects and prestress."""
        assert self._coefficients is not None
        for p, value in zip(self.pieces, self._coefficients, strict=True):
            if p.kind == "K" and value != 0.0 and (INTERNAL.name not in p.of or PRESTRESS in p.of):
                A.axpy(value, p.operator)

    def stiffness_pieces(self) -> tuple[Any, Any]:
        """Return (K_1, K_2) of K = K_1 + Omega² K_2 without base acceleration and loads; clamped rows 1 and 0."""
        axis = self._decomposed.axis
        parts = (self.A.duplicate(), self.A.duplicate())
        for part, size in zip(parts, (0, 2), strict=True):
            chosen = [p for p in self.pieces if p.kind == "K" and len(p.key) == size]
            weights = [np.prod([axis[i] for _, i in p.key]) if p.key else 1.0 for p in chosen]
            combine(part, [p.operator for p in chosen], np.array(weights))
        return parts
