"""A case tried out on a coarse mesh with few steps, with any theory and any effects, to see what they change.

The difference of two models depends little on mesh and step as long as both are solved alike: most of the error of
discretisation is in both. Effects are switched, so each theory is compiled once.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.analysis.equilibrium import check_steady, static_tip_shape
from rotfem.equations.compiled import compile_system
from rotfem.errors import ComputationError, InputError
from rotfem.mechanics.problem import Problem
from rotfem.mechanics.theories import Theory
from rotfem.numerics.eigenproblem import Pencil
from rotfem.selection.candidate import HALVED, Candidate, Watch, stand_in, theories_of
from rotfem.selection.case import Case
from rotfem.selection.coarse_case import absent, coarse, from_file
from rotfem.selection.distance import HISTORY, MODES, STEADY, Beyond, Bound, Outputs
from rotfem.selection.resolution import given
from rotfem.selection.sampling import FINER, LONGER, SHORTER, Sampling, serving

Array = npt.NDArray[Any]

#: Share of the case's own steps from which on shorter steps of a trial cost more than they can save.
DEAR = 0.5

#: Increment of Newton's method, relative to the motion, that is not felt in the smallest change that is told.
FELT = 1e-6

#: Times at which the speed of a free hub is looked at.
HUB_LOOKS = 2001


class Dear(ComputationError):
    """A trial would take about as long as the run it is to spare."""


def check_terms(system: Any) -> None:
    """Refuse to compare a linear theory that cannot have a term of the user.

    Raises:
        ComputationError: it has one that is no polynomial of the constants.
    """
    if system.linear:
        try:
            system.held.check_terms()
        except InputError as error:
            raise ComputationError(str(error)) from None


class Trial:
    """A case to be tried out.

    Args:
        case: problem, and what is to be computed of it.
        outputs: which of "history", "steady" and "modes" are wanted; by default all the case has.
        speeds: speeds of the modes (rad/s); by default the final one of the motion, of a free hub the largest that it
            reaches with a rigid structure.
        comm: MPI communicator.
        thrifty: whether to give up with `Dear` where the histories need about as many steps as the case's own.

    Raises:
        InputError: the case has none of the outputs; a mesh or a section that cannot be computed with.

    Attributes:
        full, case: what was given, and the same on its coarse mesh.
        effects: all effects there are data for.
        theories: all theories by name that this kind of structure has, from the poorest on.
        wanted: outputs that are computed.
        absent: output ↦ why there is none.
        at_rest: frequencies of the resting structure, rad/s; none where its eigenproblem failed.
        unknown: why it did.
        samples: of the histories; None where none is wanted.
        finer: the fewest steps between two samples, from where Newton needs them.
        moves: largest displacement of the tip over the length, where a march has shown it, else 0.
    """

    def __init__(
        self,
        case: Case,
        outputs: Collection[str] | None = None,
        *,
        speeds: Collection[float] | None = None,
        comm: MPI.Comm = MPI.COMM_WORLD,
        thrifty: bool = False,
    ):
        self.full, self.thrifty = case, thrifty
        # A coarse mesh is not worth sharing: every process does it all. That of a file may be large.
        self.comm = comm if from_file(case.problem) else MPI.COMM_SELF
        self.absent = absent(case)
        named = outputs if outputs is not None else (HISTORY, STEADY, MODES)
        self.wanted = tuple(name for name in named if name not in self.absent)
        if not self.wanted:
            self._refuse()
        self.case = coarse(case, MODES in self.wanted)
        problem = self.case.problem
        self.effects, self.theories = problem.effective_effects(), theories_of(problem)
        self._systems: dict[str, Any] = {}
        self._done: dict[tuple[str, frozenset[str], frozenset[str]], Outputs] = {}
        self._released: dict[tuple[str, str], Array] = {}
        self.unknown = ""
        self.at_rest: Array = np.empty(0)
        try:
            self.at_rest = self._frequencies_at_rest()
        except ComputationError as error:
            self.unknown = error.what
        self.speeds = tuple(speeds) if speeds is not None else (self._reached(),)
        self.samples: Sampling | None = None
        if HISTORY in self.wanted and case.steps is not None:
            self.samples = self._sampled()
        self.finer, self.moves = FINER[0], 0.0

    def _refuse(self) -> None:
        """Say why there is none of the outputs."""
        check_steady(self.full.problem.replace(effects=None))
        raise InputError("", None, self.full.unsteady or "there is nothing to compare models by")

    def fit(self, error: float, size: float = 0.0) -> None:
        """Fit steps and iterations of the histories to a march in the steps of the case.

        Args:
            error: of its steps, relative (0: unknown).
            size: its largest displacement of the tip over the length (0: unknown).

        Newton's method stops where increments are no matter of what changes are told. No two histories may differ by
        what steps make of the same motion, and up to `LONGER` they need not be shorter than that, if the motion begins
        at rest. Where they are to be shorter by less than `SHORTER`, there are more samples, else several steps
        between two.
        """
        own, scheme = self.full.steps, self.full.scheme
        if self.samples is None or scheme is None or own is None or own.step is None or self._done or not error > 0.0:
            return
        self.moves = size
        increment = max(self.case.increment_tolerance, FELT * min(1.0, size))
        self.case = self.case.replace(history_tolerance=increment)
        wanted = serving(error, own.step, scheme.order)
        longest = LONGER if self.case.first is None else 1.0
        if (longer := min(longest, wanted / self.samples.step)) > SHORTER:
            self.samples = self._sampled(longer)
        self.samples = self.samples.shortened(wanted)

    def _sampled(self, longer: float = 1.0) -> Sampling:
        """Return the samples of the histories, with steps that are by so much longer than frequencies ask for."""
        steps = self.full.steps
        assert steps is not None
        found = Sampling.of(steps, self.at_rest, given(self.case.problem), longer)
        return found if self.case.first is None else found.struck()

    def outputs(
        self,
        theory: str,
        without: Collection[str] = (),
        bound: Bound | None = None,
        *,
        known: Collection[str] = (),
    ) -> Outputs:
        """Return what the case gives in a theory without some effects; computed once.

        Args:
            theory: its name.
            without: effects left out.
            bound: what not to go beyond; a history that does is given up and counts as failed.
            known: outputs that are not computed, since what is asked of them is known.
        """
        key = theory, frozenset(without), frozenset(known)
        if key not in self._done:
            self._done[key] = self._compute(theory, key[1], bound, [n for n in self.wanted if n not in known])
        return self._done[key]

    def _reached(self) -> float:
        """Return the speed of the modes, rad/s."""
        problem, steps = self.case.problem, self.case.steps
        hub, end = problem.motion.hub, 0.0 if steps is None else steps.end
        if hub is None or steps is None:
            return problem.motion.final_speed(end)
        times = np.unique([*np.linspace(0.0, end, HUB_LOOKS), *hub.torque.knots])
        speeds = hub.rigid_speeds(times, self.poorest.row.rest_inertia())
        return float(speeds[np.argmax(np.abs(speeds))])

    # --- systems ------------------------------------------------------------------------------------------------------

    @property
    def poorest(self) -> Any:
        """Compiled system that the poorest theory is tried out on, nothing left out."""
        system = self.candidate(next(iter(self.theories))).system
        system.leave_out(())
        return system

    def candidate(self, theory: str, without: Collection[str] = ()) -> Candidate:
        """Return a model to be tried out; the compiled system is one for all of a theory."""
        problem = self.case.problem
        own, left_out = self._stand_in(theory)
        if own.name not in self._systems:
            self._systems[own.name] = self.compiled(problem, own.name)
        return Candidate(self.case, self._systems[own.name], left_out.union(without))

    def _stand_in(self, theory: str) -> tuple[Theory, frozenset[str]]:
        return stand_in(self.theories[theory], self.theories, self.case.problem.structure.type)

    def compiled(self, problem: Problem, theory: str) -> Any:
        """Return the system that a theory of a problem is tried out on; the mesh may be another one."""
        own, _ = self._stand_in(theory)
        return compile_system(problem.replace(theory=own), self.comm, HISTORY in self.wanted, parted=True)

    def on_mesh(self, mesh: Any, theory: str, without: Collection[str] = ()) -> Candidate:
        """Return a model on another mesh; the compiled system is one for all that ask for a theory on it.

        Raises:
            InputError: a mesh that cannot be computed with.
        """
        if mesh == self.case.problem.mesh:
            return self.candidate(theory, without)
        case = self.case.replace(problem=self.case.problem.replace(mesh=mesh))
        own, left_out = self._stand_in(theory)
        key = f"{own.name} on {mesh!r}"
        if key not in self._systems:
            self._systems[key] = self.compiled(case.problem, theory)
        return Candidate(case, self._systems[key], left_out.union(without))

    def poorest_on(self, mesh: Any) -> Candidate:
        """Return the poorest theory with its geometric stiffness on another mesh, nothing left out.

        Raises:
            InputError: a mesh that cannot be computed with.
        """
        return replace(self.on_mesh(mesh, next(iter(self.theories))), without=frozenset())

    def _frequencies_at_rest(self) -> Array:
        """Return the frequencies (rad/s) of the resting structure, its hub held."""
        held = self.poorest.held
        held.set_time(0.0, self.case.problem.motion.at_speed(0.0))
        held.set_state(held.zeros())
        pencil = Pencil(*held.mass_damping_stiffness())
        return np.sort(np.abs(pencil.solve(max(2, self.case.mode_count)).values))

    # --- computing what a model gives -----------------------------------------------------------------------------

    def _compute(self, theory: str, without: frozenset[str], bound: Bound | None, names: Collection[str]) -> Outputs:
        candidate, out = self.candidate(theory, without), Outputs()
        for name in names:
            try:
                check_terms(candidate.system)
                if name == MODES:
                    out.values = candidate.eigenvalues(self.speeds)
                elif name == STEADY:
                    candidate.steady(out)
                else:
                    self._history(candidate, theory, out, bound)
            except Dear:
                raise
            except ComputationError as error:
                out.failed[name] = error.what
        return out

    def _history(self, candidate: Candidate, theory: str, out: Outputs, bound: Bound | None) -> None:
        """Compute a history, with shorter steps between the samples where a nonlinear model asks for them.

        What one model needs all get from then on, since only histories solved alike can be compared.
        """
        samples = self.samples
        assert samples is not None
        levels = samples.levels
        for finer in levels[levels.index(self.finer) :]:
            count, last = samples.count(finer), finer == levels[-1]
            if self.thrifty and finer > 1 and count > DEAR * (samples.own or np.inf):
                raise Dear(f"{count} steps would be needed")
            watch = Watch(bound, np.inf if last else HALVED * count)
            try:
                candidate.history(samples.steps(finer), self.start(candidate, theory), out, watch)
                break
            except Beyond:
                raise
            except ComputationError:
                if last or candidate.system.linear:
                    raise
        if finer != self.finer:
            self.finer = finer
            self._done.clear()

    def start(self, candidate: Candidate, theory: str) -> tuple[Array | None, Array | None]:
        """Return (q, q̇) of a model at t = 0; None where it is undeformed, or at rest."""
        case = self.case
        if case.tip_displacement is not None:
            problem = candidate.case.problem.replace(theory=self.theories[theory])
            key = theory, repr(problem.mesh)
            if key not in self._released:
                self._released[key] = static_tip_shape(problem, case.tip_displacement, case.newton(), self.comm)
            return self._released[key].copy(), None
        q = candidate.equilibrium() if case.from_steady else None
        return (q, None) if case.first is None else candidate.in_motion(q, case.first)
