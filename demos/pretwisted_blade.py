"""Campbell diagram of a pretwisted blade: how pretwist couples flap and lag.

A straight blade that is not twisted flaps out of the plane of rotation or lags in it, and neither knows of the other.
Twisted by β(X), each section bends about axes of its own: with v and w the deflections in the plane and out of it, for
a slender blade,

    W = ½ ∫ EI_2 (w'' cos β − v'' sin β)² + EI_3 (v'' cos β + w'' sin β)² + N (v'² + w'²) − m Ω² v² dX,

    N = ½ m Ω² (L² − X²),

so that v and w are coupled by (EI_3 − EI_2) sin β cos β. Without twist, the 1st flapwise mode rises faster than the
1st edgewise one, for N stiffens both but m Ω² softens lag only, and *crosses* it. With twist the two *veer*: they come
close, exchange their character, and do not cross. A branch keeps the name it had at rest; what it is at a speed is
told by its shares of the kinetic energy and by its `mode` there.

The number is the lowest frequency at 12 rad/s, lag with a trace of flap, though its branch is 1st flapwise. As a check,
the blade without twist has the flap frequencies of Wright et al. 1982.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from _demo import FIRST_RANK, command_line, report, save, say
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import rotfem

SCENE = Path(__file__).with_name("pretwisted_blade.toml")
REFERENCE = 11.8603317  # rad/s; Legendre–Ritz of W with 14 … 22 functions a field, no shear and no stretch
WRIGHT = (13.170, 37.603, 79.615)  # rad/s: 1st flapwise, 2, 3 at 12 rad/s without twist; table 1 of the paper

Branches = dict[str, dict[str, np.ndarray]]


def main(figure: Path | None = None) -> float:
    """Return the lowest frequency (rad/s) of the pretwisted blade at 12 rad/s."""
    scene = rotfem.load_scene(SCENE)
    straight = rotfem.campbell(scene.replace({"structure.pretwist": 0.0}), "0:12:25", orders=1).branches()
    for name, printed in zip(("1st flapwise", "2nd flapwise", "3rd flapwise"), WRIGHT, strict=True):
        say(f"without twist, {name} at 12 rad/s: {straight[name]['frequency'][-1]:.3f} rad/s, printed {printed:.3f}")
    result = rotfem.campbell(scene, "0:12:25", orders=1)
    twisted = result.branches()
    last = {row["label"]: row["mode"] for row in result.rows}
    for name, branch in twisted.items():
        f, lag = branch["frequency"], branch["share_lag"]
        say(
            f"{name:12s} {f[0]:8.4f} … {f[-1]:8.4f} rad/s, share of lag {lag[0]:.2f} … {lag[-1]:.2f}: "
            f"{last[name]} at 12 rad/s, least confidence {branch['confidence'].min():.2f}"
        )
    flap, lag = twisted["1st flapwise"], twisted["1st edgewise"]
    gap = lag["frequency"] - flap["frequency"]
    nearest = int(np.argmin(gap))
    say(f"1st flapwise and 1st edgewise come to {gap[nearest]:.3f} rad/s, at {flap['speed'][nearest]:.2f} rad/s")
    lowest = float(flap["frequency"][-1])
    report("lowest frequency at 12 rad/s", lowest, REFERENCE, "rad/s")
    if figure is not None and FIRST_RANK:
        plot(straight, twisted, figure)
    return lowest


def plot(straight: Branches, twisted: Branches, path: Path) -> None:
    """Draw the frequencies of both blades over the speed, and what 1st flapwise and 1st edgewise are made of."""
    picture = Figure(figsize=(10, 6), layout="constrained")
    grid = picture.add_gridspec(2, 2, width_ratios=(3, 2))
    whole, close = picture.add_subplot(grid[:, 0]), picture.add_subplot(grid[0, 1])
    shares = picture.add_subplot(grid[1, 1], sharex=close)
    for i, name in enumerate(twisted):
        draw(whole, twisted[name], "frequency", f"C{i}", name)
    for i, branch in enumerate(straight.values()):
        draw(whole, branch, "frequency", None, "without twist" if i == 0 else None)
    for i, name in enumerate(("1st flapwise", "1st edgewise")):
        for axis, column in ((close, "frequency"), (shares, "share_lag")):
            draw(axis, straight[name], column, None, None)
            draw(axis, twisted[name], column, f"C{i}", name)
    whole.set(xlabel="speed Ω (rad/s)", ylabel="frequency in the rotating frame (rad/s)", xlim=(0, 12), ylim=(0, 108))
    whole.legend(fontsize="small", loc="upper left", ncols=3)
    whole.set_title("Campbell diagram, 45° of pretwist")
    close.set(ylabel="frequency (rad/s)", xlim=(8, 12), ylim=(9, 13.5))
    close.set_title("1st flapwise and 1st edgewise exchange their character")
    shares.set(xlabel="speed Ω (rad/s)", ylabel="share of lag", ylim=(-0.03, 1.03))
    save(picture, path)


def draw(axis: Axes, branch: dict[str, np.ndarray], column: str, color: str | None, label: str | None) -> None:
    """Draw a column of a branch over the speed, dashed and grey without a colour."""
    style = {"ls": "--", "lw": 1.0, "color": "0.45"} if color is None else {"lw": 1.6, "color": color}
    axis.plot(branch["speed"], branch[column], label=label, **style)
    axis.grid(True, lw=0.4, alpha=0.6)


if __name__ == "__main__":
    command_line(main)
