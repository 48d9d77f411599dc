"""The problem of a script: what stands above the verbs of a scene, too."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter
from typing import Any

from mpi4py import MPI

from rotfem.commands import problem
from rotfem.commands.campbell import diagram, parse_speeds
from rotfem.commands.modes import analysis_of
from rotfem.commands.response import angular, response_of
from rotfem.results.campbell import CampbellResult
from rotfem.results.modes import ResponseResult
from rotfem.scene import Scene
from rotfem.scene.motion import ConstantMotion
from rotfem.scene.settings import ModelTable, ModesTable, OutputTable


class Problem(problem.Problem):
    """A problem and the verbs of a script (its parts: `rotfem.mechanics.problem`); `loads` as `rotfem.Loads`."""

    def campbell(
        self,
        speeds: Sequence[float] | str,
        *,
        count: int = 6,
        orders: Sequence[int] | None = None,
        about: str = "steady",
        comm: MPI.Comm = MPI.COMM_WORLD,
    ) -> CampbellResult:
        """Return the modes followed over speed, and critical speeds; no errors are estimated.

        Args:
            speeds: increasing, rad/s, or text such as "0:12:25" or "0:15:31rpm".
            count: number of modes.
            orders: k of the lines kΩ to cross; as many as meet a branch if None, at most 4.
            about: the state that they are about: "steady" or "undeformed".
            comm: communicator the structure is distributed over.

        Raises:
            InputError: speeds, or a count, that cannot be; a mesh or a section that cannot be computed with.
            ComputationError: no equilibrium at a speed, or eigenpairs that fail the check of their backward error.
        """
        scene = self._as_scene(0.0, count=count, about=about, orders=None if orders is None else list(orders))
        analysis = analysis_of(scene, self.spinning(), comm)
        values = parse_speeds(speeds if isinstance(speeds, str) else ",".join(repr(float(s)) for s in speeds))
        return diagram(scene, analysis, values, perf_counter(), None, None, False, None)

    def response(
        self,
        low: float | str | None = None,
        high: float | str | None = None,
        *,
        number: int = 200,
        per_rev: Sequence[float] = (),
        count: int = 6,
        speed: float | str | None = None,
        comm: MPI.Comm = MPI.COMM_WORLD,
    ) -> ResponseResult:
        """Return amplitudes and phases at tip and root under the harmonic loads, over their frequency.

        Args:
            low: lowest frequency, as of `rotfem.response`.
            high: highest one.
            number: of frequencies.
            per_rev: multiples of the speed.
            count: modes whose peaks are resolved.
            speed: rad/s, or as "12.1 rpm"; that of the motion if None, its last where it changes.
            comm: communicator the structure is distributed over.

        Raises:
            InputError: no harmonic load, frequencies that cannot be, a mesh or a section that cannot be computed with.
            ComputationError: no equilibrium, or a frequency of a mode without damping.
        """
        speed = self._speed(speed)
        first, last = (None if x is None else angular(x, "--from, --to", 0.0) for x in (low, high))
        still = self.replace(motion=self.motion.at_speed(speed))
        return response_of(self._as_scene(speed, count=count), first, last, number, per_rev, comm, still)

    def _as_scene(self, speed: float, **modes: Any) -> Scene:
        """Return a scene of the structure and the mesh, for what the verbs read of one besides the problem."""
        fields: Any = Scene.model_fields
        others = {name: fields[name].annotation() for name in ("initial", "loads", "solver", "extensions")}
        return Scene.model_construct(
            structure=self.structure,
            motion=ConstantMotion(type="constant", speed=speed, axis=self.motion.axis),
            mesh=self.mesh,
            modes=ModesTable(**modes),
            output=OutputTable(error=False),
            model=ModelTable(theory=self.theory.name),
            **others,
        )
