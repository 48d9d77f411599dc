"""Steady state: how much a beam is stretched by its own rotation.

At constant speed a straight beam is at rest in the frame of the hub. Its axial equilibrium (Simo & Vu-Quoc 1986, eq. 2
with u₂ = α = 0, where all theories agree) is that of a rod whose load grows with its own displacement,

    EA u₁'' + A_ρ ψ̇² (X + u₁) = 0,      u₁(0) = 0,  u₁'(L) = 0,

    u₁(L) = sin(kL) / (k cos kL) − L,      k = ψ̇ √(A_ρ / EA),

about A_ρ ψ̇² L³ / 3EA while that is small. The stretch becomes infinite at kL = π/2, where the centrifugal force grows
faster than the elastic one; for this beam that is 759 rad/s, far beyond any material. A scene without [time] asks for
the steady state.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from _demo import FIRST_RANK, command_line, report, save
from matplotlib.figure import Figure

import rotfem

SCENE = Path(__file__).with_name("spin_up.toml")
SPEEDS = np.linspace(10.0, 100.0, 10)  # rad/s


def exact(speed: np.ndarray | float) -> np.ndarray | float:
    """Return u₁(L) (m) of the beam in spin_up.toml at a speed (rad/s)."""
    length, k = 10.0, speed * np.sqrt(1.2 / 2.8e7)
    return np.sin(k * length) / (k * np.cos(k * length)) - length


REFERENCE = float(exact(SPEEDS[-1]))


def main(figure: Path | None = None) -> float:
    """Return the displacement of the tip, u₁(L) (m), at 100 rad/s."""
    scene = rotfem.load_scene(SCENE).replace({"time": None, "motion": {"type": "constant", "speed": 0.0}})
    stretch = [float(rotfem.run(scene.replace({"motion.speed": w})).history["tip_u1"][0]) for w in SPEEDS]
    report(f"u1 of the tip at {SPEEDS[-1]:g} rad/s", stretch[-1], REFERENCE, "m")
    if figure is not None and FIRST_RANK:
        plot(stretch, figure)
    return stretch[-1]


def plot(stretch: list[float], path: Path) -> None:
    """Draw computed and exact stretch over the speed."""
    picture = Figure(figsize=(8, 4), layout="constrained")
    axis = picture.subplots()
    fine = np.linspace(1.0, 100.0, 200)
    axis.plot(fine, exact(fine), lw=1.2, label="exact")
    axis.plot(fine, 1.2 * fine**2 * 10.0**3 / (3 * 2.8e7), "--", lw=1, label="A_ρ ψ̇² L³ / 3EA")
    axis.plot(SPEEDS, stretch, "o", ms=5, label="rotfem")
    axis.set(title="Steady stretch of a spinning beam", xlabel="speed ψ̇ (rad/s)", ylabel="tip displacement u₁ (m)")
    axis.grid(True, lw=0.4, alpha=0.6)
    axis.legend()
    save(picture, path)


if __name__ == "__main__":
    command_line(main)
