"""A computed answer, its setting, and the distance of two answers.

    distance(a, b) = max |u_a − u_b| / max |u_a|,

over all rows of a history, with u the displacement of the tip or the moment at the root; over all eigenvalues of modes
it is the largest |λ_a − λ_b| / |λ_a|. Errors, refinement, the effects that a scene calls for and the cost of accuracy
are all made of this.

The tip is a section, whose points are displaced by u + θ × d, d their distance from its axis. With d a radius of
gyration r the output is (u, r θ): a rotation counts by what it displaces.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Protocol, Self

import numpy as np
import numpy.typing as npt

from rotfem.errors import ComputationError, InputError
from rotfem.listeners import Compiling, cpu_time
from rotfem.results.result import Result
from rotfem.scene import Scene

Array = npt.NDArray[Any]
Elements = int | tuple[int, int] | None


@dataclass(frozen=True)
class Setting:
    """How an answer is computed.

    Attributes:
        theory: name.
        elements: number of elements, (nx, ny) of a plate; None of a mesh file.
        degree: their polynomial degree.
        scheme: of the steps of a history; None without one.
        tolerance: of adaptive steps; None without.
        step: of fixed steps, s; None without.
        max_step: longest adaptive step, s; None for that of the scheme.
        effects: names; None for those of the scene.
    """

    theory: str
    elements: Elements
    degree: int
    scheme: str | None = None
    tolerance: float | None = None
    step: float | None = None
    max_step: float | None = None
    effects: tuple[str, ...] | None = None

    @classmethod
    def of(cls, scene: Scene, moving: bool = True) -> Self:
        """Return the setting that a scene says.

        Args:
            scene: validated.
            moving: whether its history is computed, if it has [time].
        """
        mesh, time = scene.mesh, scene.time if moving else None
        elements = None if scene.structure.mesh_file is not None else mesh.elements
        steps = {} if time is None else {k: getattr(time, k) for k in ("scheme", "tolerance", "step", "max_step")}
        return cls(scene.model.theory, elements, mesh.degree, **steps)

    @property
    def moving(self) -> bool:
        """Whether it is that of a history."""
        return self.scheme is not None

    def changes(self) -> dict[str, Any]:
        """Return the scene's keys ↦ values of this setting; None removes what the scene says."""
        out: dict[str, Any] = {"model.theory": self.theory, "mesh.degree": self.degree}
        if self.effects is not None:
            out["model.effects"] = list(self.effects)
        if self.elements is not None:
            out["mesh.elements"] = list(self.elements) if isinstance(self.elements, tuple) else self.elements
        if self.moving:
            out |= {f"time.{name}": getattr(self, name) for name in ("scheme", "tolerance", "step", "max_step")}
        return out

    def summary(self) -> dict[str, Any]:
        """Return what of it is not None."""
        return {key: value for key, value in asdict(self).items() if value is not None}

    @classmethod
    def read(cls, summary: Mapping[str, Any]) -> Self:
        """Return the setting of a `summary`, as JSON has it."""
        lists = {key: tuple(value) for key, value in summary.items() if isinstance(value, list)}
        return cls(**{**summary, **lists})

    def words(self) -> str:
        """Return it in words."""
        length, cells = "", f"degree {self.degree}"
        if self.moving:
            length = (
                f", {self.scheme} to {self.tolerance:.2g}" if self.step is None else f", steps of {self.step:.3g} s"
            )
        if self.elements is not None:
            number = "×".join(map(str, self.elements if isinstance(self.elements, tuple) else [self.elements]))
            cells = f"{number} elements of {cells}"
        return f"{self.theory}, {cells}{length}"


# --- outputs and their distance -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Distance:
    """How far an answer is from another one.

    Attributes:
        size: largest difference, relative to the largest value (of eigenvalues, to each); infinite if that is 0.
        at: time of the largest difference, s; None of what has no time.
        each: of every component, or of every eigenvalue, relative to its own size.
    """

    size: float
    at: float | None = None
    each: Array = field(default_factory=lambda: np.empty(0))


class Output(Protocol):
    """What is compared of an answer."""

    def apart(self, other: Any) -> Distance:
        """Return how far another output of this kind is from this one, relative to this one."""
        ...


