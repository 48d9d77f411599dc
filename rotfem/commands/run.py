"""`rotfem run`: the steady state or the time history of a scene."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.analysis.equilibrium import check_steady, critical_speed, newton_for, static_tip_shape, steady_state
from rotfem.analysis.hub_stepper import HubStepper
from rotfem.analysis.stepper import Scheme, State, Stepper
from rotfem.analysis.time_loop import LARGEST_LINEAR_DEFLECTION, adaptive_steps, fixed_steps
from rotfem.equations.affine import AffineSystem
from rotfem.equations.hub import Hub
from rotfem.equations.model import Model
from rotfem.equations.system import System, compile_system
from rotfem.errors import ComputationError
from rotfem.listeners import Hint, Progress, silent
from rotfem.numerics.newton import Newton
from rotfem.results.extremes import figures
from rotfem.results.run import RunResult, Table
from rotfem.scene import Scene, TorqueMotion, as_scene
from rotfem.scene.advice import advise
from rotfem.selection.distance import HISTORY, STEADY
from rotfem.selection.model_choice import Choice, RangeExceeded, choose
from rotfem.structures.paraview import Snapshots, writer
from rotfem.version import versions

Array = npt.NDArray[np.float64]

#: Displacement over L in the plane of a plate from which a run says what its strains leave out there.
NOTICED = 1e-3


def run(
    scene: Scene | str | Path | Mapping[str, Any],
    comm: MPI.Comm = MPI.COMM_WORLD,
    progress: Progress | None = None,
    hint: Hint | None = silent,
) -> RunResult:
    """Return the time history of a scene, or its steady state where the spin is constant and [time] absent.

    Args:
        scene: scene, path of a scene file, or nested tables.
        comm: communicator the structure is distributed over; every rank gets the whole result.
        progress: called with the share of the work done, between 0 and 1.
        hint: called with every line of advice before the computation starts; None asks for none.

    Raises:
        SceneError: the scene is not valid or cannot be run.
        ComputationError: it failed; its attribute `result` holds what was computed until then.
    """
    scene = as_scene(scene)
    scene.check_run()
    if scene.time is None or scene.initial.state == "steady":
        check_steady(scene)
    if scene.model.tolerance is not None:
        return run_chosen(scene, comm, progress, hint)
    return hinted(Simulation(scene, comm), hint).run(progress)


def hinted(simulation: Simulation, hint: Hint | None) -> Simulation:
    """Return a simulation after its hints are told."""
    simulation.advice = advise(simulation.scene, "run", hint, critical=simulation.critical)
    return simulation


def run_chosen(scene: Scene, comm: MPI.Comm, progress: Progress | None, hint: Hint | None) -> RunResult:
    """Return the result of the cheapest model within model.tolerance, and of richer ones where it does not hold.

    Raises:
        ComputationError: the full model failed, or one of them with on_exceed = "stop" or "warn".
    """
    choice = choose(scene, (HISTORY, STEADY), comm=comm)
    while True:
        try:
            return hinted(Simulation(choice.apply(scene), comm, choice, scene), hint).run(progress)
        except ComputationError as error:
            if choice.full or scene.model.on_exceed != "upgrade":
                raise
            # Any other failure of a poorer model is one that the richer one may not have: it is taken as far out.
            sizes = error.sizes if isinstance(error, RangeExceeded) else np.full_like(choice.sizes, np.inf)
            choice = choice.richer(sizes, error.time, error.what)


class Simulation:
    """One run: the compiled system, the record of what happened, and the summary made of it.

    Args:
        scene: validated scene, with the model it is run with.
        comm: MPI communicator.
        choice: how this model was chosen, if it was.
        asked: the scene it was chosen for.
    """

    def __init__(
        self,
        scene: Scene,
        comm: MPI.Comm = MPI.COMM_WORLD,
        choice: Choice | None = None,
        asked: Scene | None = None,
    ):
        self.started = perf_counter()
        self.scene, self.comm = scene, comm
        self.choice, self.asked = choice, asked or scene
        self.warnings: list[str] = [] if choice is None else upgrade_warnings(choice)
        self.exceeded = ""
        self.advice: list[str] = []
        if scene.time is None and scene.model.frame == "inertial":
            self.scene = scene = scene.replace({"model.frame": "rotating"})
            self.warnings.append("a steady state is one only in the rotating frame, where it was computed")
        self.model = Model(scene, comm)
        self.system: System = compile_system(self.model)
        self.compiled = perf_counter() - self.started
        motion, effects = scene.motion, self.model.effects
        self.hub = Hub(self.system, motion, "hub_coupling" in effects) if isinstance(motion, TorqueMotion) else None
        names = tuple(f"tip_{c}" for c in self.model.structure.components)
        free = ("torque", "hub_kinetic", "angular_momentum", "impulse", "work") if self.hub is not None else ()
        self.history = Table(("t", "psi", "psi_dot", *names, "kinetic", "strain", "jacobi", *free))
        self.snapshots = Snapshots() if scene.structure.type == "plate" else None
        self.newton = newton_for(scene)
        self.stepper: Stepper | None = None
        self.steps = 0
        self.critical = critical_speed(self.system) if isinstance(self.system, AffineSystem) else None
        self._critical_since: float | None = None

    def run(self, progress: Progress | None = None) -> RunResult:
        """Return the result of the scene (see `run`)."""
        try:
            self._steady() if self.scene.time is None else self._march(progress or (lambda share: None))
        except (ComputationError, KeyboardInterrupt) as error:
            failure = error if isinstance(error, ComputationError) else None
            status = "interrupted" if failure is None else "failed"
            error.result = self.result(status, failure)  # type: ignore[union-attr]
            raise
        return self.result("done")

    # --- the two kinds of run -------------------------------------------------------------------------------------

    def _steady(self) -> None:
        omega = self.model.motion.speed(0.0)
        q = steady_state(self.system, omega, self.newton)
        self._record(State(0.0, q, np.zeros_like(q), np.zeros_like(q), np.zeros_like(q)))
        if self.critical is not None and abs(omega) > self.critical:
            self.warnings.append(
                f"the equilibrium is unstable: {abs(omega):g} rad/s is above the speed {self.critical:.6g} rad/s at "
                f"which the {self.scene.model.theory} stiffness is singular"
            )

    def _march(self, progress: Progress) -> None:
        time = self.scene.time
        assert time is not None
        scheme, newton = Scheme.of(self.scene), newton_for(self.scene, monotone=True)
        if self.hub is not None:
            self.stepper = HubStepper(self.system, self.hub, scheme, newton)
        else:
            self.stepper = Stepper(self.system, scheme, newton)
        state = self.stepper.start(0.0, *self._initial())
        self._record(state)
        if time.step is not None:
            states = fixed_steps(self.stepper, state, time.end, time.step)
        else:
            states = adaptive_steps(self.stepper, state, time)
        for new in states:
            self.steps += 1
            self._check(new)
            if new.t >= time.end * (1 - 1e-9) or self.steps % time.output_every == 0:
                self._record(new)
                progress(new.t / time.end)

    def _initial(self) -> tuple[Array, Array]:
        """Return (q, v) at t = 0 in the frame of the system."""
        initial = self.scene.initial
        q = np.zeros_like(self.system.q.x.array)
        if initial.tip_displacement is not None:
            q = static_tip_shape(self.scene, initial.tip_displacement, newton_for(self.scene))
        elif initial.state == "steady":
            rotating = self.scene.replace({"model.frame": "rotating"}) if self.model.fixed else self.scene
            system = compile_system(Model(rotating, self.comm)) if self.model.fixed else self.system
            q = steady_state(system, self.model.motion.speed(0.0), newton_for(self.scene))
        if self.system.clamp is not None:
            return self.system.clamp.rigid(q, 0.0)
        return q, np.zeros_like(q)

    # --- record -----------------------------------------------------------------------------------------------------

    def _check(self, state: State) -> None:
        """Stop a history that has left the range of its theory.

        Raises:
            ComputationError: displacements of a linear theory beyond the structure's length, or not finite.
        """
        if not self.system.linear:
            return
        speed = abs(self.model.motion.speed(state.t))
        if self._critical_since is None and self.critical is not None and speed > self.critical:
            self._critical_since = state.t
        size = self.system.size(state.q)
        if np.isfinite(size) and size <= LARGEST_LINEAR_DEFLECTION:
            return
        theory, why = self.scene.model.theory, "the motion is unstable or its load too large for a linear theory"
        if self._critical_since is not None:
            passed = f"passed at t = {self._critical_since:.4g} s"
            why = f"its stiffness is not definite above {self.critical:.6g} rad/s, {passed}"
            if self.model.theory.prestressed is None:
                why += ": first-order strains keep the softening by the centrifugal force but not the stiffening"
        raise ComputationError(
            f"the {theory} solution diverged (a displacement exceeds the length, or a rotation 1 rad; {why})",
            time=state.t,
            advice='use model.theory = "reissner", which holds for any deflection'
            if self.model.theory.prestressed is not None
            else 'use model.theory = "consistent_linear" for small or "reissner" for any deflection',
        )

    def _watch(self, state: State) -> None:
        """See whether a state is in the range its model was chosen for.

        Raises:
            RangeExceeded: it is not, and the scene does not want a mere warning.
        """
        if self.choice is None or self.exceeded:
            return
        sizes = self.system.sizes(state.q)
        self.exceeded = self.choice.check(sizes)
        if not self.exceeded:
            return
        if self.asked.model.on_exceed != "warn":
            raise RangeExceeded(self.exceeded, state.t if self.scene.time is not None else None, sizes)
        self.warnings.append(f"{self.exceeded}, at t = {state.t:.6g} s")

    def _record(self, state: State) -> None:
        system, t = self.system, state.t
        if not system.linear:
            self.model.structure.check_range(state.q, t)
        if self.hub is not None and state.hub is not None:
            self.hub.values[:] = state.hub[:3]
        system.set_time(t)
        system.set_state(state.q, state.v, state.a)
        tip = self.model.structure.tip_values(state.q)
        if system.clamp is not None:
            tip = system.clamp.relative(tip[None, :], self.model.structure.length, t)[0]
        energy = system.energies()
        motion = self.model.motion
        row = [t, motion.angle(t), motion.speed(t), *tip, *(energy[k] for k in ("kinetic", "strain", "jacobi"))]
        if self.hub is not None and state.hub is not None:
            hub = self.hub
            row += [hub.torque.at(t, after=True), hub.kinetic(), hub.angular_momentum(), state.hub[5], state.hub[4]]
        self.history.append(row)
        if self.snapshots is not None:
            self.snapshots.add(t, state.q)
        self._watch(state)

    # --- summary ------------------------------------------------------------------------------------------------------

    def result(self, status: str, failure: ComputationError | None = None) -> RunResult:
        """Return everything computed so far with a summary of how it went."""
        history = self.history.arrays()
        shape = self.system.shape() if len(self.history) else {}
        if self.stepper is not None:
            newton: Newton = self.stepper.newton
            if self.stepper.substeps:
                self.warnings.append(f"{self.stepper.substeps} steps were halved because Newton did not converge")
        else:
            newton = self.newton
        if newton.roundoff > 0:
            self.warnings.append(f"Newton stopped at round-off, increments {newton.roundoff:.1e} (relative)")
        if status == "done" and self._critical_since is not None:
            self.warnings.append(
                f"the speed is above {self.critical:.6g} rad/s, where the {self.scene.model.theory} stiffness is no "
                f"longer definite, since t = {self._critical_since:.4g} s"
            )
        self._warn_of_what_the_strains_lack(history)
        summary: dict[str, Any] = {
            "command": "run",
            "status": status,
            "name": self.scene.name,
            "kind": "steady" if self.scene.time is None else "history",
            "theory": self.scene.model.theory,
            "frame": self.scene.model.frame,
            "effects": list(self.model.effects),
            "integrals": self.system.integrals,
            "dofs": self.system.V.dofmap.index_map.size_global * self.system.V.dofmap.index_map_bs,
            "elements": self.model.structure.mesh.topology.index_map(
                self.model.structure.mesh.topology.dim
            ).size_global,
            "steps": self.steps,
            "newton_iterations": newton.iterations,
            "factorisations": self.stepper.factorisations if self.stepper else newton.iterations,
            "timings": self._timings(),
            "figures": figures(history),
            "warnings": self.warnings,
            "advice": self.advice,
            "versions": versions(),
            "ranks": self.comm.size,
            "scene": self.asked.to_dict(),
        }
        if self.choice is not None:
            summary["choice"] = self.choice.summary()
        if self.stepper is not None and self.stepper.rejected:
            summary["rejected_steps"] = self.stepper.rejected
        if self.critical is not None:
            summary["figures"]["critical_speed"] = self.critical
        if failure is not None:
            summary["failure"] = {"what": failure.what, "time": failure.time, "advice": failure.advice}
        structure = self.model.structure
        out = RunResult(summary, history, shape, triangles=structure.surface())
        if self.snapshots is not None:
            out.fields = writer(self.system.V, "fields", self.snapshots.kept)
        return out

    def _warn_of_what_the_strains_lack(self, history: dict[str, Array]) -> None:
        """Warn where a structure moves in a way that its theory's strains do not stiffen by the spin."""
        structure, theory = self.model.structure, self.scene.model.theory
        spins = np.any(history.get("psi_dot", np.zeros(1)) != 0.0)
        if not structure.unstiffened or theory == "reissner" or not spins or "centrifugal" not in self.model.effects:
            return
        size = float(np.max(np.abs(history["tip_u2"]), initial=0.0)) / structure.length
        if size > NOTICED:
            self.warnings.append(
                f"the tip moves by up to {size:.2g} L in the plane: the strains of {theory} for this structure leave "
                'out the stiffening of such motions by the spin; model.theory = "reissner" has it'
            )

    def _timings(self) -> dict[str, float]:
        chosen = {} if self.choice is None else {"choice": self.choice.seconds}
        total = perf_counter() - self.started + sum(chosen.values())
        parts = {**chosen, "compile": self.compiled, **(self.stepper.seconds if self.stepper else {})}
        return {**parts, "other": total - sum(parts.values()), "total": total}


def upgrade_warnings(choice: Choice) -> list[str]:
    """Return what a run says of the models it has given up."""
    return [
        f"{note['why']}{'' if note['time'] is None else ' at t = {:.6g} s'.format(note['time'])}; "
        f"started again with {note['to']} and all effects"
        for note in choice.upgrades
    ]
