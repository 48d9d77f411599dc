"""How long a setting will take and how much memory it will need, from those that were measured. No dolfinx in it."""

from __future__ import annotations

from collections.abc import Iterable
from math import exp, log
from typing import Any

import numpy as np

from rotfem import registry
from rotfem.commands.cost.record import Measurement
from rotfem.commands.cost.settings import Setting

#: Exponents over the number of unknowns where one size only was measured, by the dimension of the mesh: a band of
#: fixed width, or a factor of a plane graph by nested dissection.
TIME_EXPONENT, MEMORY_EXPONENT = {1: 1.0, 2: 1.4}, {1: 1.0, 2: 1.15}

#: Exponent of time that is believed at most.
STEEPEST = 2.2

#: Bytes for an unknown at least, where small systems show nothing but what every one needs.
LEAST_MEMORY = 1500.0

#: Sizes must differ by this factor for an exponent to be taken from them.
SPREAD = 1.7

#: Multiples of the largest number of unknowns that are predicted.
AHEAD = (4, 16)


class Prediction:
    """Time and memory of settings.

    Args:
        dimension: of the mesh.
        end: length of the history, s; 0 where there is none.
    """

    def __init__(self, dimension: int, end: float):
        self.dimension, self.end = dimension, end
        self.known: dict[Setting, Measurement] = {}

    def learn(self, setting: Setting, measurement: Measurement) -> None:
        """Take up what was measured of a setting."""
        if measurement.status == "done" and measurement.wall:
            self.known[setting] = measurement

    def of(self, setting: Setting) -> dict[str, float | None]:
        """Return the predicted `cpu` time (s, with set-up) and `memory` (bytes), None where unknown."""
        if setting in self.known:
            m = self.known[setting]
            return {"cpu": m.cost, "memory": m.memory}
        if not self.known:
            return {"cpu": None, "memory": None}
        near = min(self.known, key=lambda other: self._far(setting, other))
        m, larger = self.known[near], nodes(setting, self.dimension) / nodes(near, self.dimension)
        dofs = max(m.dofs, 1)
        grown = self.time(near.theory, dofs * larger) / self.time(near.theory, dofs)
        march = grown * self._steps(setting, near) * stages(setting) / stages(near)
        return {
            "cpu": m.median("setup_cpu") * max(larger, 1.0) + m.median("cpu") * march,
            "memory": self.memory(near.theory, m.dofs * larger),
        }

    def time(self, theory: str, dofs: float) -> float:
        """Return the CPU time (s) of so many unknowns, of a step where there are some: what every size takes, and more.

        The rest grows with the power of large systems, or a steeper one that was measured: two small sizes alone would
        seem to grow with next to none.
        """
        sizes, p = self._sizes(theory), TIME_EXPONENT[self.dimension]
        large = sizes[-1] if sizes else {"dofs": 1.0, "time": 1.0}
        n, t = large["dofs"], max(large["time"], 1e-9)
        small = [size for size in sizes if SPREAD * size["dofs"] <= n and size["time"] > 0.0]
        if small:
            n0, t0 = small[-1]["dofs"], small[-1]["time"]
            p = max(p, min(log(t / t0) / log(n / n0), STEEPEST))
            growing = min(max(t - t0, 0.0) / (1.0 - (n0 / n) ** p), t)
        else:
            growing = t
        return float(t - growing + growing * (dofs / n) ** p)

    def memory(self, theory: str, dofs: float) -> float | None:
        """Return the bytes that so many unknowns need: what every size does, and a power of their number."""
        sizes = self._sizes(theory)
        if not sizes:
            return None
        floor, large = min(size["memory"] for size in sizes), sizes[-1]
        excess = max(large["memory"] - floor, LEAST_MEMORY * large["dofs"])
        return float(floor + excess * (dofs / large["dofs"]) ** MEMORY_EXPONENT[self.dimension])

    def scaling(self) -> list[dict[str, Any]]:
        """Return time (s, CPU, of a step or in all) and memory (bytes) over the unknowns, by theory, and predictions.

        What is predicted, for some multiples of the largest number of unknowns that was measured, says so.
        """
        out = []
        for theory in dict.fromkeys(s.theory for s in self.known):
            sizes = self._sizes(theory)
            if len(sizes) < 2:
                continue
            out += [{"theory": theory, **size, "predicted": False} for size in sizes]
            for factor in AHEAD:
                dofs = factor * sizes[-1]["dofs"]
                ahead = {"time": self.time(theory, dofs), "memory": self.memory(theory, dofs)}
                out.append({"theory": theory, "dofs": dofs, **ahead, "predicted": True})
        return out

    def _sizes(self, theory: str) -> list[dict[str, float]]:
        """Return unknowns, time of a step (or in all, where there are none) and memory, one of each size, by size."""
        found: dict[int, list[tuple[float, float]]] = {}
        for s, m in self.known.items():
            if s.theory == theory and m.dofs:
                per = m.median("cpu") / (m.steps * stages(s)) if s.scheme and m.steps else m.cost
                found.setdefault(m.dofs, []).append((per, m.memory))
        out = []
        for dofs, values in sorted(found.items()):
            times, memories = zip(*values, strict=True)
            out.append({"dofs": dofs, "time": float(np.median(times)), "memory": float(max(memories))})
        return out

    def _steps(self, setting: Setting, near: Setting) -> float:
        """Return the ratio of the numbers of steps."""
        if setting.scheme is None:
            return 1.0
        if setting.step is None and near.step is None and setting.tolerance and near.tolerance:
            return float((near.tolerance / setting.tolerance) ** (1 / (order(setting) + 1)))
        return self._count(setting) / self._count(near)

    def _count(self, setting: Setting) -> float:
        if setting.step is not None:
            return self.end / setting.step
        known = self.known.get(setting)
        return float(known.steps) if known is not None else max(m.steps for m in self.known.values())

    def _far(self, one: Setting, other: Setting) -> float:
        """Return how far a measured setting is from one to be predicted."""
        linear = registry.theories[one.theory].linear != registry.theories[other.theory].linear
        far = 2.0 * linear + 0.2 * (one.theory != other.theory) + 0.5 * (one.scheme != other.scheme)
        far += abs(log(nodes(one, self.dimension) / nodes(other, self.dimension)))
        if one.step is not None and other.step is not None:
            return far + 0.3 * abs(log(one.step / other.step))
        if one.tolerance is not None and other.tolerance is not None:
            return far + 0.1 * abs(log(one.tolerance / other.tolerance))
        return far + (one.scheme is not None)


