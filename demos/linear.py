"""First-order theory: why a spinning beam must not be computed with linear strains.

With Γ₁ = u₁', Γ₂ = u₂' − α, κ = α' (Simo & Vu-Quoc 1986, eq. 5) the deflection of a thin beam obeys their eq. (6),

    A_ρ ü₂ + EI u₂'''' − A_ρ ψ̇² u₂ = −2 A_ρ ψ̇ u̇₁ − A_ρ ψ̈ (X + u₁).

The centrifugal force pushes a deflected beam further out (−A_ρ ψ̇² u₂), but the term that outweighs it in reality, the
stiffness −(N⁰u₂')' of the axial force N⁰, is of second order in the strains and missing. Thus the beam seems to lose
its stiffness at the speed ψ̇ = ω₁, its lowest frequency at rest:

    ψ̇_crit = 1.875104² √(EI / A_ρ L⁴)        (without shear, which lowers it by 3e-5 of that)

The spin-up to 6 rad/s passes that speed at t = 8.5 s; from there on the solution grows without bound. The program says
so, stops, and keeps what it had computed. Compare consistent_linear.py, which is just as linear.
"""

from __future__ import annotations

from pathlib import Path

from _demo import command_line, plot_tip, report, say

import rotfem

SCENE = Path(__file__).with_name("spin_up.toml")
REFERENCE = 1.8751040687**2 * (1.4e4 / (1.2 * 10.0**4)) ** 0.5  # rad/s


def main(figure: Path | None = None) -> float:
    """Return the speed (rad/s) at which the stiffness of the linear theory vanishes."""
    scene = rotfem.load_scene(SCENE).replace({"model.theory": "linear"})
    try:
        rotfem.run(scene)
    except rotfem.ComputationError as error:
        say(f"rotfem says: {error}")
        result = error.result
    else:
        raise RuntimeError("the linear theory should have diverged")
    critical = result.summary["figures"]["critical_speed"]
    report("critical speed", critical, REFERENCE, "rad/s")
    plot_tip({"linear": result.history}, figure, "Spin-up with linear strains: spurious divergence")
    return critical


if __name__ == "__main__":
    command_line(main)
