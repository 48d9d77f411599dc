"""Figures of merit of a history."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def figures(history: dict[str, Array]) -> dict[str, float]:
    """Return the figures of merit of a history: extremes of tip and root, with times, final values, Jacobi drift.

    Extremes inside the history are those of the parabola through three neighbouring samples.
    """
    out: dict[str, float] = {}
    t = history["t"]
    if len(t) == 0:
        return out
    for name in [n for n in history if n.startswith(("tip_", "root_"))]:
        out[f"{name}_final"] = history[name][-1]
        if len(t) > 1:
            out[f"{name}_min_time"], out[f"{name}_min"] = extreme(t, history[name], -1)
            out[f"{name}_max_time"], out[f"{name}_max"] = extreme(t, history[name], 1)
    if len(t) > 1:
        scale = max(float(np.max(np.abs(history["kinetic"]))), float(np.max(np.abs(history["strain"]))), 1e-300)
        out["jacobi_change"] = (history["jacobi"][-1] - history["jacobi"][0]) / scale
    return {key: float(value) for key, value in out.items()}


def extreme(t: Array, y: Array, sign: int) -> tuple[float, float]:
    """Return (time, value) of the largest sign·y, by a parabola through the largest sample and its neighbours."""
    i = int(np.argmax(sign * y))
    if i in (0, len(y) - 1):
        return float(t[i]), float(y[i])
    c = np.polyfit(t[i - 1 : i + 2] - t[i], y[i - 1 : i + 2], 2)
    if c[0] * sign >= 0:
        return float(t[i]), float(y[i])
    s = -c[1] / (2 * c[0])
    return float(t[i] + s), float(np.polyval(c, s))
