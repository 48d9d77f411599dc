"""Campbell diagram: the frequencies of a spinning beam over its speed, and where they meet those of the excitation.

Small motions about the steady state at constant speed obey the gyroscopic eigenproblem

    (λ² M + λ C + K) x = 0,      λ = σ + iω,

with C skew from the Coriolis force, which couples bending in the plane (lag) with extension (axial). As the speed
stiffens the one and softens the other, their frequencies approach each other, but do not cross: they *veer*, and the
two modes exchange their character. Branches are followed by the bi-orthogonality of left and right vectors, with more
speeds where it takes them, and each keeps the name it has at the first speed.

What acts k times a revolution excites at the frequency kΩ. The number of this demo is the speed at which the first
branch meets 1Ω, where an imbalance fixed in space would resonate.
"""

from __future__ import annotations

from pathlib import Path

from _demo import FIRST_RANK, command_line, report, save, say

import rotfem

SCENE = Path(__file__).with_name("campbell.toml")
REFERENCE = 8.8572904  # rad/s; Legendre–Galerkin with 18 functions a field, all digits converged


def main(figure: Path | None = None) -> float:
    """Return the speed (rad/s) at which the first frequency is that of the rotation."""
    result = rotfem.campbell(SCENE, "0:10:21")
    summary = result.summary
    say(f"{summary['speeds']} speeds asked for, {summary['speeds_inserted']} inserted to follow the modes")
    for name, branch in result.branches().items():
        shares = branch["share_lag"]
        say(
            f"{name:8s} {branch['frequency'][0]:9.4f} … {branch['frequency'][-1]:9.4f} rad/s, share of lag in its "
            f"kinetic energy {shares[0]:.2f} … {shares[-1]:.2f}, least confidence {branch['confidence'].min():.2f}"
        )
    (meeting,) = [c for c in summary["critical_speeds"] if c["label"] == "1st edgewise" and c["per_rev"] == 1]
    report("1st edgewise meets 1Ω at", meeting["speed"], REFERENCE, "rad/s")
    if figure is not None and FIRST_RANK:
        save(result.plot(), figure)
    return float(meeting["speed"])


if __name__ == "__main__":
    command_line(main)
