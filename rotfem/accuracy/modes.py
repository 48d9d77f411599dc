"""Answers that are modes at one speed: their eigenvalues, paired by their shapes, and bounds of round-off."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.accuracy.answer import Answer, Answers, Setting
from rotfem.accuracy.errors import Errors, estimate
from rotfem.accuracy.outputs import chords, lines
from rotfem.analysis.modal import ModalAnalysis, Spinning
from rotfem.numerics.newton import Newton
from rotfem.results.distance import Spectrum, sizes
from rotfem.scene import Scene

Array = npt.NDArray[Any]

#: Modes beyond those wanted, as their order may differ between meshes.
SPARE = 4

#: Places along a structure and across it at which shapes are sampled, to be compared.
ALONG, ACROSS = 33, 9


@dataclass(frozen=True)
class Modes:
    """An outcome that is the modes at one speed.

    Attributes:
        analysis: of them.
        spinning: equilibrium and eigenpairs.
        count: number of pairs that count; the others are there to be paired with.
    """

    analysis: ModalAnalysis
    spinning: Spinning
    count: int
    steps: int = 0
    stable: bool | None = None

    @cached_property
    def output(self) -> Spectrum:
        """Eigenvalues and shapes."""
        return Spectrum(self.spinning.pairs.resolved, sampled(self.analysis, self.spinning.right), self.count)

    @property
    def round_off(self) -> float:
        """Bound of the error of the eigenvalues by round-off."""
        pairs = self.spinning.pairs
        return round_off(pairs.values[: self.count], pairs.bounds[: self.count])

    @property
    def lines(self) -> list[Array]:
        """Coordinates (m) of the vertices along each axis."""
        return lines(self.analysis.system)

    @property
    def chords(self) -> float:
        """Error by straight edges along curves."""
        return chords(self.analysis.system)

    def result(self) -> Modes:
        """Return this, of which the commands make their results."""
        return self


def sampled(analysis: ModalAnalysis, vectors: Array) -> Array:
    """Return eigenvectors at places that are the same on every mesh, (modes, samples); nan outside of it."""
    columns = [analysis.structure.nodes(x) for x in vectors.T]
    coordinates = np.column_stack(list(columns[0][0].values()))
    values = np.hstack([q for _, q in columns])
    low, high = coordinates.min(axis=0), coordinates.max(axis=0)
    if coordinates.shape[1] == 1:
        at = np.linspace(low[0], high[0], ALONG)
        there = np.array([np.interp(at, coordinates[:, 0], column) for column in values.T])
    else:
        from scipy.interpolate import LinearNDInterpolator

        x, y = (np.linspace(a, b, n) for a, b, n in zip(low, high, (ALONG, ACROSS), strict=True))
        there = (
            LinearNDInterpolator(coordinates, values, rescale=True)(*np.meshgrid(x, y)).reshape(-1, values.shape[1]).T
        )
    lever = np.tile(analysis.structure.lever, vectors.shape[1])
    return np.asarray((there * lever[:, None]).reshape(vectors.shape[1], -1))


def round_off(values: Array, bounds: Array) -> float:
    """Return the largest bound of the errors of eigenvalues by round-off, relative to each."""
    if not len(values):
        return 0.0
    with np.errstate(over="ignore"):  # none of them is resolved
        of_others = np.abs(bounds * values) / sizes(np.where(np.abs(bounds) < 1.0, values, 0.0))
    return float(np.minimum(np.abs(bounds), of_others).max())


def modal_answers(
    scene: Scene,
    analysis: ModalAnalysis,
    speed: float,
    compiled: dict[str, ModalAnalysis] | None = None,
) -> Answers:
    """Return the answers that are the modes of a scene at a speed (rad/s).

    Args:
        scene: whose mesh and theory are varied.
        analysis: of its own modes, with terms and all that a script adds.
        speed: Ω.
        compiled: mesh and theory ↦ analysis, kept for other speeds; None to keep none.
    """
    count = scene.modes.count

    def compute(variant: Scene, times: Array | None) -> Modes:
        key = repr((variant.mesh, variant.model.theory))
        there = None if compiled is None else compiled.get(key)
        if there is None:
            problem = analysis.problem.replace(mesh=variant.mesh, theory=variant.model.theory, outputs={})
            newton = Newton(analysis.newton.tolerance, analysis.newton.max_iterations)
            there = ModalAnalysis(problem, analysis.about, newton, analysis.comm)
            there.everyone = analysis.everyone
        if compiled is not None:
            compiled[key] = there
        most = there.structure.free_unknowns() + int(there.free)
        if "count" in scene.modes.model_fields_set:
            there.check_count(count)
        found = there.at(speed, min(count + SPARE, most))
        return Modes(there, found, count - int(found.rigid))

    return Answers(scene, compute, moving=False)


def modal_errors(
    scene: Scene,
    analysis: ModalAnalysis,
    spinning: Spinning,
    seconds: float = 0.0,
    compiled: dict[str, ModalAnalysis] | None = None,
) -> Errors:
    """Return the error of modes at one speed; `each` is that of every pair by the mesh.

    Args:
        scene: of the modes.
        analysis: of it.
        spinning: the modes.
        seconds: CPU time that they took, s; 0 if that is not known.
        compiled: other analyses, kept for other speeds (see `modal_answers`).
    """
    own = Modes(analysis, spinning, len(spinning.pairs.values))
    setting = Setting.of(scene, moving=False)
    degree = analysis.system.V.element.basix_element.degree  # a default differs by cell
    answer = Answer(replace(setting, degree=degree), own, seconds)
    return estimate(modal_answers(scene, analysis, spinning.speed, compiled=compiled), answer)
