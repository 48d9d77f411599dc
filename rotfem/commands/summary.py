"""What the summaries of all commands have in common."""

from __future__ import annotations

from time import perf_counter
from typing import Any

from rotfem.analysis.modal import ModalAnalysis
from rotfem.scene import Scene
from rotfem.selection.model_choice import Choice
from rotfem.version import versions


def summary_of(
    analysis: ModalAnalysis, command: str, asked: Scene, choice: Choice | None, started: float
) -> dict[str, Any]:
    """Return what the summaries of modes and Campbell diagrams have in common.

    Args:
        analysis: what was solved.
        command: `modes` or `campbell`.
        asked: the scene as it was given; the model may have been chosen by its tolerance.
        choice: how it was, if so.
        started: `perf_counter()` at the start.
    """
    space, total = analysis.system.V.dofmap, perf_counter() - started
    return {
        "command": command,
        "status": "done",
        "name": asked.name,
        "theory": analysis.scene.model.theory,
        "about": "undeformed" if analysis.system.linear else analysis.scene.modes.about,
        "effects": list(analysis.model.effects),
        "dofs": space.index_map.size_global * space.index_map_bs,
        "timings": {**analysis.seconds, "other": total - sum(analysis.seconds.values()), "total": total},
        "versions": versions(),
        "ranks": analysis.comm.size,
        "scene": asked.to_dict(),
        **({} if choice is None else {"choice": choice.summary()}),
    }