@dataclass(frozen=True)
class Series:
    """An output over time, or of a steady state.

    Attributes:
        times: (n,) s.
        values: (n, components), m or N·m.
    """

    times: Array
    values: Array

    @property
    def scale(self) -> float:
        """Largest value over all rows."""
        return float(np.linalg.norm(self.values, axis=-1).max(initial=0.0))

    def difference(self, other: Series) -> Series:
        """Return other − self at the rows of the one that has fewer; the other one is put there by a cubic spline."""
        if np.array_equal(self.times, other.times):
            return Series(self.times, other.values - self.values)
        from scipy.interpolate import CubicSpline  # here, as its import takes longer than many a run

        few, many, sign = (self, other, 1) if len(self.times) <= len(other.times) else (other, self, -1)
        inside = (few.times >= many.times[0]) & (few.times <= many.times[-1])
        there = CubicSpline(many.times, many.values)(few.times[inside])
        return Series(few.times[inside], sign * (there - few.values[inside]))

    def apart(self, other: Series) -> Distance:
        """Return how far another one is from this one."""
        change = self.difference(other)
        off = np.linalg.norm(change.values, axis=-1)
        largest = float(off.max(initial=0.0)) if np.all(np.isfinite(off)) else np.inf
        sizes = np.abs(self.values).max(axis=0, initial=0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            each = np.nan_to_num(np.abs(change.values).max(axis=0, initial=0.0) / sizes, nan=0.0, posinf=np.inf)
        return Distance(relative(largest, self.scale), float(change.times[np.argmax(off)]) if len(off) else None, each)


@dataclass(frozen=True)
class Spectrum:
    """Eigenvalues, with the shapes of their modes.

    Attributes:
        values: λ, (modes,), rad/s; 0 of what is zero to round-off.
        shapes: sampled at the same places on every mesh, complex, (modes, samples); None to pair them by their order.
    """

    values: Array
    shapes: Array | None = None

    @property
    def scale(self) -> float:
        """Largest |λ|, rad/s."""
        return float(np.abs(self.values).max(initial=0.0))

    def apart(self, other: Spectrum) -> Distance:
        """Return how far the most similar mode of another one is, of every mode, relative to its |λ|.

        Of an eigenvalue that is zero it is relative to the smallest other one.
        """
        own, there = self.values, other.values
        if len(own) == 0 or len(there) == 0:
            return Distance(0.0 if len(own) == 0 else np.inf)
        off = np.abs(there[None, :] - own[:, None])
        if self.shapes is None or other.shapes is None:
            off = off[:, : len(own)].diagonal() if len(there) >= len(own) else np.full(len(own), np.inf)
        else:
            here, others = (x / np.linalg.norm(x, axis=1, keepdims=True) for x in _common(self.shapes, other.shapes))
            alike = np.abs(here.conj() @ others.T)
            off = np.where(alike >= 0.9 * alike.max(axis=1, keepdims=True), off, np.inf).min(axis=1)
        each = off / sizes(own)
        return Distance(float(each.max()), each=each)


def _common(one: Array, other: Array) -> tuple[Array, Array]:
    """Return the samples that two sets of shapes both have."""
    there = ~(np.isnan(one[0]) | np.isnan(other[0]))
    return one[:, there], other[:, there]


def sizes(values: Array) -> Array:
    """Return |λ|, of a zero that of the smallest other one."""
    out = np.abs(values)
    out[out == 0.0] = out[out > 0.0].min(initial=np.inf)
    return out


def relative(difference: float, scale: float) -> float:
    """Return a difference over a scale; infinite where that is zero and the difference is not."""
    return 0.0 if difference == 0.0 else difference / scale if scale > 0.0 else np.inf


# --- answers ----------------------------------------------------------------------------------------------------------


class Outcome(Protocol):
    """What a computation of a scene gives: the output at once, the whole result when it is wanted."""

    @property
    def output(self) -> Any:
        """What is compared, an `Output`."""
        ...

    @property
    def steps(self) -> int:
        """Number of steps that were taken, parts of steps counted each; 0 of what has no steps."""
        ...

    def result(self) -> Any:
        """Return the whole result."""
        ...


#: Computes a variant of a scene. With times (s) it gives the output at these, else at the rows of the scene.
Compute = Callable[[Scene, Array | None], Outcome]


@dataclass(frozen=True)
class Answer:
    """What was computed with a setting.

    Attributes:
        setting: how.
        outcome: what came of it.
        seconds: CPU time, without compilation of forms, s.
    """

    setting: Setting
    outcome: Outcome
    seconds: float

    @property
    def output(self) -> Any:
        """What is compared of it."""
        return self.outcome.output

    def result(self) -> Result:
        """Return the whole result."""
        found: Result = self.outcome.result()
        return found


class Answers:
    """The answers of a scene, each computed once and kept by its setting.

    All histories have the rows of the first one.

    Args:
        scene: validated; an accuracy that it asks for is no part of its answers.
        compute: variant of the scene ↦ outcome.

    Attributes:
        times: rows (s) of all histories; None before the first, and of what has none.
    """

    def __init__(self, scene: Scene, compute: Compute):
        self.scene, self._compute = scene, compute
        self.times: Array | None = None
        self._found: dict[Setting, Answer | ComputationError | InputError] = {}

    def __call__(self, setting: Setting) -> Answer:
        """Return the answer with a setting.

        Raises:
            ComputationError: it failed, now or before.
            InputError: the scene cannot be computed with this setting.
        """
        found = self._found.get(setting)
        if found is None:
            started = cpu_time() - Compiling.seconds
            try:
                outcome = self._compute(self.variant(setting), self.times)
                found = Answer(setting, outcome, cpu_time() - Compiling.seconds - started)
                if self.times is None and isinstance(outcome.output, Series):
                    self.times = outcome.output.times
            except (ComputationError, InputError) as error:
                found = error
            self._found[setting] = found
        if not isinstance(found, Answer):
            raise found
        return found

    def variant(self, setting: Setting) -> Scene:
        """Return the scene with a setting, without an accuracy and without errors of its own."""
        changes: dict[str, Any] = dict.fromkeys(("accuracy", "accuracy_budget"))
        if (time := self.scene.time) is not None and setting.moving:
            if setting.scheme != time.scheme:
                changes |= {f"time.{name}": None for name in time.parameters}
            if setting.step != time.step:  # numbers of steps are those of others
                changes |= {"time.output_every": None}
            if setting.tolerance is None:
                changes |= {"time.min_step": None}
        return self.scene.replace({**changes, **setting.changes(), "output.error": False})

    @property
    def seconds(self) -> float:
        """CPU time of all answers together, s."""
        return sum(found.seconds for found in self._found.values() if isinstance(found, Answer))


def distance(one: Answer, other: Answer) -> Distance:
    """Return how far an answer is from another one, relative to the first."""
    found: Distance = one.output.apart(other.output)
    return found