def nodes(setting: Setting, dimension: int) -> float:
    """Return the number of nodes, that of a mesh file in units of its own."""
    if setting.elements is None:
        return float(setting.degree**dimension)
    counts = setting.elements if isinstance(setting.elements, tuple) else (setting.elements,)
    return float(np.prod([n * setting.degree + 1 for n in counts]))


def stages(setting: Setting) -> int:
    """Return the number of stages of the setting's scheme."""
    return 1 if setting.scheme is None else registry.schemes[setting.scheme].stages


def order(setting: Setting) -> int:
    """Return the order of the setting's scheme."""
    return 1 if setting.scheme is None else registry.schemes[setting.scheme].order


def power_law(points: Iterable[tuple[float, float]], lowest: float, highest: float) -> tuple[float, float] | None:
    """Return (c, p) of e ≈ c xᵖ through the two points with the smallest x, p within bounds; None without points.

    Args:
        points: (x, e), both greater than 0.
        lowest: least power, taken where there is one point only.
        highest: greatest power.
    """
    found = sorted(points)[:2]
    if not found:
        return None
    p = lowest
    if len(found) == 2 and found[1][0] > found[0][0]:
        p = float(np.clip(log(found[1][1] / found[0][1]) / log(found[1][0] / found[0][0]), lowest, highest))
    x, e = found[0]
    return exp(log(e) - p * log(x)), p
