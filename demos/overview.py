"""What the program is for, in one picture: a structure that turns, a shaft over speed, and three questions to a scene.

Above: a soft beam seen from outside, at sixteen instants of its spin-up, and the Campbell diagram of
shaft_on_bearings.toml in the fixed frame. Below: what accuracy costs, what each effect changes, and a hard case: a
blade as thin as a hair. With the slenderness its frequencies of flap tend to those of a string that its spin alone
holds,

    ω_n = Ω √(n (2n − 1)),

which the tension of a hair's 1e-12 of the bending stiffness has to give. The second one is the number of this demo.

The picture in README.md is this demo's, saved with --figure docs/figures/overview.png.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from _demo import FIRST_RANK, command_line, report, save
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

import rotfem

SCENE = Path(__file__).with_name("spin_up.toml")

REFERENCE = float(np.sqrt(6.0))  # of a string that its spin holds

SHAFT = Path(__file__).with_name("shaft_on_bearings.toml")


def hair(slenderness: float) -> dict[str, Any]:
    """Return a blade of 1 m, round, of so many radii of gyration, that turns with 10 rad/s."""
    section = {"shape": "circle", "radius": 2.0 / slenderness, "E": 70e9, "nu": 0.3, "rho": 2700.0}
    return {
        "structure": {"type": "spatial_beam", "length": 1.0, "section": section},
        "motion": {"type": "constant", "speed": 10.0, "axis": [0, 0, 1]},
        "mesh": {"elements": 12, "degree": 4},
        "modes": {"count": 8},
    }


def flaps(slenderness: float) -> list[float]:
    """Return the first three frequencies of flap over the speed."""
    rows = rotfem.modes(rotfem.Scene.from_dict(hair(slenderness))).rows
    return [row["frequency"] / 10.0 for row in rows if "out-of-plane" in row["label"]][:3]


def main(figure: Path | None = None) -> float:
    """Return the second frequency of flap of the hair over its speed."""
    thin = flaps(1e6)
    report("2nd flap of the hair over its speed", thin[1], REFERENCE, "Ω")
    if figure is not None:
        draw(figure)
    return thin[1]


def draw(path: Path) -> None:
    """Draw the picture."""
    figure = Figure(figsize=(12, 7.6), layout="constrained")
    above, below = figure.subfigures(2, 1, height_ratios=(1.15, 1.0))
    turning, campbell = above.subplots(1, 2, width_ratios=(1.0, 1.5))
    cost, effects, hard = below.subplots(1, 3)
    draw_turning(turning)
    draw_campbell(campbell)
    draw_cost(cost)
    draw_effects(effects)
    draw_hard(hard)
    if FIRST_RANK:
        save(figure, path)


def draw_turning(ax: Axes) -> None:
    """Draw a beam of a twentieth of the stiffness at sixteen instants, a sixteenth of a turn apart."""
    soft = {"structure.section.EI": 700.0, "output.stations": 41, "output.error": False}
    result = rotfem.run(rotfem.load_scene(SCENE).replace(soft))
    stations, history = result.stations, result.history
    psi = np.interp(stations.t, history["t"], history["psi"])
    colors = colormaps["viridis"]
    for k in range(16):
        asked = 3.0 + 12.0 * k / 16
        off = np.abs((psi - 2 * np.pi * k / 16 + np.pi) % (2 * np.pi) - np.pi)
        i = int(np.argmin(off + 1e3 * (np.abs(stations.t - asked) > 1.2)))
        x, y = stations.x + stations.values["u1"][i], stations.values["u2"][i]
        c, s = np.cos(psi[i]), np.sin(psi[i])
        ax.plot(c * x - s * y, s * x + c * y, lw=3, color=colors((stations.t[i] - 3) / 12))
    ax.set(aspect="equal", xlabel="x (m), fixed frame", ylabel="y (m)", title="A beam spins up to 6 rad/s in 15 s")
    ax.figure.colorbar(ScalarMappable(Normalize(3, 15), colors), ax=ax, label="time (s)", shrink=0.8)


def draw_campbell(ax: Axes) -> None:
    """Draw the whirls of the shaft over its speed."""
    diagram = rotfem.campbell(SHAFT, "0:12000:21rpm")
    rpm, hertz = 60 / (2 * np.pi), 1 / (2 * np.pi)
    styles = {"forward whirl": ("C0", "-"), "backward whirl": ("C1", "--"), "torsion": ("C2", "-")}
    for k, label in enumerate(diagram.labels):
        number, kind = label.split(" ", 1)
        color, dashes = styles[kind]
        ax.plot(
            diagram.speeds * rpm,
            diagram.frequencies[:, k] * hertz,
            color=color,
            ls=dashes,
            label=kind if number == "1st" else None,
        )
    ax.plot(diagram.speeds * rpm, diagram.speeds * hertz, color="0.3", lw=0.8, ls=":", label="speed of the shaft")
    found = [(c.speed * rpm, c.frequency * hertz) for c in diagram.critical_speeds if c.kind != "per_rev" and c.branch]
    ax.plot(*zip(*found, strict=True), "ko", ms=5, label="critical speed")
    ax.set(
        xlabel="speed (rpm)", ylabel="frequency (Hz), fixed frame", title="Campbell diagram of a shaft with two disks"
    )
    ax.grid(True, lw=0.4, alpha=0.6)
    ax.legend(fontsize=9, loc="upper left")


def draw_cost(ax: Axes) -> None:
    """Draw error over time of two theories."""
    result = rotfem.cost(
        rotfem.load_scene(SCENE), theories=["consistent_linear", "reissner"], schemes=["esdirk4"], accuracy=1e-4
    )
    for theory, color in (("consistent_linear", "C2"), ("reissner", "C0")):
        rows = [row for row in result.rows if row["theory"] == theory and row["status"] == "done"]
        ax.loglog([r["cost"] for r in rows], [r["total_error"] for r in rows], "o-", color=color, label=theory)
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_xticks([0.1, 0.2, 0.5], ["0.1", "0.2", "0.5"])
    ax.set(xlabel="CPU time of a run (s)", ylabel="error of the tip's motion (–)", title="What accuracy costs")
    ax.grid(True, lw=0.4, alpha=0.6)
    ax.legend(loc="lower left", fontsize=9)


def draw_effects(ax: Axes) -> None:
    """Draw how far the tip's motion is in error without each effect."""
    found = rotfem.explain(SCENE).effects
    names = [name.replace("_", " ") for name in found]
    ax.barh(names, [row["worst"] for row in found.values()], color="C3")
    ax.axvline(1e-2, color="0.3", lw=0.8, ls="--", label="1 %")
    ax.legend(fontsize=9)
    ax.invert_yaxis()
    ax.set(xscale="log", xlabel="change of the answer without it (–)", title="What each effect changes")
    ax.grid(True, axis="x", lw=0.4, alpha=0.6)


def draw_hard(ax: Axes) -> None:
    """Draw the frequencies of flap over the slenderness, and those of the string."""
    slenderness = np.logspace(1.5, 6, 10)
    found = np.array([flaps(s) for s in slenderness])
    for n in (1, 2, 3):
        ax.axhline(np.sqrt(n * (2 * n - 1)), color="0.3", lw=0.8, ls="--", label="string" if n == 1 else None)
        ax.loglog(slenderness, found[:, n - 1], "o-", label=f"flap {n}")
    ax.set(
        xlabel="length / radius of gyration (–)",
        ylabel="frequency / speed (–)",
        title="A hard case: a blade as thin as a hair",
    )
    ax.grid(True, lw=0.4, alpha=0.6)
    ax.legend()


if __name__ == "__main__":
    command_line(main)
