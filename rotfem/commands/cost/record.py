"""What has been measured, kept on disk line by line, so that a study can be interrupted and gone on with."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rotfem.commands.cost.reference import Samples
from rotfem.commands.cost.settings import Setting
from rotfem.errors import OutputError
from rotfem.scene import Scene
from rotfem.version import __version__


@dataclass
class Measurement:
    """One setting, computed.

    Attributes:
        status: "done", "failed", or "stopped" where the time of the study was over.
        reason: why it failed.
        samples: the output, None where it failed.
        wall, cpu: of every repetition, s, without set-up.
        setup, setup_cpu: of every repetition, s: mesh, forms (compiled before, on disk), constant operators.
        memory: bytes at the height, above what the program needs by itself; of all processes.
        dofs, steps, iterations: sizes and counts.
    """

    status: str = "done"
    reason: str = ""
    samples: Samples | None = None
    wall: list[float] = field(default_factory=list)
    cpu: list[float] = field(default_factory=list)
    setup: list[float] = field(default_factory=list)
    setup_cpu: list[float] = field(default_factory=list)
    memory: float = 0.0
    dofs: int = 0
    steps: int = 0
    iterations: int = 0

    def median(self, name: str) -> float:
        """Return the median of `wall`, `cpu`, `setup` or `setup_cpu`, s; nan where nothing was measured."""
        values = getattr(self, name)
        return float(np.median(values)) if values else float("nan")

    @property
    def cost(self) -> float:
        """CPU time (s) of set-up and computation, by which settings are ranked; that of other programs is not in it."""
        return self.median("setup_cpu") + self.median("cpu")

    def to_json(self) -> dict[str, Any]:
        """Return a JSON-able dictionary."""
        return {**vars(self), "samples": self.samples.to_json() if self.samples else None}

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Measurement:
        """Return what `to_json` wrote."""
        samples = data["samples"]
        return cls(**{**data, "samples": Samples.from_json(samples) if samples else None})


def fingerprint(scene: Scene, output: str, ranks: int) -> str:
    """Return a hash of all that a measurement depends on besides its setting: scene, output, version, processes.

    A mesh file counts by its content, a Python function in the scene by its name only. What a measurement consists of
    counts too.
    """
    mesh = getattr(scene.structure, "mesh", None)
    content = hashlib.sha256(Path(mesh).read_bytes()).hexdigest() if mesh is not None else None
    of_what = sorted(vars(Measurement()))
    text = json.dumps([scene.to_dict(), content, output, __version__, ranks, of_what], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


class Record:
    """Measurements by setting; each is a line of a file as soon as it is there.

    A line is written whole, by one call; one cut short by a power failure is not read.

    Args:
        path: the file, or None to keep nothing.
        identity: fingerprint of the study; lines of another one are passed over.
        fresh: forget what the file holds.

    Raises:
        OutputError: the file cannot be written.
    """

    def __init__(self, path: Path | None, identity: str, fresh: bool = False):
        self.path, self.identity = path, identity
        self._found: dict[str, Measurement] = {}
        self._earlier: frozenset[str] = frozenset()
        self.resumed = 0
        if path is None:
            return
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            text = path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""
            if text and not text.startswith('{"study": '):
                raise FileExistsError(0, "it is there already, and no record of measurements")
            if fresh:
                path.unlink(missing_ok=True)
            else:
                self._read(text)
        except OSError as error:
            raise OutputError(path, error.strerror or str(error)) from None

    def _read(self, text: str) -> None:
        for line in text.splitlines():
            try:
                entry = json.loads(line)
                if entry["study"] == self.identity:
                    self._found[_text(entry["setting"])] = Measurement.from_json(entry["measurement"])
            except (ValueError, KeyError, TypeError):
                continue
        self._earlier = frozenset(self._found)
        self.resumed = len(self._found)

    def is_earlier(self, setting: Setting) -> bool:
        """Return whether the measurement of a setting comes from an earlier start."""
        return _text(setting.key()) in self._earlier

    def get(self, setting: Setting, repeat: int) -> Measurement | None:
        """Return the measurement of a setting, if there is one and it was repeated often enough."""
        found = self.find(setting)
        return found if found is not None and (found.status == "failed" or len(found.wall) >= repeat) else None

    def find(self, setting: Setting) -> Measurement | None:
        """Return the measurement of a setting, if there is one."""
        return self._found.get(_text(setting.key()))

    def put(self, setting: Setting, measurement: Measurement) -> None:
        """Keep a measurement.

        Raises:
            OutputError: the file cannot be written.
        """
        key = _text(setting.key())
        self._found[key] = measurement
        self._earlier -= {key}
        if self.path is None:
            return
        entry = {"study": self.identity, "setting": setting.key(), "measurement": measurement.to_json()}
        line = (json.dumps(entry) + "\n").encode()
        try:
            descriptor = os.open(self.path, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW, 0o666)
            try:
                end = os.lseek(descriptor, 0, os.SEEK_END)
                if end and os.pread(descriptor, 1, end - 1) != b"\n":
                    line = b"\n" + line  # a start that died in the middle of a line
                os.write(descriptor, line)
                os.fsync(descriptor)
            finally:
                os.close(descriptor)
        except OSError as error:
            raise OutputError(self.path, error.strerror or str(error)) from None


def _text(key: dict[str, Any]) -> str:
    return json.dumps(key, sort_keys=True)
