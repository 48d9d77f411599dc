"""Linear theory of Kane, Ryan & Banerjee: linearised about the stretch of the axis.

Kane, Ryan & Banerjee (1987) took the elongation of the axis for a coordinate. In terms of strains that is the
von Kármán measure (von_karman.py), and its work on the axial force N⁰ gives the stiffness

    ∫ N⁰ u₂' δu₂' dX,      N⁰ = ½ A_ρ ψ̇² (L² − X²) for R = 0

(Simo & Vu-Quoc 1986, eq. 23, corrected in docs/theory.md). Without shear, α = u₂', this is the stiffness of
consistent_linear.py, since α δu₂' + u₂' δα − α δα = u₂' δu₂' then. With shear the two families differ by terms of the
order N⁰/GA_s, here 2e-4 of a term that is itself small: the peaks agree to 1e-9 m.
"""

from __future__ import annotations

from pathlib import Path

from _demo import command_line, plot_tip, report

import rotfem

SCENE = Path(__file__).with_name("spin_up.toml")
REFERENCE = -0.574448568  # m, at t = 6.762 s; Legendre–Galerkin in space, collocation in time, converged


def main(figure: Path | None = None) -> float:
    """Return the largest lag of the tip, min u₂ (m)."""
    result = rotfem.run(rotfem.load_scene(SCENE).replace({"model.theory": "von_karman_linear"}))
    peak = result.summary["figures"]["tip_u2_min"]
    report("min u2 at the tip", peak, REFERENCE, "m")
    plot_tip({"von_karman_linear": result.history}, figure, "Spin-up, linear theory of Kane, Ryan & Banerjee")
    return peak


if __name__ == "__main__":
    command_line(main)
