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

WORLD = MPI.COMM_WORLD


class Problem(problem.Problem):
    """A problem and the verbs of a script (its parts: `rotfem.mechanics.problem`); `loads` as `rotfem.Loads`."""

    def campbell(self, speeds: Sequence[float] | str, *, comm: MPI.Comm = WORLD, **modes: Any) -> CampbellResult:
        """Return the modes followed over speed, and critical speeds; no errors are estimated.

        Args:
            speeds: increasing, rad/s, or text such as "0:12:25" or "0:15:31rpm".
            comm: communicator the structure is distributed over.
            modes: keys of [modes]: count, orders, about.

        Raises:
            InputError, ComputationError: as those of `modes`.
        """
        scene = self._as_scene(0.0, modes)
        analysis, started = analysis_of(scene, self.spinning(), comm), perf_counter()
        return diagram(scene, analysis, parse_speeds(speeds), started, None, None, False, None)

    def response(
        self, *frequencies: float | str, speed: float | str | None = None, comm: MPI.Comm = WORLD, **options: Any
    ) -> ResponseResult:
        """Return amplitudes and phases at tip and root under the harmonic loads, over their frequency.

        Args:
            frequencies: lowest and highest, rad/s or as "2 Hz"; those of `rotfem.response` without.
            speed: rad/s, or as "12.1 rpm"; that of the motion if None, its last where it changes.
            comm: communicator the structure is distributed over.
            options: number, per_rev as those of `rotfem.response`, count of the modes whose peaks are resolved.

        Raises:
            InputError: no harmonic load, frequencies that cannot be, a mesh or a section that cannot be computed with.
            ComputationError: no equilibrium, or a frequency of a mode without damping.
        """
        low, high = [*(angular(x, "--from, --to", 0.0) for x in frequencies), None, None][:2]
        speed, number, lines = self._speed(speed), options.pop("number", 200), options.pop("per_rev", ())
        still = self.replace(motion=self.motion.at_speed(speed))
        return response_of(self._as_scene(speed, options), low, high, number, lines, comm, still)

    def _as_scene(self, speed: float, modes: Any) -> Scene:
        """Return a scene of the structure and the mesh, for what the verbs read of one besides the problem."""
        fields: Any = Scene.model_fields
        others = {name: fields[name].annotation() for name in ("initial", "loads", "solver", "extensions")}
        others |= {"mesh": self.mesh, "modes": ModesTable(**modes), "output": OutputTable(error=False)}
        motion, model = ConstantMotion(type="constant", speed=speed), ModelTable(theory=self.theory.name)
        return Scene.model_construct(structure=self.structure, motion=motion, model=model, **others)
