"""What the answers to a scene so far say of the next one: its steps, and what these put it off."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.reduced.manifold import Manifold
from rotfem.analysis.reduced.response import Response
from rotfem.analysis.reduced.struck import struck
from rotfem.analysis.reduced.tips import tips_of
from rotfem.analysis.schemes import Scheme
from rotfem.numerics.newton import SMALLEST
from rotfem.refinement.estimate import WORDS
from rotfem.results.run import RunResult
from rotfem.selection.accuracy import AIM, Elements, Settings, finer, finest, part, shares
from rotfem.selection.effects_ahead import effects_ahead
from rotfem.selection.mesh_ahead import MeshAhead
from rotfem.selection.spectrum import UNKNOWN, Vibrating
from rotfem.selection.steps_ahead import Motion, error_ahead, plan, unresolved_ahead

if TYPE_CHECKING:
    from rotfem.commands.simulation import Simulation

Array = npt.NDArray[np.float64]

#: Scheme of adaptive steps, and schemes whose fixed steps are chosen from.
ADAPTIVE, SCHEMES = "esdirk4", ("generalised_alpha", "esdirk4")

#: Instants at which a reduced answer is looked at.
LOOKS = 4096

#: Fewest times as long as those of a run that the steps of the one before must be for their difference to tell.
APART = 1.4

#: Newton's increments: as a part of an accuracy, for a displacement of a part of the length, and for so many steps.
NEWTON, SMALL, MANY = 1e-4, 1e-2, 2000

#: Part of the accuracy that increments of a stage may come to where a hub is free: one of d is d/h of a speed that
#: nothing brings back, n of them n²d at the end of n steps.
FREE = 0.3

#: By what the error of a reduced linear model as an answer is multiplied where a hub is free, of a beam on one that is
#: held, and of a plate, but for what the stretch makes of it, whose law is known: true ones have been up to eight, two
#: and 3.4 times the estimate.
TRUST, HELD, PLATES = 3.0, 2.0, 3.4

#: Part of the lowest frequency of what stretches from which a vibration may be one that stretches.
STRETCHING = 0.7

#: Error of a model from which its motion is another one, and the part of the accuracy that is aimed at then.
POOR, DOUBTED = 0.1, 0.5

#: How many times more steps that may take: more do where a vibration is resolved that could have been damped out.
DEAR = 2.0

#: Columns of the displacement of the tip.
TIPS = ("tip_u1", "tip_u2", "tip_u3")


class Ahead:
    """Knows the motions of the answers so far.

    Args:
        accuracy: that is wanted.
    """

    def __init__(self, accuracy: float):
        self.accuracy = accuracy
        self.linear: Motion | None = None
        self.own: Motion | None = None
        self.mesh: MeshAhead | None = None
        self.response: Response | None = None
        self.manifold: Manifold | None = None
        self.length, self.off, self.free, self.doubt = 1.0, np.inf, False, HELD
        self.stretching = 0.0
        self._last: tuple[Settings, RunResult] | None = None

    @property
    def motions(self) -> list[Motion]:
        """Motions that are known."""
        return [motion for motion in (self.linear, self.own) if motion is not None]

    def look(self, run: Simulation) -> None:
        """Take note of how the tip has moved in a run."""
        structure = run.system.structure
        self.length, self.free = float(structure.length), run.system.hub is not None
        self.doubt = TRUST if self.free else HELD
        if structure.mesh.topology.dim > 1:
            self.doubt = max(self.doubt, PLATES)
        if run.response is not None:
            mesh = run.scene.mesh
            self.response, self.mesh = run.response, MeshAhead.of(run.response, mesh.elements, mesh.degree)
            given = run.foreshortened
            self.manifold = None if given is None else given.manifold
            self.stretching = 0.0 if given is None or self.free else given.stretching
            self.linear = sampled(run.response, self._structure)
        elif run.track is not None and len((path := run.track.path())[0]) > 1:
            self.own = Motion.between(*path, self._structure)

    @property
    def _structure(self) -> Vibrating:
        """What is known of the vibrations of the structure."""
        return UNKNOWN if self.mesh is None else self.mesh.structure

    def judge(self, done: RunResult, settings: Settings) -> None:
        """Write into the error of a result what the spectra and the run before say of it.

        An estimate that follows an error through a nonlinear motion has to doubt its phases; a spectrum knows how much
        there is of each frequency, and of vibrations that stretch, whose phases are not followed, it alone does. A
        reduced answer has no other estimate of what its mesh has put off by the end than its spectrum.

        Args:
            done: the result.
            settings: that it was computed with.
        """
        error = done.summary["error"]
        if settings.models[0].get("reduced"):
            doubtful = max(0.0, part(error, "model") - self.stretching)
            put(error, "model", part(error, "model") + (self.doubt - 1) * doubtful)
            self.off = part(error, "model") if error["model"] is not None else np.inf
            if self.mesh is not None and self.linear is not None and self.linear.tells:
                put(error, "space", max(part(error, "space"), self.mesh.error(self.linear)))
        elif settings.step is not None and settings.scheme is not None:
            scheme = Scheme.registry[settings.scheme]
            if self.mesh is not None and error["time"] is not None:
                quick = error_ahead(self.motions, scheme, settings.step, STRETCHING * self.mesh.stretching)
                put(error, "time", error["time"] + (quick or 0.0))
            less(error, error_ahead(self.motions, scheme, settings.step))
        if self._last is not None:
            compare(done, settings, *self._last, self.motions)
        self._last = (settings, done)

    def prepared(self, settings: Settings, error: Mapping[str, Any]) -> Settings:
        """Return settings with the mesh and the steps that follow what is known of the motion.

        Args:
            settings: of the next model.
            error: of the result before it.
        """
        error = {**error, "time": 1.0, "model": 0.0}
        settings, off = self._grown(settings, error)
        error["space"] = max(part(error, "space"), off)
        # what is known by a poor model only may be less demanding than the motion is
        trusted = self.own is not None or self.off < POOR
        allowed = shares(error, self.accuracy, settings.plate)["time"]
        return self.stepped(settings, allowed if trusted or self._dear(allowed) else DOUBTED * allowed)

    def _dear(self, allowed: float) -> bool:
        """Return whether steps of DOUBTED of what is allowed are so many more that the others are tried first."""
        known = [scheme for scheme in Scheme.registry if scheme.name in SCHEMES]
        found, doubted = (plan(self.motions, part * allowed, known) for part in (1.0, DOUBTED))
        return found is not None and doubted is not None and doubted.work > DEAR * found.work

    def meshed(self, settings: Settings, error: Mapping[str, Any]) -> Settings:
        """Return settings of the model of before with at least the mesh that its motion needs, if the mesh is to grow.

        Args:
            settings: to follow.
            error: of the result before them.
        """
        is_coarse = part(error, "space") > shares(error, self.accuracy, settings.plate)["space"]
        return self._grown(settings, error)[0] if is_coarse and settings.models[0].get("reduced") else settings

    def effects(self, error: Mapping[str, Any]) -> Any:
        """Return what effects are worth in an answer of an error (see `rotfem.selection.effects_ahead`)."""
        allowed = shares({**error, "model": 1.0}, self.accuracy)["model"]
        return effects_ahead(self.response, self.off, allowed, self.manifold)

    def _grown(self, settings: Settings, error: Mapping[str, Any]) -> tuple[Settings, float]:
        """Return settings with elements as the motion needs them, and the relative error that these leave."""
        if self.mesh is None or settings.elements is None:
            return settings, 0.0
        allowed = AIM * shares({**error, "space": 1.0}, self.accuracy, settings.plate)["space"]
        growth, off = self.mesh.growth(self.motions, allowed)
        growth = max(growth, (part(error, "space") / allowed) ** (0.5 / self.mesh.degree)) if growth < 1.0 else growth
        grown: Elements = finer(self.mesh.elements, growth)
        if growth >= 1.0:
            grown = finest(settings.elements, grown)
        return replace(settings, elements=grown), off

    def looser(self, settings: Settings, factor: float) -> Settings:
        """Return settings with the steps of an accuracy that is so many times looser, if the motion is known."""
        return self.stepped(settings, factor * shares({"time": 1.0}, self.accuracy, settings.plate)["time"])

    def stepped(self, settings: Settings, allowed: float) -> Settings:
        """Return settings with the steps of an error that is allowed."""
        known = [scheme for scheme in Scheme.registry if scheme.name in SCHEMES]
        found = plan(self.motions, allowed, known)
        if found is None:
            return settings
        if found.uneven:
            return replace(settings, scheme=ADAPTIVE, step=None, tolerance=AIM * allowed, increment=None)
        moved = max(motion.scale for motion in self.motions) / self.length
        duration = max(motion.whole.duration for motion in self.motions)
        increment = NEWTON * self.accuracy * min(1.0, moved / SMALL) * min(1.0, MANY * found.step / duration)
        if self.free:
            increment = min(increment, FREE * self.accuracy * moved * (found.step / duration) ** 2)
        increment = max(increment, SMALLEST)
        return replace(settings, scheme=found.scheme, step=found.step, tolerance=None, increment=increment)


def sampled(response: Response, structure: Vibrating) -> Motion:
    """Return the motion of a reduced answer, at times that are close enough for what is fast in it.

    Args:
        response: the answer.
        structure: what is known of its vibrations.
    """
    t: Array = np.linspace(response.times[0], response.times[-1], LOOKS)
    moves = [name.startswith("u") for name in response.model.system.structure.components]
    tips = (response.trajectory.at(t)[0] @ tips_of(response.model).T)[:, moves]
    return Motion(t, tips, struck(response), structure)


def less(error: dict[str, Any], found: float | None) -> None:
    """Write an estimate of the error of steps that is the smaller one, or the only one, into an error."""
    if found is not None and (error["time"] is None or found < error["time"]):
        put(error, "time", found)


def put(error: dict[str, Any], name: str, found: float) -> None:
    """Write another estimate of a part of an error into it, and into the sum; one that is unknown stays so if zero."""
    if error[name] is None and found == 0.0:
        return
    error[name] = found
    error["total"] = sum(part(error, share) for share in WORDS)


def compare(
    done: RunResult, settings: Settings, before: Settings, coarse: RunResult, motions: Sequence[Motion]
) -> None:
    """Write the error of steps that two runs of one model show of the finer one, if other estimates are beside it.

    Steps of h_1 and h_2 < h_1 differ by e (1 − (h_2/h_1)^p) with e the error of the coarser one; p = 2 is on the safe
    side for schemes of higher order, where the two are well apart. What neither resolves does not differ: it is added,
    as spectra know it. With the order of the scheme it is the least that the finer one is off, what a motion amplifies
    with it, as no spectrum has.

    Args:
        done: the finer run.
        settings: of it.
        before: those of the run before it.
        coarse: that run.
        motions: that are known.
    """
    if settings.models != before.models or settings.step is None or before.step is None:
        return
    if not APART * settings.step < before.step or len(done.t) != len(coarse.t):
        return
    fine, rough = rows_of(done), rows_of(coarse)
    scale = float(np.linalg.norm(fine, axis=1).max())
    if scale > 0.0:
        apart = float(np.linalg.norm(fine - rough, axis=1).max()) / scale
        error, ratio, scheme = done.summary["error"], before.step / settings.step, settings.scheme
        if scheme is not None:
            less(error, apart / (ratio**2 - 1) + unresolved_ahead(motions, Scheme.registry[scheme], settings.step))
        if scheme is not None and scheme == before.scheme:
            put(error, "time", max(error["time"], apart / (ratio ** Scheme.registry[scheme].order - 1)))


def rows_of(done: RunResult) -> Array:
    """Return the displacement of the tip in all rows, (n, components), m."""
    return np.stack([done.column(name) for name in TIPS if name in done.history], axis=1)
