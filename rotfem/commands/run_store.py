"""What of a run is on disk while it goes on: the rows of its history, and checkpoints."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import Any

from mpi4py import MPI

from rotfem.analysis.schemes import State
from rotfem.commands.checkpoint import Memory, Tree, check_identity, comparable, identity
from rotfem.commands.interrupts import Interrupts
from rotfem.errors import OutputError, SceneError, Stopped
from rotfem.refinement.refine import Setting
from rotfem.results.checkpoint_file import read_checkpoint, write_checkpoint
from rotfem.results.files import CHECKPOINT
from rotfem.results.result_set import ResultFolder, ResultSet, read_summary
from rotfem.results.run import LiveTable
from rotfem.scene import Scene

#: Seconds after which ranks tell each other of signals: mpirun gives its processes a quarter of a second.
TALK = 0.05


def interval(text: str | int) -> float | int:
    """Return the time (s, a float) from one checkpoint to the next of "30s", or the number of steps of "500".

    Raises:
        SceneError: it is none.
    """
    found = re.fullmatch(r"(\d+(?:\.\d+)?)(s?)", str(text))
    if found is None or float(found[1]) == 0.0 or not (found[2] or found[1].isdigit()):
        allowed = 'must be a time in seconds such as "30s", or a number of steps such as "500"'
        raise SceneError("command line", "--checkpoint", text, allowed)
    return float(found[1]) if found[2] else int(found[1])


@contextmanager
def checkpoint_of(path: Path) -> Iterator[None]:
    """Say in one error that the content of a checkpoint is not that of this program, as of another state of it.

    Raises:
        SceneError: in the place of what goes wrong with it.
    """
    try:
        yield
    except (SceneError, OSError):
        raise
    except Exception as error:  # of any kind, as anything may lie anywhere
        what = f"holds something else than this rotfem writes ({type(error).__name__}); start anew, without --resume"
        raise SceneError("command line", "--resume", path, what) from None


class RunStore:
    """Keeps a run's rows and checkpoints on disk, and ends it between steps when it is asked to.

    Args:
        comm: communicator of the run.
        folder: where its results go; None keeps nothing.
        every: from one checkpoint to the next, see `interval`; None writes none.
        resume: whether the run goes on from the checkpoint in the folder.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        folder: ResultFolder | None = None,
        every: float | int | None = None,
        resume: bool = False,
    ):
        self.comm, self.folder, self.every, self.resume = comm, folder, every, resume
        self._live: LiveTable | None = None
        self._run: Memory | None = None
        self._tree: Tree | None = None
        self._identity: Tree = {}
        self._written = monotonic()
        #: Time (s) and step at which ranks last talked to each other, and the step at which they do so next.
        self._talked, self._next = (monotonic(), 0), 0
        self._failed = False

    @property
    def goes_on(self) -> bool:
        """Whether there is a checkpoint to go on from."""
        return self._tree is not None

    def open(self, scene: Scene, terms: Mapping[str, Any], outputs: Mapping[str, Any]) -> None:
        """Read the checkpoint that the run is to go on from, and see that it is one of this run.

        Args:
            scene: what is run.
            terms: terms that a script adds.
            outputs: outputs that it asks for.

        Raises:
            SceneError: there is none, or it is damaged, or of another run; or there is nothing to go on with.
        """
        if self.every is None and not self.resume:
            return
        option = "--resume" if self.resume else "--checkpoint"
        if scene.time is None:
            raise SceneError("command line", option, None, "needs a scene with [time]; a steady state has no steps")
        if scene.model.reduced:
            raise SceneError("command line", option, None, "has no meaning with model.reduced, which takes no steps")
        if self.folder is None:
            raise SceneError("command line", option, None, "needs a folder")
        self._identity, path, end = identity(scene, terms, outputs), self.folder.path / CHECKPOINT, scene.time.end

        def read(files: ResultSet) -> Tree:
            with checkpoint_of(path):
                tree = read_checkpoint(path)
                check_identity(path, tree, self._identity, end)
            return tree

        if self.resume:
            self._tree = self.folder.first_does(read)
            self.every = self.every or self._tree["every"]

    def finished(self, scene: Scene) -> Tree | None:
        """Return the summary in the folder if it is that of this run, done; None otherwise."""
        if self.folder is None:
            return None
        summary = self.folder.first_does(lambda files: read_summary(files.folder))
        is_done = summary.get("command") == "run" and summary.get("status") == "done"
        return summary if is_done and comparable(summary.get("scene")) == comparable(scene.digest()) else None

    def setting(self) -> Setting | None:
        """Return the setting of the run that goes on, which an accuracy or a tolerance has led to; None without."""
        if self._tree is None or self._tree["settings"] is None:
            return None
        return Setting(**self._tree["settings"])

    def interrupts(self) -> Interrupts:
        """Return the context in which a march is interrupted between steps, where that is needed."""
        self._interrupts = Interrupts(self.comm, self._secure, self.comm.size > 1 or self.every is not None)
        return self._interrupts

    def start(self, run: Memory) -> State | None:
        """Begin the set of a run; return the state that it goes on from, if it does.

        Raises:
            OutputError: the folder cannot be written.
            SceneError: the checkpoint does not fit.
        """
        self._run, self._talked, self._next = run, (monotonic(), run.log.steps), 0
        if self.folder is None:
            return None
        state, path = None, self.folder.path / CHECKPOINT
        if self._tree is not None:
            with checkpoint_of(path):
                state = run.put_back(path, self._tree)
            run.log.resumed.append({"time": state.t, "ranks": self.comm.size})
        keep = (CHECKPOINT,) if self._tree is not None else ()
        self._tree = None  # a richer model would start afresh

        def begin(files: ResultSet) -> None:
            files.begin("running", keep)
            self._live = files.grow("history.csv", run.record.history)

        self.folder.first_does(begin)
        self._written = monotonic()
        return state

    def stepped(self, state: State) -> None:
        """Take note of the end of a step.

        Raises:
            Stopped: a signal has asked one of the ranks to end.
        """
        if self._live is not None:
            self._live.update()
        (asked, due), left = self._agreed(), self._left(state)
        fixed = self._run is not None and self._run.time.step is not None
        # The last state that a run with a later end would have met, too, is kept; none after it.
        if left >= 1 - 1e-6 and (asked or due or (fixed and left < 2 - 1e-6)):
            self._save(state)
        if asked and self._interrupts.active:
            raise Stopped

    def _agreed(self) -> tuple[bool, bool]:
        """Return whether a signal has come to one of the ranks, and whether a checkpoint is due, the same on all.

        Ranks talk to each other after so many steps only as take about `TALK` on rank 0: they need not meet in between.
        """
        asked, every = self._interrupts.asked, self.every
        steps = 0 if self._run is None else self._run.log.steps
        due = isinstance(every, int) and steps > 0 and steps % every == 0
        if self.comm.size > 1 and steps < self._next:
            return False, due
        late = isinstance(every, float) and steps > 0 and monotonic() - self._written >= every
        if self.comm.size > 1:
            now = monotonic()
            pace, self._talked = (now - self._talked[0]) / max(1, steps - self._talked[1]), (now, steps)
            told = self.comm.allgather((asked, late, pace))
            asked, (_, late, pace) = any(rank[0] for rank in told), told[0]
            self._next = steps + max(1, int(TALK / max(pace, 1e-9)))
        return asked, due or late

    def _left(self, state: State) -> float:
        """Return how many more steps there are at least; of adaptive ones whether there is one."""
        assert self._run is not None
        time = self._run.time
        return (time.end - state.t) / (time.step or 1e-9 * time.end)

    def _save(self, state: State) -> None:
        """Write a checkpoint."""
        if self.folder is None or self._run is None or self.every is None:
            return
        tree = self._run.taken(state, self._identity) | {"every": self.every}
        if self.folder.set is not None:
            try:
                write_checkpoint(self.folder.path / CHECKPOINT, tree)
            except OutputError as error:
                if not self._failed:
                    self._run.log.warnings.append(
                        f"a checkpoint could not be written at t = {state.t:.6g} s: {error.reason}"
                    )
                self._failed = True
        self._written = monotonic()

    def _secure(self) -> None:
        """Put on disk at once what can be."""
        if self._live is None or self.folder is None or self.folder.set is None:
            return
        self._live.flush()
        self.folder.set.mark("interrupted")
