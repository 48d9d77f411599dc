"""Unbalance response of a shaft: its steady whirl over the speed, in the fixed frame.

At a speed Ω unbalances push with f̂ = Σ m e Ω² (e₂ − i e₃) e^{iβ} e^{iΩt}. What is left once all else has died out is

    u = (−Ω² M + iΩ C(Ω) + K(Ω))⁻¹ f̂,

one linear solution a speed, about the shaft at rest in its bearings. The point (y, z) of complex amplitudes moves on
an ellipse made of a forward circle r_f = ½(y + i z) and a backward one r_b = ½(ȳ + i z̄), with the semi-axes
|r_f| + |r_b| and |r_f| − |r_b| (Genta 2005, section 4.3).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rotfem.analysis.modal import ModalAnalysis
from rotfem.mechanics.unbalance import Unbalance
from rotfem.numerics.linear import ComplexSolver
from rotfem.structures.structure import PointValues

Complex = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class Orbits:
    """Ellipses of points, from complex amplitudes along directions 2 and 3, any shape (…).

    Attributes:
        y: amplitude along direction 2.
        z: amplitude along direction 3.
    """

    y: Complex
    z: Complex

    @property
    def forward(self) -> Complex:
        """r_f, the circle with the spin."""
        return np.asarray((self.y + 1j * self.z) / 2)

    @property
    def backward(self) -> Complex:
        """r_b, the circle against it."""
        return np.asarray((self.y.conj() + 1j * self.z.conj()) / 2)

    @property
    def major(self) -> npt.NDArray[np.float64]:
        """The larger semi-axis."""
        return np.asarray(np.abs(self.forward) + np.abs(self.backward))

    @property
    def minor(self) -> npt.NDArray[np.float64]:
        """The smaller semi-axis, negative of backward precession."""
        return np.asarray(np.abs(self.forward) - np.abs(self.backward))

    @property
    def angle(self) -> npt.NDArray[np.float64]:
        """Angle of the larger semi-axis from direction 2, rad."""
        return np.asarray((np.angle(self.forward) + np.angle(self.backward)) / 2)

    def along(self, angle: float) -> Complex:
        """Return the amplitude of the displacement in a direction (rad from direction 2 towards 3), as a probe has."""
        return np.asarray(self.y * np.cos(angle) + self.z * np.sin(angle))


class UnbalanceResponse:
    """Whirl at any speed.

    Args:
        analysis: compiled shaft in the fixed frame.
        found: its unbalances.
        further: further places, m.

    Attributes:
        x: nodes, m, increasing, (nodes,).
        supports: places of the supports, m.
        places: those of the unbalances, of the supports, and the further ones, m, increasing.
    """

    def __init__(self, analysis: ModalAnalysis, found: tuple[Unbalance, ...], further: Iterable[float] = ()):
        self._analysis, self._system = analysis, analysis.system
        structure, V = analysis.structure, analysis.system.V
        self._across = [list(structure.unknowns).index(name) for name in ("u2", "u3", "theta2", "theta3")]
        sense = float(np.sign(analysis.problem.motion.axis[0]))
        self._force = np.zeros(V.dofmap.index_map.size_local * V.dofmap.index_map_bs, dtype=np.complex128)
        for u in found:
            push = u.amplitude if sense > 0.0 else u.amplitude.conj()
            weights = PointValues(V, np.array([u.x, 0.0, 0.0])).columns(len(self._force))
            self._force += weights[:, self._across[:2]] @ push
        self._force[self._system.clamped] = 0.0
        self.supports = [support.x for support in structure.data.supports]
        self.places = sorted({*(u.x for u in found), *self.supports, *further})
        self._at = [PointValues(V, np.array([x, 0.0, 0.0])) for x in self.places]
        self.x = structure.nodes(self._system.zeros())[0]["x"]

    def at(self, speed: float) -> tuple[Complex, Complex, list[dict[str, complex]]]:
        """Return u₂, u₃ (m) at the nodes, (2, nodes), and at the places, and what supports carry.

        That is `f2`, `f3` (N) of each support, and `m2`, `m3` (N·m) of one with tilting coefficients.

        Args:
            speed: Ω, rad/s.
        """
        analysis, frame = self._analysis, self._system.model.frame
        analysis.equilibrium(speed)
        M, C, K = self._system.mass_damping_stiffness()
        solver = ComplexSolver((K, C, M))
        solver.factor((1.0, 1j * speed, -(speed**2)))
        u = solver.solve(np.asarray(self._force * speed**2, dtype=np.complex128))
        nodes = analysis.structure.nodes(u)[1][:, self._across[:2]].T
        there = np.array([point(u)[self._across[:2]] for point in self._at]).T
        forces = analysis.structure.support_forces(frame, speed, u, 1j * speed * u)
        carried: list[dict[str, complex]] = [{} for _ in self.supports]
        for name, (of_2, of_3) in forces.items():
            _, i, kind = name.split("_")
            carried[int(i)] |= {f"{kind}2": of_2, f"{kind}3": of_3}
        return nodes, there, carried
