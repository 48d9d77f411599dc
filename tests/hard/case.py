"""A hard case: a scene, what is right for it, and the class its computation must be in.

A case is tried through the public interface alone, so that any version of the program can be held to it.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import tomli_w

#: What can become of a case, and what that means. The last three must not be.
MEANINGS = {
    "right": "the value is within the tolerance of the reference",
    "warned": "computed, and the summary says in these words what is doubtful",
    "refused": "one error before anything is computed, exit status 2",
    "failed": "one error with what was computed until then kept, exit status 3",
    "wrong": "another value than the reference, or none of the words that had to be said: **silently wrong**",
    "crashed": "a traceback",
    "endless": "not ended in the time allowed",
}


@dataclass(frozen=True)
class Case:
    """One hard case.

    Attributes:
        topic: what is hard, a section of the page.
        name: unique in its topic; a few words.
        scene: nested tables of the scene.
        value: result ↦ number or array that is compared; None where only the words count.
        reference: what it must be.
        tolerance: largest |value − reference| relative to the largest |reference| (to 1 where that is zero).
        source: where the reference comes from.
        command: verb of `rotfem`.
        options: further arguments of the verb.
        files: name ↦ text of files beside the scene.
        expected: class that the case must be in.
        words: regular expression that is found in the refusal, the failure or a warning.
        seconds: time after which the case counts as endless.
        nightly: whether the case is left out of the short suite.
    """

    topic: str
    name: str
    scene: Mapping[str, Any]
    value: Callable[[Any], npt.ArrayLike] | None = None
    reference: npt.ArrayLike | None = None
    tolerance: float = 0.0
    source: str = ""
    command: str = "run"
    options: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)
    expected: str = "right"
    words: str = ""
    seconds: float = 120.0
    nightly: bool = False

    @property
    def key(self) -> str:
        """Topic and name."""
        return f"{self.topic}: {self.name}"


@dataclass(frozen=True)
class Outcome:
    """What became of a case.

    Attributes:
        found: its class.
        error: of the value, relative as the tolerance; None where there is no value.
        said: refusal, failure or warnings.
    """

    found: str
    error: float | None = None
    said: str = ""


def attempt(case: Case) -> Outcome:
    """Return what becomes of a case, computed in a folder of its own."""
    import rotfem

    with tempfile.TemporaryDirectory() as folder:
        for name, text in case.files.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        scene = Path(folder) / "scene.toml"
        scene.write_text(tomli_w.dumps(dict(case.scene)), encoding="utf-8")
        try:
            result = getattr(rotfem, case.command)(scene, **case.options)
        except rotfem.ComputationError as error:
            return Outcome("failed", said=str(error))
        except rotfem.SceneError as error:
            return Outcome("refused", said=str(error))
        except Exception as error:
            return Outcome("crashed", said=f"{type(error).__name__}: {error}")
    return judged(case, result)


def judged(case: Case, result: Any) -> Outcome:
    """Return the class of a computed result."""
    said = "; ".join(str(line) for line in result.summary.get("warnings", ()))
    warned = bool(case.words) and re.search(case.words, said) is not None
    if case.value is None:
        return Outcome("warned" if warned else "wrong", said=said)
    error = distance(case.value(result), case.reference)
    if error <= case.tolerance and not (case.expected == "warned" and warned):
        return Outcome("right", error, said)
    return Outcome("warned" if warned else "wrong", error, said)


def distance(value: npt.ArrayLike, reference: npt.ArrayLike | None) -> float:
    """Return max|value − reference| / max|reference|; infinite where a value is missing or not finite."""
    found, wanted = np.atleast_1d(np.asarray(value, float)), np.atleast_1d(np.asarray(reference, float))
    if found.shape != wanted.shape or not np.all(np.isfinite(found)):
        return float("inf")
    largest = float(np.max(np.abs(wanted)))
    return float(np.max(np.abs(found - wanted)) / (largest or 1.0))
