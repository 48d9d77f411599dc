"""A shaft as it is built, with its steps, disks and bearings, and its modes in three dimensions with their orbits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from matplotlib.markers import CARETUP
from matplotlib.patches import Rectangle

from rotfem.results.plots import VISIBLE, dress, heading
from rotfem.results.plots_campbell import style_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rotfem.results.modes import ModesResult

Array = npt.NDArray[np.float64]

#: Places of orbits, and the angle that one is drawn over: the gap shows its sense.
ORBITS, TURN = 11, np.linspace(0.0, 1.85 * np.pi, 60)

#: Height of the thickest part of a shaft in pictures of modes, whose largest displacement is 1.
THICK = 0.35


def outline(structure: dict[str, Any]) -> tuple[Array, Array, Array]:
    """Return places x, two at a step, with outer and inner radius there (m); a radius of 0 where none is known.

    Args:
        structure: tables of a spatial beam.
    """
    section = structure.get("section", {})

    def profile(name: str) -> tuple[Array, Array]:
        value = section.get(name)
        rows = value if isinstance(value, list) else [[0.0, value if isinstance(value, float) else 0.0]]
        x, y = np.array(rows).T
        return x, y

    outer = profile("radius" if section.get("radius") else "outer_radius")
    others = [profile(name) for name in ("inner_radius", "wall")]
    tiny = 1e-9 * structure["length"]
    at = np.unique(np.concatenate([p for x, _ in (outer, *others) for p in (x - tiny, x + tiny)]))
    at = at[(at > 0.0) & (at < structure["length"])]
    at = np.concatenate([[0.0], at, [structure["length"]]])
    r, inner, wall = (np.interp(at, *p) for p in (outer, *others))
    return at, r, np.where(wall > 0.0, r - wall, inner)


def disks(structure: dict[str, Any]) -> list[tuple[float, float, float]]:
    """Return x, radius and width (m) of the round solid disk that has the mass and inertias of each mass; 0 of none."""
    out = []
    for mass in structure.get("masses", ()):
        m, inertia = float(mass.get("mass") or 0.0), np.array(mass.get("inertia") or np.zeros((3, 3)), dtype=float)
        polar, across = (inertia[0, 0], inertia[1, 1]) if inertia.ndim == 2 else (0.0, 0.0)
        square = 2.0 * polar / m if m > 0.0 else 0.0
        width = np.sqrt(max(12.0 * (across / m - square / 4.0), 0.0)) if m > 0.0 else 0.0
        out.append((float(mass["x"]), float(np.sqrt(square)), float(width)))
    return out


def draw_shaft(axis: Axes, structure: dict[str, Any]) -> None:
    """Draw a shaft from the side, in its true proportions."""
    x, r, inner = outline(structure)
    axis.fill_between(x, r, -r, color="0.85", lw=0.0)
    for sign in (1.0, -1.0):
        axis.plot(x, sign * r, "k", lw=0.8)
        axis.plot(x, np.where(inner > 0.0, sign * inner, np.nan), "k--", lw=0.6)
    axis.vlines([x[0], x[-1]], [-r[0], -r[-1]], [r[0], r[-1]], color="k", lw=0.8)
    found = disks(structure)
    for n, (at, radius, width) in enumerate(found):
        box = Rectangle((at - width / 2, -radius), max(width, 0.004 * x[-1]), 2 * radius)
        box.set(facecolor="C0", edgecolor="k", lw=0.8, alpha=0.6)
        axis.add_patch(box)
        axis.plot(at, 0.0, "ko", ms=3, label="_" if n else "mass, as a solid disk of its inertia")
    size = max([float(np.max(r)), 0.03 * x[-1], *(radius for _, radius, _ in found)])
    for n, support in enumerate(structure.get("supports", ())):
        at, under = float(support["x"]), len(support.get("housing", ()))
        places = -float(np.interp(support["x"], x, r)) - 0.3 * size * np.arange(under + 1)
        if under:
            axis.plot([at] * (under + 1), places, "k-s", lw=0.8, ms=6, mfc="white", markevery=range(1, under + 1))
        axis.plot(at, places[-1], marker=CARETUP, ms=12, mfc="C2", mec="k", ls="", label="_" if n else "support")
    axis.margins(0.03, 0.15)
    axis.set_aspect("equal", adjustable="datalim")
    axis.legend(fontsize=7, loc="lower left", bbox_to_anchor=(0.0, 1.02), ncols=2, frameon=False)
    dress(axis, "x (m)", "radius (m)")


def whirl_figure(result: ModesResult) -> Figure:
    """Return the modes of a shaft in three dimensions: the deflected line, orbits, the shaft at rest, disks, bearings.

    An orbit begins at a dot. Torsion and stretch are drawn across.
    """
    shown, structure = result.with_shapes(), result.summary["scene"]["structure"]
    columns = min(3, len(shown))
    rows = -(-len(shown) // columns)
    figure = Figure(figsize=(4.4 * columns, 2.9 * rows + 0.5))
    figure.suptitle(f"{heading(result)}, largest displacement 1; dots begin the orbits", fontsize=10)
    figure.subplots_adjust(0.01, 0.03, 0.99, 1.0 - 0.5 / (2.9 * rows + 0.5), 0.02, 0.1)
    x, r, _ = outline(structure)
    thick = THICK / max([float(np.max(r)), 1e-300, *(radius for _, radius, _ in disks(structure))])
    for i, (row, shape, frequency) in enumerate(shown):
        axis: Any = figure.add_subplot(rows, columns, i + 1, projection="3d")
        nodes, style = shape["x"], style_of(row["label"])
        y, z, twist, stretch = (shape[n] + 1j * shape[f"{n}_imag"] for n in ("u2", "u3", "theta1", "u1"))
        what = ""
        if max(np.max(np.abs(y)), np.max(np.abs(z))) <= VISIBLE:
            twists = np.max(np.abs(twist)) > np.max(np.abs(stretch))
            y, what = (twist, ", twist across") if twists else (stretch, ", stretch across")
        for a, b in ((0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0)):
            axis.plot(x, a * thick * r, b * thick * r, color="0.7", lw=0.7)
        for at, radius, _ in disks(structure):
            here = [0.0 if what else float(np.interp(at, nodes, part.real)) for part in (y, z)]
            ring = thick * radius * np.exp(1j * np.linspace(0.0, 2 * np.pi, 40))
            axis.plot(np.full(40, at), here[0] + ring.real, here[1] + ring.imag, color="0.3", lw=1.2)
        for support in structure.get("supports", ()):
            axis.plot([support["x"]], [0.0], [-THICK / 2], "^", ms=6, mfc="C2", mec="k")
        axis.plot(nodes, y.real, z.real, lw=2.0, **style)
        for n in np.unique(np.linspace(0, len(nodes) - 1, ORBITS).round().astype(int)) if not what else ():
            p, q = (np.real(part[n] * np.exp(1j * TURN)) for part in (y, z))
            axis.plot(np.full(len(p), nodes[n]), p, q, color=style["color"], lw=0.8)
            axis.plot(nodes[n : n + 1], p[:1], q[:1], "o", ms=2.5, color=style["color"])
        axis.set(ylim=(-1, 1), zlim=(-1, 1), yticks=(-1, 0, 1), zticks=(-1, 0, 1), yticklabels=[], zticklabels=[])
        axis.set_box_aspect((2.4, 1.0, 1.0), zoom=1.1)
        axis.tick_params(labelsize=6, pad=-2)
        axis.set_xlabel("x (m)", fontsize=7)
        axis.set_ylabel("u₂ (–)", fontsize=7, labelpad=-10)
        axis.set_zlabel("u₃ (–)", fontsize=7, labelpad=-10)
        decrement = row.get("log_decrement")
        damped = f", δ = {decrement:.3g}" if decrement and abs(decrement) > 1e-9 else ""
        axis.set_title(f"{row['mode']}  {row['label']}, {frequency}{damped}{what}", fontsize=8, pad=0)
    return figure
