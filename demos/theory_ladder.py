"""All theories on the same spin-up: what each order of strain costs in accuracy.

The scene is that of spin_up.toml, 6 rad/s in 15 s. Peaks of the deflection are compared with that of the geometrically
exact theory; the step here, 0.02 s, shifts all of them by the same 6e-5.

    linear                                 diverges: softened by the centrifugal force, not stiffened   (linear.py)
    consistent_linear, von_karman_linear   linear equations, stiffened by N⁰
    second_order, von_karman               nonlinear, rotations of moderate size
    reissner                               exact

The picture in the README is this demo's, saved with --figure docs/figures/spin_up.png.
"""

from __future__ import annotations

from pathlib import Path

from _demo import FIRST_RANK, History, command_line, report, save, say
from matplotlib.figure import Figure

import rotfem

SCENE = Path(__file__).with_name("spin_up.toml")
THEORIES = ("linear", "consistent_linear", "von_karman_linear", "second_order", "von_karman", "reissner")
REFERENCE = 100 * (0.574448569 / 0.573834759 - 1)  # %, from the references of consistent_linear.py and reissner.py


def main(figure: Path | None = None) -> float:
    """Return by how much (%) the peak of the consistent linear theory differs from the exact one."""
    scene = rotfem.load_scene(SCENE).replace({"time.step": 0.02, "time.output_every": 1})
    histories, peaks = {}, {}
    for theory in THEORIES:
        try:
            result = rotfem.run(scene.replace({"model.theory": theory}))
        except rotfem.ComputationError as error:
            say(f"{theory:18s} diverged at t = {error.time:.2f} s")
            result = error.result
        else:
            peaks[theory] = result.summary["figures"]["tip_u2_min"]
        histories[theory] = result.history
    off = {theory: 100 * (peak / peaks["reissner"] - 1) for theory, peak in peaks.items()}
    for theory, peak in peaks.items():
        say(f"{theory:18s} min u2 at the tip {peak:.6f} m, {off[theory]:+.3f} % of reissner")
    report("consistent_linear against reissner", off["consistent_linear"], REFERENCE, "%")
    if figure is not None and FIRST_RANK:
        plot(histories, figure)
    return off["consistent_linear"]


def plot(histories: dict[str, History], path: Path) -> None:
    """Draw the deflection of the tip, all theories, with the differences between them enlarged."""
    picture = Figure(figsize=(9, 4.5), layout="constrained")
    axis = picture.subplots()
    inset = axis.inset_axes((0.6, 0.1, 0.38, 0.5), xlim=(6.2, 7.4), ylim=(-0.5775, -0.563))
    styles = {"linear": "-", "consistent_linear": "-", "von_karman_linear": ":"}
    for theory, h in histories.items():
        for panel in (axis, inset):
            panel.plot(h["t"], h["tip_u2"], styles.get(theory, "--"), lw=1.6, label=theory)
    axis.lines[-1].set(color="black", lw=1.0, ls="-")
    inset.lines[-1].set(color="black", lw=1.0, ls="-")
    axis.indicate_inset_zoom(inset, edgecolor="grey")
    inset.tick_params(labelsize="x-small")
    axis.set(ylim=(-1.5, 0.1), xlim=(0, 20), xlabel="time t (s)", ylabel="tip deflection u₂ (m)")
    axis.set_title("Spin-up to 6 rad/s in 15 s: the deflection of the tip in every theory")
    axis.annotate("linear: diverges", (7.2, -1.2), xytext=(8.2, -1.2), va="center", arrowprops={"arrowstyle": "->"})
    axis.grid(True, lw=0.4, alpha=0.6)
    axis.legend(loc="lower left", fontsize="small")
    save(picture, path)


if __name__ == "__main__":
    command_line(main)
