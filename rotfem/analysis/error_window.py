"""A stretch of a motion in a few shapes: its samples, and M, C, K of the tangent in its middle."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.error_bursts import turning_rates
from rotfem.analysis.error_recursion import Index
from rotfem.analysis.error_samples import Samples, middle
from rotfem.analysis.mesh_force import MeshForce
from rotfem.analysis.reduced_tangents import Tangents
from rotfem.analysis.refined_mesh import RefinedMesh
from rotfem.analysis.ritz_vectors import RitzVectors
from rotfem.analysis.shape_error import ShapeError

Array = npt.NDArray[np.float64]

#: Periods on either side over which a vibration is taken out, and how long that may be beside 1/ω of the slowest one.
PERIODS, SLOW = 2.0, 0.7

#: Part of a turn in a history by which the angle of a free hub is held, so that no eigenvalue is double.
HELD = 0.01

#: Factor of the squares of the LOWEST frequencies up to which a linear theory keeps the space of the shapes.
LIKE, LOWEST = 9.0, 3

#: Relative error of frequencies in theories of moderate rotations, in squares of the largest rotation: 0.13 to 0.32 in
#: free vibrations of beams and plates, less where it is the spin that stiffens.
MODERATE = 0.22

#: Part of the length up to which a motion is small: what it lacks beside errors of frequencies goes with its square.
SMALL = 0.06

#: Product of two shapes from which they are one, and a square of a frequency that is none, 1/s².
SAME, TINY = 0.5, 1e-300


@dataclass
class MeshErrors:
    """What is known of the errors that a mesh makes.

    Attributes:
        shape: of shapes, told from themselves.
        refined: by a finer mesh.
        force: what is missing of the forces on shapes in large motions; None of a linear theory.
    """

    shape: ShapeError
    refined: RefinedMesh
    force: MeshForce | None

    @staticmethod
    def of(system: Any) -> MeshErrors:
        """Return those of a system, in the frame that turns."""
        shape = ShapeError(system.held)
        force = None if system.held.linear or not shape.turns else MeshForce(system, shape)
        return MeshErrors(shape, RefinedMesh(system), force)


class Window:
    """A motion in the shapes that move the tip, c = Vᵀ M q; of a free hub with its angle as last coordinate.

    Args:
        system: equations of motion; time and state are set in it.
        mesh: errors of shapes, told from themselves and by a finer mesh.
        samples: the motion.
        end: length of the whole history, s.
        before: the window before; None for the first.

    Attributes:
        shapes: the shapes.
        t: times of the samples, s, (N,).
        motion: c, ċ, c̈ of the samples, (N, r) each.
        inner: c, ċ, c̈ at instants within steps; None without any.
        M: of the shapes, and of the angle of a free hub, (r, r).
        C, K: for c̈ + C ċ + K c, (r, r).
        speed: of the frame in the middle, rad/s.
        bends: which shapes bend, (r of the structure,).
        epsilon: relative errors of their frequencies by the mesh.
        theory: relative errors of the frequencies by the theory, of nonlinear ones that are not exact; else None,
            unless it is known to lack stiffness (`lacks`).
        missing: forces that the mesh leaves out in a large motion, (N, r of the structure); None where not known.
        rates: of rotation in the steps, rad/s, (n,), of a nonlinear theory (see `turning_rates`); else zeros.
        turn: Vᵀ M V_before, by which errors are handed on; None for the first.
    """

    def __init__(self, system: Any, mesh: MeshErrors, samples: Samples, end: float, before: Window | None):
        self.samples, self.free = samples, system.hub is not None
        self.turn: Array | None = None
        self.t = np.array([state[0] for state in samples.states])
        self.shapes: RitzVectors
        self.speed: float
        self.M: Array
        self.C: Array
        self.K: Array
        self.bends: npt.NDArray[np.bool_]
        self.epsilon: Array
        if before is not None and self._alike(system, before):
            for name in ("shapes", "speed", "M", "C", "K", "bends", "epsilon"):
                setattr(self, name, getattr(before, name))
            self.turn = np.eye(len(self.K))
        else:
            self._reduce(system, mesh, end, before)
        self.theory = self._errors_by_theory(system, mesh)
        self.missing = self._missing(system, mesh)
        self.rates: Array = np.zeros(len(samples.steps))
        if not system.held.linear:
            self.rates = turning_rates(system.held, samples, mesh.shape.turns)
        rates = (np.array([state[i] for state in samples.states]) for i in (2, 3))
        self.motion = tuple(self._coordinates(x) for x in (samples.displacements, *rates))
        self.inner = samples.within(self._coordinates)
        samples.forget()

    def _alike(self, system: Any, before: Window) -> bool:
        """Return whether the matrices are those of the window before: a linear theory at the same constant speed."""
        motion, t = system.motion, 0.5 * (self.t[0] + self.t[-1])
        if not system.held.linear or system.hub is not None or motion.pitch is not None:
            return False
        return bool(motion.rate(t) == 0.0 and abs(motion.speed(t)) == before.speed)

    def _reduce(self, system: Any, mesh: MeshErrors, end: float, before: Window | None) -> None:
        """Find shapes and matrices."""
        middle = self.samples.state(self.samples.middle[0]).q[: len(system.held.zeros())]
        along = mesh.shape.directions(middle)
        self.shapes, self.bends, tangents = self._tangents(system, mesh, along, before)
        self.speed = tangents.speed
        M, C, K = tangents.reduced(self.shapes)
        if self.free:
            K[-1, -1] += HELD * M[-1, -1] * (2 * np.pi / end) ** 2
        self.M = np.asarray(M, dtype=float)
        self.C, self.K = (np.asarray(np.linalg.solve(M, A), dtype=float) for A in (C, K))
        self.epsilon = self._errors_by_mesh(mesh, before)
        if before is not None:
            self.turn = self._turned(before.shapes)

    def _errors_by_mesh(self, mesh: MeshErrors, before: Window | None) -> Array:
        """Return the relative errors of the frequencies, those at rest, once and for all."""
        if before is not None and len(before.epsilon) == len(self.shapes.squares):
            return before.epsilon
        found = mesh.refined.of_frequencies(self.shapes, np.pi / self.step)
        return mesh.shape.of_modes(self.shapes) if found is None else found

    def _errors_by_theory(self, system: Any, mesh: MeshErrors) -> Array | None:
        """Return the relative errors of frequencies by the theory: rotations are in its strains to the second order.

        Of linear theories they are small: what they lack of bending and of inertia nearly cancels.
        """
        theory, size = system.held.model.theory, len(system.held.structure.unknowns)
        if theory.exact or theory.linear:
            return None
        n = len(system.held.zeros())
        turned = self.samples.displacements[:, :n].reshape(-1, size)[:, mesh.shape.turns]
        largest = float(np.abs(turned).max(initial=0.0))
        if system.comm.size > 1:
            largest = max(system.comm.allgather(largest))
        squares = np.abs(self.shapes.squares)
        return np.asarray(MODERATE * largest**2 * self.bends * squares / (squares + self.speed**2 + TINY))

    def lacks(self, stiffness: float) -> None:
        """Take into account which part of the stiffness of the lowest shape the theory lacks.

        What stress stiffens grows with the square of the wave number, what bending does with its fourth power.
        """
        omega = np.sqrt(np.abs(self.shapes.squares))
        self.theory = 0.5 * stiffness * self.bends * omega[:LOWEST].min() / np.maximum(omega, TINY)

    def _missing(self, system: Any, mesh: MeshErrors) -> Array | None:
        """Return the forces on shapes that bend which the mesh leaves out in a large motion; None where not known.

        Rotations have to be those of the motion, not counted from a state on the way.
        """
        states = self.samples.states
        if mesh.force is None or self.samples.size < SMALL * system.held.structure.length:
            return None
        if any(state[4] is not None for state in states):
            return None
        n = len(system.held.zeros())
        return mesh.force(self.samples.displacements[:, :n], self.shapes) * self.bends

    @cached_property
    def ends(self) -> tuple[Index, Index]:
        """Numbers of the samples that steps start and end with."""
        begin, end = np.array(self.samples.steps).T
        return begin, end

    @cached_property
    def lengths(self) -> Array:
        """Of the steps, s."""
        begin, end = self.ends
        return np.asarray(self.t[end] - self.t[begin])

    @cached_property
    def step(self) -> float:
        """Median of the lengths, s."""
        return middle(self.lengths)

    def _coordinates(self, arrays: Array) -> Array:
        """Return Vᵀ M x of local dof arrays (n, unknowns), (n, r); of a free hub with its angle."""
        out = self.shapes.sum(arrays[:, : len(self.shapes.V)] @ self.shapes.massed)
        return np.column_stack([out, arrays[:, -1]]) if self.free else out

    def _turned(self, before: RitzVectors) -> Array:
        """Return Vᵀ M V_before; where shapes have turned, rates of what is quick are none of what is slow."""
        turn = self.shapes.sum(self.shapes.V.T @ before.massed)
        octaves = np.subtract.outer(*(np.log2(np.maximum(np.abs(s.squares), TINY)) / 2 for s in (self.shapes, before)))
        turn[(np.abs(octaves) > 1.0) & (np.abs(turn) < SAME)] = 0.0
        if self.free:
            turn = np.block([[turn, np.zeros((len(turn), 1))], [np.zeros((1, turn.shape[1])), np.ones((1, 1))]])
        return np.asarray(turn)

    # --- the tangent -------------------------------------------------------------------------------------------------

    def _tangents(
        self, system: Any, mesh: MeshErrors, along: Array, before: Window | None
    ) -> tuple[RitzVectors, npt.NDArray[np.bool_], Tangents]:
        """Return shapes, which of them bend, and matrices in the middle of the window.

        Args:
            system: equations of motion.
            mesh: errors of shapes.
            along: directions of the structure in the middle.
            before: the window before.
        """
        number, h = self.samples.middle
        state = self.samples.state(number)
        tangents = Tangents(system, state)
        if system.held.linear:
            shapes = self._shapes_of_before(tangents, before) or tangents.shapes()
            return shapes, mesh.shape.bend(shapes, along), tangents
        shapes = tangents.shapes()
        bends = mesh.shape.bend(shapes, along)
        quick = self._vibrating(shapes, bends, number, h)
        if not np.any(quick):
            return shapes, bends, tangents
        q, v, a = (_without(x, moved) for x, moved in zip((state.q, state.v, state.a), quick, strict=True))
        # Vibrations change the stress, and hardly where masses are.
        tangents = Tangents(system, state.changed(q=q, v=v, a=a), tangents.matrices["M"])
        shapes.turn_to(tangents.matrices["K"])
        return shapes, mesh.shape.bend(shapes, along), tangents

    @staticmethod
    def _shapes_of_before(tangents: Tangents, before: Window | None) -> RitzVectors | None:
        """Return those of the window before, combined anew, where frequencies are much like those they were made at."""
        if before is None or not before.shapes.squares.size:
            return None
        shapes = before.shapes.turned_to(tangents.matrices["M"], tangents.matrices["K"], tangents.speed**2)
        ratio = np.abs(shapes.squares[:LOWEST]) / np.maximum(np.abs(shapes.made[:LOWEST]), TINY)
        return shapes if np.all((ratio <= LIKE) & (ratio >= 1.0 / LIKE)) else None

    def _vibrating(self, shapes: RitzVectors, bends: Any, number: int, h: float) -> Array:
        """Return q, v and a (owned) of quick vibrations in the state of a number, with steps of h (s) around it.

        Axial ones, and those that steps cannot sample, change the stress, and with it the frequencies of all others: in
        each step another way, and on the average not. They are c̈ = −ω² c about what balances the forces, as far as c̈
        is not a parabola over some of their periods (Savitzky & Golay 1964).
        """
        out: Array = np.zeros((3, shapes.V.shape[1]))
        omega: Array = np.sqrt(np.abs(shapes.squares))
        chosen = np.flatnonzero(~bends | (omega * h > np.pi))
        reach = {int(k): max(2, int(np.ceil(PERIODS * 2 * np.pi / (omega[k] * h)))) for k in chosen}
        smooth = self.samples.smooth(number)
        reach = {k: m for k, m in reach.items() if m * h <= SLOW / omega[0] and m <= smooth}
        if not reach:
            return np.asarray(out @ shapes.V.T)
        columns, most = shapes.massed[:, list(reach)], max(reach.values())
        around = self.samples.states[number - most : number + most + 1]
        moved = np.array([[v[: len(columns)], a[: len(columns)]] for _, _, v, a, _ in around]).swapaxes(0, 1)
        rates = shapes.sum(moved @ columns)
        for j, (k, m) in enumerate(reach.items()):
            weights = 3 * (3 * m * m + 3 * m - 1 - 5 * np.arange(-m, m + 1) ** 2) / ((4 * m * m - 1) * (2 * m + 3))
            out[1:, k] = rates[:, most, j] - rates[:, most - m : most + m + 1, j] @ weights
        out[0] = -out[2] / shapes.squares
        return np.asarray(out @ shapes.V.T)


def _without(x: Array, moved: Array) -> Array:
    """Return a local dof array less what its owned part has too much."""
    out = x.copy()
    out[: len(moved)] -= moved
    return out
