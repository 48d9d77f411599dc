"""A spinning disk: waves that travel around it, and the speeds at which one of them stands still.

A disk has its modes with m nodal diameters in pairs. Seen from the disk both have the frequency ω(Ω), which the tension
from the centrifugal force raises; together they make waves that run around it one way or the other. Seen from the fixed
frame these have the frequencies

    forward  ω + mΩ        backward  ω − mΩ.

A load fixed in space, the guide of a saw, say, feeds a backward wave without end where that stands still, at ω = mΩ.
With m = 0 and 1 there is no such speed, for the tension alone keeps ω above mΩ.

At rest the two modes of a pair are any two standing ones, at any speed two travelling ones. Their frequencies part by
1e-5 to 1e-4 of their value, from the Coriolis force on the directors; the one against the spin is the higher. The
system has 9120 unknowns, so that its modes over the speed are computed in a basis of modes, see docs/theory.md.

The number is the critical speed of two nodal diameters, which is the lowest. The reference has the exact stresses of
the spinning disk, but is Kirchhoff's plate. At rest, that of Mindlin is 5.0e-4 below it at this thickness, 4e-5 at a
tenth of it, as the layer at the free edge is as wide as the plate is thick; this mesh is 1e-4 above a converged one.
"""

from __future__ import annotations

from pathlib import Path

from _demo import FIRST_RANK, command_line, report, save, say
from matplotlib.figure import Figure

import rotfem
from rotfem.results import CampbellResult

SCENE = Path(__file__).with_name("disk_campbell.toml")
REFERENCE = 213.464695  # rad/s; Legendre–Ritz with 14 functions of the radius, Kirchhoff's plate
AT_REST = {"0.1": 228.455147, "1.1": 219.521599, "2.1": 277.923571, "3.1": 503.007157}  # rad/s; Bessel functions


def main(figure: Path | None = None) -> float:
    """Return the speed (rad/s) at which the backward wave with two nodal diameters stands still."""
    scene = rotfem.load_scene(SCENE)
    for row in rotfem.modes(scene.replace({"motion.speed": 0.0})).rows:
        exact = AT_REST[row["label"].removeprefix("diameters ").rstrip("ab")]
        off = row["frequency"] / exact - 1
        say(f"at rest, {row['label']}: {row['frequency']:.4f} rad/s, Kirchhoff's plate {exact:.4f}, {off:+.1e}")
    result = rotfem.campbell(scene, "0:310:16", orders=3)
    critical = {}
    for c in result.critical_speeds:
        if c.kind == "backward":
            critical[c.label.removesuffix(" backward")] = c.speed
            say(f"{c.order} diameters: the backward wave stands still at {c.speed:.4f} rad/s")
    report("critical speed, 2 nodal diameters", critical["diameters 2.1"], REFERENCE, "rad/s")
    if figure is not None and FIRST_RANK:
        plot(result, critical, figure)
    return critical["diameters 2.1"]


def plot(result: CampbellResult, critical: dict[str, float], path: Path) -> None:
    """Draw the frequencies seen from the disk and from the fixed frame."""
    picture = Figure(figsize=(10, 5), layout="constrained")
    disk, fixed = picture.subplots(1, 2)
    waves = result.travelling_waves()
    umbrella = result.branches()["diameters 0.1"]
    disk.plot(umbrella["speed"], umbrella["frequency"], "k", lw=1.4, label="0 diameters")
    fixed.plot(umbrella["speed"], umbrella["frequency"], "k", lw=1.4)
    for i, (name, w) in enumerate(waves.items()):
        m, color = int(name.split()[1][0]), f"C{i}"
        disk.plot(w["speed"], (w["forward"] + w["backward"]) / 2, color=color, lw=1.4, label=f"{m} diameters")
        fixed.plot(w["speed"], w["forward"], color=color, lw=1.4)
        fixed.plot(w["speed"], w["backward"], "--", color=color, lw=1.4)
        if name in critical:
            speed = critical[name]
            disk.plot(w["speed"], m * w["speed"], ":", color=color, lw=1.0, label=f"{m}Ω")
            disk.plot(speed, m * speed, "o", color=color)
            fixed.plot(speed, 0, "o", color=color)
    disk.set(title="Seen from the disk", ylabel="frequency (rad/s)")
    fixed.set(title="Seen from the fixed frame: backward waves dashed", ylabel="frequency (rad/s)")
    for axis in (disk, fixed):
        axis.set(xlabel="speed Ω (rad/s)", xlim=(0, 310))
        axis.grid(True, lw=0.4, alpha=0.6)
    fixed.axhline(0.0, color="0.4", lw=0.7)
    disk.legend(fontsize="small")
    save(picture, path)


if __name__ == "__main__":
    command_line(main)
