"""A scene tried out on a coarse mesh with few steps, with any theory and any effects, to see what they change.

The difference of two models depends little on mesh and step as long as both are solved alike: most of the error of
discretisation is in both. Effects are switched, so each theory is compiled once.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.analysis.equilibrium import check_steady, newton_for, static_tip_shape, steady_state
from rotfem.analysis.hub_stepper import HubStepper
from rotfem.analysis.stepper import Scheme, Stepper
from rotfem.analysis.time_loop import LARGEST_LINEAR_DEFLECTION, fixed_steps
from rotfem.equations.affine import PRESTRESS
from rotfem.equations.switched import SwitchedSystem
from rotfem.errors import ComputationError, SceneError
from rotfem.mechanics.strains import THEORIES
from rotfem.numerics.eigenproblem import ZERO, Pencil
from rotfem.scene import PlateMesh, PlateStructure, Scene
from rotfem.selection.distance import HISTORY, MODES, STEADY, Beyond, Bound, Outputs
from rotfem.selection.resolution import given, parts

Array = npt.NDArray[Any]

#: Nodes along a coarse mesh for every wanted mode, and the fewest.
NODES_A_MODE, FEWEST_NODES = 3, 12

#: Steps in a period of the first and of the second eigenfrequency, and the fewest and most of a history.
STEPS_A_PERIOD, FEWEST_STEPS, MOST_STEPS = (32, 10), 200, 1500

#: Steps between two samples of a history, tried one after the other as far as the scene has as many steps itself.
FINER = (1, 4, 16)

#: Share of the scene's own steps from which on shorter steps of a trial cost more than they can save.
DEAR = 0.5

#: Samples in 1/ω₁ where no frequency is known.
SAMPLES_A_RADIAN = 5

#: Share of halved steps from which on steps are too long to be trusted.
HALVED = 0.01

#: Newton stops here: small differences of two solutions are wanted.
INCREMENT = 1e-12


def coarse(scene: Scene, modes: bool = True) -> Scene:
    """Return the scene on a mesh just fine enough, in the rotating frame, solved to round-off.

    Args:
        scene: validated scene.
        modes: whether its modes are wanted; without, the mesh of a plate, whose time it makes, can be coarser still.
    """
    changes: dict[str, Any] = {
        "model.frame": "rotating",
        "model.effects": "auto",
        "model.tolerance": None,
        "solver.increment_tolerance": min(INCREMENT, scene.solver.increment_tolerance),
    }
    plate = isinstance(scene.mesh, PlateMesh)
    nodes = max(FEWEST_NODES, NODES_A_MODE * scene.modes.count if modes or not plate else 0)
    enough = int(np.ceil(nodes / scene.mesh.degree))
    if isinstance(scene.mesh, PlateMesh):
        if isinstance(scene.structure, PlateStructure) and scene.structure.mesh is None:
            changes["mesh.elements"] = [min(n, enough) for n in scene.mesh.elements]
    else:
        changes["mesh.elements"] = min(scene.mesh.elements, enough)
    return scene.replace(changes)


class Dear(ComputationError):
    """A trial would take about as long as the run it is to spare."""


class Trial:
    """A scene to be tried out.

    Args:
        scene: validated scene.
        outputs: which of "history", "steady" and "modes" are wanted; by default all the scene has.
        speeds: speeds of the modes (rad/s); by default the final one of the scene's motion.
        comm: MPI communicator.
        thrifty: whether to give up with `Dear` where the histories need about as many steps as the scene's own.

    Raises:
        SceneError: the scene has none of the outputs.

    Attributes:
        effects: all effects the scene has data for.
        wanted: outputs that are computed.
        absent: output ↦ why the scene has none.
        at_rest: frequencies of the resting structure, rad/s; none where its eigenproblem failed.
        unknown: why it did.
        step: distance of the samples of a history, s.
        own: steps of the scene itself; none where they are adaptive.
        parts: steps between two samples that what is prescribed asks for, (samples,).
        finer: the fewest steps between two samples, from where Newton needs them.
    """

    def __init__(
        self,
        scene: Scene,
        outputs: Collection[str] | None = None,
        speeds: Collection[float] | None = None,
        comm: MPI.Comm = MPI.COMM_WORLD,
        thrifty: bool = False,
    ):
        self.full, self.thrifty = scene, thrifty
        # A coarse mesh is not worth sharing: every process does it all. That of a file may be large.
        self.comm = comm if getattr(scene.structure, "mesh", None) is not None else MPI.COMM_SELF
        self.absent = self._absent()
        named = outputs if outputs is not None else (HISTORY, STEADY, MODES)
        self.wanted = tuple(name for name in named if name not in self.absent)
        self.scene = coarse(scene, MODES in self.wanted)
        self.newton = newton_for(self.scene)
        self._systems: dict[str, SwitchedSystem] = {}
        self._done: dict[tuple[str, frozenset[str]], Outputs] = {}
        self._released: dict[str, Array] = {}
        self._bound: Bound | None = None
        self.finer = FINER[0]
        self.effects = self.scene.effective_effects()
        if not self.wanted:
            scene.check_run()
            check_steady(scene)
        first = self.system("consistent_linear")
        self.speeds = tuple(speeds) if speeds is not None else (self._final_speed(first),)
        self.unknown = ""
        try:
            self.at_rest = self._steppable(first)
        except ComputationError as error:
            self.at_rest, self.unknown = np.empty(0), error.what
        self.step, self.own = self._step()
        self.parts = self._parts(first)
        self.levels = self._levels()

    def theories(self) -> tuple[str, ...]:
        """Return the theories that this kind of structure has."""
        return tuple(name for name, theory in THEORIES.items() if hasattr(theory.strains, self.scene.structure.type))

    def outputs(self, theory: str, without: Collection[str] = (), bound: Bound | None = None) -> Outputs:
        """Return what the scene gives in a theory without some effects; computed once.

        Args:
            theory: its name.
            without: effects left out.
            bound: what not to go beyond; a history that does is given up and counts as failed.
        """
        key = theory, frozenset(without)
        if key not in self._done:
            self._bound = bound
            self._done[key] = self._compute(theory, key[1])
        return self._done[key]

    def system(self, theory: str) -> SwitchedSystem:
        """Return the compiled system of a theory."""
        if theory == "linear":
            theory = "consistent_linear"  # the same without its geometric stiffness
        if theory not in self._systems:
            self._systems[theory] = SwitchedSystem(self.scene.replace({"model.theory": theory}), self.comm)
        return self._systems[theory]

    # --- what there is to compare -----------------------------------------------------------------------------------

    def _absent(self) -> dict[str, str]:
        scene, out = self.full.replace({"model.effects": "auto", "model.tolerance": None}), {}
        if scene.time is None:
            out[HISTORY] = "the scene has no [time]"
            try:
                scene.check_run()
            except SceneError as error:
                out[STEADY] = str(error)
        else:
            out[STEADY] = "the scene asks for a history"
        try:
            check_steady(scene)
        except SceneError as error:
            out[MODES] = "gravity turns in the rotating frame, so there is no steady state to vibrate about"
            out.setdefault(STEADY, str(error))
        return out

    def _final_speed(self, switched: SwitchedSystem) -> float:
        end = self.scene.time.end if self.scene.time is not None else 0.0
        return switched.prescribed.speed(max(end, getattr(self.scene.motion, "duration", 0.0)))

    def _steppable(self, switched: SwitchedSystem) -> Array:
        """Return the frequencies (rad/s) of the resting structure, its hub held."""
        switched.leave_out(())
        system = switched.system
        system.set_time(0.0, switched.prescribed.at_speed(0.0))
        pencil = Pencil(*system.mass_damping_stiffness())
        return np.sort(np.abs(pencil.solve(max(2, self.scene.modes.count)).values))

    def _step(self) -> tuple[float, int | None]:
        """Return the distance of the samples (s) and the number of steps of the scene itself."""
        time = self.scene.time
        if time is None:
            return 0.0, None
        own = None if time.step is None else int(np.ceil(time.end / time.step - 1e-9))
        wanted = max((w * n for w, n in zip(self.at_rest, STEPS_A_PERIOD, strict=False)), default=np.inf) / (2 * np.pi)
        steps = int(np.clip(np.ceil(min(time.end * wanted, MOST_STEPS)), FEWEST_STEPS, MOST_STEPS))
        return time.end / min(steps, own or MOST_STEPS), own

    def _parts(self, switched: SwitchedSystem) -> Array:
        if self.scene.time is None or HISTORY not in self.wanted:
            return np.ones(0, dtype=np.int64)
        end = self.scene.time.end
        times = np.linspace(0.0, end, round(end / self.step) + 1)
        period = 1 / self.at_rest[0] if self.at_rest.size else SAMPLES_A_RADIAN * self.step
        most = self.own or FINER[-1] * len(times)
        return parts(given(self.scene, switched.prescribed), times, float(period), most, self.own)

    def _levels(self) -> tuple[int, ...]:
        """Return `FINER` as far as no history takes more steps than the scene itself, and the most that does not."""
        finest = FINER[-1]
        while self.own is not None and finest > 1 and np.maximum(self.parts, finest).sum() > self.own:
            finest -= 1
        return tuple(dict.fromkeys(min(finer, finest) for finer in FINER))

    # --- computing it -----------------------------------------------------------------------------------------------

    def _compute(self, theory: str, without: frozenset[str]) -> Outputs:
        switched, out = self.system(theory), Outputs()
        without = without | {PRESTRESS} if theory == "linear" else without
        for name in self.wanted:
            switched.leave_out(without)
            try:
                if name == MODES:
                    out.values = np.concatenate([self._eigenvalues(switched, speed) for speed in self.speeds])
                elif name == STEADY:
                    self._steady(switched, out)
                else:
                    self._march(switched, theory, without, out)
            except Dear:
                raise
            except ComputationError as error:
                out.failed[name] = error.what
        return out

    def _steady(self, switched: SwitchedSystem, out: Outputs) -> None:
        system = switched.system
        q = steady_state(system, switched.prescribed.speed(0.0), self.newton)
        self._sample(switched, [self._tip(switched, q)], out)
        out.sizes = system.sizes(q)

    def _march(self, switched: SwitchedSystem, theory: str, without: frozenset[str], out: Outputs) -> None:
        """Compute a history, with shorter steps between the samples where a nonlinear model asks for them.

        What one model needs all get from then on, since only histories solved alike can be compared.
        """
        for finer in self.levels[self.levels.index(self.finer) :]:
            if self.thrifty and finer > 1 and self._count(finer) > DEAR * (self.own or np.inf):
                raise Dear(f"{self._count(finer)} steps would be needed")
            switched.leave_out(without)
            last = finer == self.levels[-1]
            try:
                trusted = self._march_once(switched, theory, out, finer, last)
            except Beyond:
                raise
            except ComputationError:
                if switched.system.linear or last:
                    raise
                continue
            if trusted:
                break
        if finer != self.finer:
            self.finer = finer
            self._done.clear()

    def _count(self, finer: int) -> int:
        return int(np.maximum(self.parts, finer).sum())

    def _march_once(self, switched: SwitchedSystem, theory: str, out: Outputs, finer: int, last: bool) -> bool:
        """Compute a history; return whether few enough steps had to be halved, or it is the last resort."""
        assert self.scene.time is not None
        system, scheme = switched.system, Scheme.of(self.scene)
        newton = newton_for(self.scene, monotone=True)
        q = self._start(switched, theory)
        hub = switched.hub
        stepper = Stepper(system, scheme, newton) if hub is None else HubStepper(system, hub, scheme, newton)
        state = stepper.start(0.0, q, np.zeros_like(q))
        tips, out.sizes = [self._tip(switched, q)], system.sizes(q)
        moved, bound = self._moved(switched), self._bound
        halved = HALVED * self._count(finer)
        try:
            counts = [max(finer, int(n)) for n in self.parts]
            for new in fixed_steps(stepper, state, self.scene.time.end, self.step, counts):
                tips.append(self._tip(switched, new.q))
                out.sizes = np.maximum(out.sizes, system.sizes(new.q))
                if bound is not None and bound.passed(len(tips) - 1, tips[-1][moved]):
                    raise Beyond(f"it is beyond the bound from t = {new.t:.4g} s on")
                if system.linear and not out.size <= LARGEST_LINEAR_DEFLECTION:
                    raise ComputationError(f"it diverges at t = {new.t:.4g} s")
                if not last and stepper.substeps > halved:
                    return False
        finally:
            self._sample(switched, tips, out)
        return True

    def _start(self, switched: SwitchedSystem, theory: str) -> Array:
        initial, system = self.scene.initial, switched.system
        if initial.tip_displacement is not None:
            if theory not in self._released:
                self._released[theory] = static_tip_shape(switched.scene, initial.tip_displacement, self.newton)
            return self._released[theory].copy()
        if initial.state == "steady":
            return steady_state(system, switched.prescribed.speed(0.0), self.newton)
        return np.zeros_like(system.q.x.array)

    def _tip(self, switched: SwitchedSystem, q: Array) -> Array:
        return np.asarray(switched.model.structure.tip_values(q))

    def _sample(self, switched: SwitchedSystem, tips: list[Array], out: Outputs) -> None:
        out.tip = np.array(tips)[:, self._moved(switched)]

    def _moved(self, switched: SwitchedSystem) -> list[int]:
        return [i for i, name in enumerate(switched.model.structure.components) if name.startswith("u")]

    def _eigenvalues(self, switched: SwitchedSystem, speed: float) -> Array:
        """Return λ of the wanted modes at a speed, without that of a rigid body."""
        system, hub, count = switched.system, switched.hub, self.scene.modes.count
        if self.scene.modes.about == "undeformed" or system.linear:
            zero = np.zeros_like(system.q.x.array)
            system.set_time(0.0, switched.prescribed.at_speed(speed))
            system.set_state(zero, zero, zero)
        else:
            steady_state(system, speed, self.newton)
        matrices = system.mass_damping_stiffness()
        pencil = Pencil(*matrices)
        if hub is None:
            return pencil.solve(count).values[:count]
        values = Pencil(*hub.bordered(*matrices)).solve(count, pencil.scale()).values
        flexible = np.abs(values) > ZERO * np.median(np.abs(values))
        return values[flexible][: count - int(not flexible.all())]
