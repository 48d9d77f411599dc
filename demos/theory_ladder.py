"""All theories on the same spin-up: what each order of strain costs in accuracy.

The scene is that of spin_up.toml, 6 rad/s in 15 s. Peaks of the deflection are compared with that of the geometrically
exact theory; the step here, 0.02 s, shifts all of them by the same 6e-5.

    linear                                 diverges: softened by the centrifugal force, not stiffened   (linear.py)
    consistent_linear, von_karman_linear   linear equations, stiffened by N⁰
    second_order, von_karman               nonlinear, rotations of moderate size
    reissner                               exact

The picture in docs/demos.md is this demo's, saved with --figure docs/figures/spin_up.png.
"""

from __future__ import annotations

from pathlib import Path

from _demo import FIRST_RANK, History, command_line, in_every_theory, ladder, report, save

import rotfem

SCENE = Path(__file__).with_name("spin_up.toml")
REFERENCE = 100 * (0.574448569 / 0.573834759 - 1)  # %, from the references of consistent_linear.py and reissner.py


def main(figure: Path | None = None) -> float:
    """Return by how much (%) the peak of the consistent linear theory differs from the exact one."""
    scene = rotfem.load_scene(SCENE).replace({"time.step": 0.02, "time.output_every": 1})
    histories, peaks = in_every_theory(scene, "tip_u2")
    off = 100 * (peaks["consistent_linear"] / peaks["reissner"] - 1)
    report("consistent_linear against reissner", off, REFERENCE, "%")
    if figure is not None and FIRST_RANK:
        plot(histories, figure)
    return off


def plot(histories: dict[str, History], path: Path) -> None:
    """Draw the deflection of the tip, all theories, with the differences between them enlarged."""
    picture, axis = ladder(histories, "tip_u2", (0.6, 0.1, 0.38, 0.5))
    axis.set(ylim=(-1.5, 0.1), xlim=(0, 20), xlabel="time t (s)", ylabel="tip deflection u₂ (m)")
    axis.set_title("Spin-up to 6 rad/s in 15 s: the deflection of the tip in every theory")
    axis.annotate("linear: diverges", (7.2, -1.2), xytext=(8.2, -1.2), va="center", arrowprops={"arrowstyle": "->"})
    axis.legend(loc="lower left", fontsize="small")
    save(picture, path)


if __name__ == "__main__":
    command_line(main)
