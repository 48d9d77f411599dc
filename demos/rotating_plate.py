"""A rotating plate in every theory: a strip that is spun up about an axis in its plane.

The strip is the beam of spin_up.toml, with ν = 0, so what is known of the beam holds for it: the linear theory runs
away once the speed is above the lowest frequency at rest, 3.8 rad/s; the others differ by less than 0.5 % at the peak.

The number is that peak in the geometrically exact theory; its reference is the beam's, a converged Legendre–Galerkin
value. Two differences, which no mesh removes, make what is left at this step:

    the step of 0.01 s                                          −8e-6 m, as for the beam
    Green's strains of the plate against Reissner's of the beam  +1.2e-5 m, strain (8e-5) times deflection in size

With the step of 0.004 s the plate gives −0.573823 m and the beam −0.573836 m. Twice as many elements change 4e-7 m.
"""

from __future__ import annotations

from pathlib import Path

from _demo import FIRST_RANK, History, command_line, report, save, say
from matplotlib.figure import Figure

import rotfem

SCENE = Path(__file__).with_name("rotating_plate.toml")
BEAM = Path(__file__).with_name("spin_up.toml")
THEORIES = ("linear", "consistent_linear", "von_karman_linear", "second_order", "von_karman", "reissner")
REFERENCE = -0.573834759  # m, of the beam: Legendre–Galerkin


def main(figure: Path | None = None) -> float:
    """Return the largest deflection (m) of the strip's tip in the geometrically exact theory."""
    scene = rotfem.load_scene(SCENE)
    step = {"time.end": scene.time.end, "time.step": scene.time.step, "time.output_every": 1}
    beam = rotfem.run(rotfem.load_scene(BEAM).replace(step)).summary["figures"]["tip_u2_min"]
    histories, peaks = {}, {}
    for theory in THEORIES:
        try:
            result = rotfem.run(scene.replace({"model.theory": theory}))
        except rotfem.ComputationError as error:
            say(f"{theory:18s} diverged at t = {error.time:.2f} s")
            result = error.result
        else:
            peaks[theory] = float(result.summary["figures"]["tip_u3_min"])
        histories[theory] = result.history
    for theory, peak in peaks.items():  # of the linear theory, where it has come to at the end
        say(f"{theory:18s} min u3 at the tip {peak:.6f} m, {100 * (peak / peaks['reissner'] - 1):+.3f} % of reissner")
    off = peaks["reissner"] - beam
    say(f"the beam of spin_up.toml at the same step: {beam:.6f} m, the plate {off:+.1e} m beside it")
    report("reissner, min u3 at the tip", peaks["reissner"], REFERENCE, "m")
    if figure is not None and FIRST_RANK:
        plot(histories, figure)
    return peaks["reissner"]


def plot(histories: dict[str, History], path: Path) -> None:
    """Draw the deflection of the tip in all theories, with the differences between them enlarged."""
    picture = Figure(figsize=(9, 4.5), layout="constrained")
    axis = picture.subplots()
    inset = axis.inset_axes((0.1, 0.12, 0.36, 0.5), xlim=(6.2, 7.4), ylim=(-0.5775, -0.563))
    styles = {"linear": "-", "consistent_linear": "-", "von_karman_linear": ":", "reissner": "-"}
    for theory, h in histories.items():
        for panel in (axis, inset):
            panel.plot(h["t"], h["tip_u3"], styles.get(theory, "--"), lw=1.6, label=theory)
    for panel in (axis, inset):
        panel.lines[-1].set(color="black", lw=1.0)
    axis.indicate_inset_zoom(inset, edgecolor="grey")
    inset.tick_params(labelsize="x-small")
    axis.set(ylim=(-1.5, 0.1), xlim=(0, 8), xlabel="time t (s)", ylabel="tip deflection u₃ (m)")
    axis.set_title("A strip spun up about an axis in its plane: the deflection of its tip in every theory")
    axis.grid(True, lw=0.4, alpha=0.6)
    axis.legend(loc="upper right", fontsize="small")
    save(picture, path)


if __name__ == "__main__":
    command_line(main)
