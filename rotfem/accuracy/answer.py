"""A computed answer of a scene, its setting, and the distance of two answers (`rotfem.results.distance`)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Protocol, Self

import numpy.typing as npt

from rotfem import registry
from rotfem.errors import ComputationError, InputError
from rotfem.listeners import Compiling, cpu_time
from rotfem.results.distance import Distance, Series
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
        looser: how many times as large Newton's last increment may be as that of the scene; None for once.
    """

    theory: str
    elements: Elements
    degree: int
    scheme: str | None = None
    tolerance: float | None = None
    step: float | None = None
    max_step: float | None = None
    effects: tuple[str, ...] | None = None
    looser: float | None = None

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

    @property
    def work(self) -> float:
        """Number of nodes times the number of steps, up to a factor."""
        cells, steps = self.elements or (1, 1), 1.0
        if self.step is not None:
            steps = 1.0 / self.step
        elif self.tolerance is not None:
            steps = self.tolerance ** (-1.0 / registry.schemes[str(self.scheme)].order)
        return steps * (math.prod(n * self.degree for n in cells) if isinstance(cells, tuple) else cells * self.degree)

    def changes(self, scene: Scene) -> dict[str, Any]:
        """Return the keys ↦ values of a scene with this setting and without an accuracy; None removes a key."""
        out: dict[str, Any] = {"model.theory": self.theory, "mesh.degree": self.degree}
        out |= dict.fromkeys(("accuracy", "accuracy_budget"))
        if scene.model.prestress is not None and not registry.theories[self.theory].prestress:
            out |= {"model.prestress": None}
        if self.effects is not None:
            out["model.effects"] = list(self.effects)
        if self.elements is not None:
            out["mesh.elements"] = list(self.elements) if isinstance(self.elements, tuple) else self.elements
        if self.looser is not None:
            out["solver.increment_tolerance"] = self.looser * scene.solver.increment_tolerance
        time = scene.time
        if time is not None and self.moving:
            if self.scheme != time.scheme:
                out |= {f"time.{name}": None for name in time.parameters}
            if self.step != time.step:  # numbers of steps are those of others
                out |= {"time.output_every": None}
            if self.tolerance is None:
                out |= {"time.min_step": None}
            out |= {f"time.{name}": getattr(self, name) for name in ("scheme", "tolerance", "step", "max_step")}
        elif time is not None:  # its tolerance may be that of the accuracy
            out |= {"time.tolerance": time.tolerance}
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


# --- answers ----------------------------------------------------------------------------------------------------------


class Outcome(Protocol):
    """What a computation of a scene gives: the output at once, the whole result when it is wanted."""

    @property
    def output(self) -> Any:
        """What is compared, a `Series` or a `Spectrum`."""

    @property
    def steps(self) -> int:
        """Number of steps that were taken, parts of steps counted each; 0 of what has no steps."""

    @property
    def stable(self) -> bool | None:
        """Whether an equilibrium is stable; None where that is not asked."""

    @property
    def lines(self) -> list[Array]:
        """Coordinates (m) of all vertices of the mesh along each axis."""

    @property
    def chords(self) -> float:
        """Error by straight edges along curves, relative; 0 without (see `rotfem.accuracy.outputs`)."""

    @property
    def round_off(self) -> float | None:
        """Bound of the error by round-off, relative; None where none is known."""

    def result(self) -> Any:
        """Return the whole result."""


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

    def predicted(self, setting: Setting) -> float:
        """Return the CPU time of an answer with another setting, s, by its steps and unknowns."""
        return self.seconds * setting.work / self.setting.work


class Answers:
    """The answers of a scene, each computed once and kept by its setting.

    All histories have the rows of the first one.

    Args:
        scene: validated; an accuracy that it asks for is no part of its answers.
        compute: variant of the scene ↦ outcome.
        moving: whether histories are computed, if the scene has [time].

    Attributes:
        times: rows (s) of all histories; None before the first, and of what has none.
        neglected: contribution ↦ error that all answers have beside those of their settings.
    """

    def __init__(self, scene: Scene, compute: Compute, moving: bool = True):
        self.neglected: dict[str, float] = {}
        self.scene, self._compute, self.moving = scene, compute, moving and scene.time is not None
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
        return self.scene.replace({**setting.changes(self.scene), "output.error": False})

    def keep(self, answer: Answer) -> None:
        """Keep an answer that was computed elsewhere; histories have its rows."""
        self._found[answer.setting] = answer
        if isinstance(answer.output, Series):
            self.times = answer.output.times


def distance(one: Answer, other: Answer) -> Distance:
    """Return how far an answer is from another one, relative to the first."""
    found: Distance = one.output.apart(other.output)
    return found
