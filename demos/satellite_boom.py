"""A boom on a satellite that tumbles and is pushed: one motion in two descriptions, which must give one history.

The frame turns with w(t) about an axis askew to the boom, and its origin has the acceleration a_o(t). A point r of it
has the absolute acceleration (Simo & Vu-Quoc 1986, section 4)

    r̈ + 2 w×ṙ + w×(w×r) + ẇ×r + a_o.

Which point of the satellite is called the origin is a matter of words. With the origin moved from its centre to the
clamp, at b, every r becomes r − b, and what b did goes into the acceleration of the origin,

    a_o' = a_o + ẇ×b + w×(w×b),

so that centrifugal and Euler force of one description are base acceleration in the other. The motion of the boom
relative to the satellite is the same, whatever its theory, mesh or step, but for the kinks of the thrust: steps land on
those of a table, and not on those of the function that is a_o' here. The number is the largest difference
between the two, of any displacement of the tip, over the largest displacement. It sees every effect that depends on
where the origin is, at the boom as well as at the tip mass, whose centre is off the axis; Coriolis forces, which do
not, are the same in both.

Once the speed is constant and the thruster off, nothing but the integrator changes the Jacobi integral T2 − T0 + W.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from _demo import FIRST_RANK, History, command_line, report, save, say
from matplotlib.figure import Figure

import rotfem

SCENE = Path(__file__).with_name("satellite_boom.toml")
REFERENCE = 0.0  # exact
TIP = ("tip_u1", "tip_u2", "tip_u3")


def main(figure: Path | None = None) -> float:
    """Return the largest difference of the tip's displacement between two descriptions, relative to the largest."""
    scene = rotfem.load_scene(SCENE)
    motion, b = rotfem.Problem.of(scene).motion, np.array(scene.structure.root_position)

    def at_the_clamp(t: float) -> np.ndarray:
        w, dw = motion.speed(t) * motion.axis, motion.rate(t) * motion.axis
        return motion.base_acceleration(t) + np.cross(dw, b) + np.cross(w, np.cross(w, b))

    first = rotfem.run(scene)
    clamp = {"structure.hub_offset": [0.0, 0.0, 0.0], "motion.base_acceleration": at_the_clamp}
    second = rotfem.run(scene.replace(clamp))
    one, two = (np.array([run.history[name] for name in TIP]) for run in (first, second))
    for name, u in zip(TIP, one, strict=True):
        say(f"{name}: {u.min():+.5f} … {u.max():+.5f} m")
    t, jacobi, strain = (first.history[name] for name in ("t", "jacobi", "strain"))
    free = t >= 26.0
    change = np.ptp(jacobi[free]) / strain[free].max()
    say(f"after the thrust the Jacobi integral changes by {change:.1e} of the strain energy")
    difference = float(np.abs(one - two).max() / np.abs(one).max())
    report("difference between the descriptions, relative", difference, REFERENCE, "m/m")
    if figure is not None and FIRST_RANK:
        plot(motion, first.history, second.history, figure)
    return difference


def plot(motion: rotfem.Motion, first: History, second: History, path: Path) -> None:
    """Draw what the satellite does and what the tip makes of it, in both descriptions."""
    picture = Figure(figsize=(8, 6), layout="constrained")
    above, below = picture.subplots(2, sharex=True, height_ratios=(2, 3))
    t = first["t"]
    above.plot(t, first["psi_dot"], lw=1.4, color="C2", label="speed Ω (rad/s)")
    above.plot(t, [np.linalg.norm(motion.base_acceleration(s)) for s in t], lw=1.4, color="C3", label="|a_o| (m/s²)")
    above.set(title="Boom on a satellite that tumbles and is pushed", ylabel="motion of the satellite")
    for color, name, symbol in (("C0", "tip_u2", "u₂"), ("C1", "tip_u3", "u₃")):
        below.plot(t, first[name], lw=1.4, color=color, label=f"{symbol}, origin at the centre")
        below.plot(t[::20], second[name][::20], "o", ms=4, mfc="none", color=color, label=f"{symbol}, at the clamp")
    below.set(xlabel="time t (s)", ylabel="tip displacement (m)")
    for axis in (above, below):
        axis.grid(True, lw=0.4, alpha=0.6)
        axis.legend(fontsize="small")
    save(picture, path)


if __name__ == "__main__":
    command_line(main)
