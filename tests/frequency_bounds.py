"""Cases from benign to hopeless: what round-off really does to frequencies, beside the bound that is told.

`python -m tests.frequency_bounds` prints the table; `tests/verification/test_frequency_bounds.py` holds it to the
bounds. The first kind has its truth in 50 digits (`timoshenko_decimal`). The second makes axial and shear stiffness so
large that they are without influence: a frequency is then a smooth function of 1/EA (of a plate, of its thickness), and
the parabola through three values where round-off does no harm holds the truth at all others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from rotfem import ModesResult, Problem, modes
from rotfem.analysis.modal import ModalAnalysis
from rotfem.errors import ComputationError
from rotfem.numerics.eigenproblem import Pencil
from tests import timoshenko_decimal


@dataclass(frozen=True)
class Row:
    """One mode of one case: |λ − truth|/|λ|, its bound, and how well the truth is known."""

    case: str
    mode: int
    error: float
    bound: float
    uncertainty: float = 0.0

    @property
    def ratio(self) -> float:
        """Error over bound (and uncertainty of the truth)."""
        return self.error / (self.bound + self.uncertainty)


def slender_beam(slenderness: float, elements: int) -> dict[str, Any]:
    """Return a scene of a planar cantilever at rest, EI = L = m = 1."""
    s = slenderness
    section = {"EA": 1 / s**2, "GA": 0.4 / s**2, "EI": 1.0, "mass_per_length": 1.0, "rotary_inertia": s**2}
    return {
        "structure": {"type": "planar_beam", "length": 1.0, "section": section},
        "motion": {"type": "constant", "speed": 0.0},
        "model": {"theory": "linear"},
        "mesh": {"elements": elements},
        "modes": {"count": 4},
    }


def stiff_beam(theory: str, elements: int) -> Callable[[float], dict[str, Any]]:
    """Return p ↦ scene of a spinning planar beam with EA = GA = 1/p."""

    def scene(p: float) -> dict[str, Any]:
        section = {"EA": 1 / p, "GA": 1 / p, "EI": 1.4e4, "mass_per_length": 1.2, "rotary_inertia": 6e-4}
        return {
            "structure": {"type": "planar_beam", "length": 10.0, "hub_radius": 1.0, "section": section},
            "motion": {"type": "constant", "speed": 6.0},
            "model": {"theory": theory},
            "mesh": {"elements": elements},
            "modes": {"count": 4},
        }

    return scene


def twisted_beam(p: float) -> dict[str, Any]:
    """Return a scene of a pretwisted spatial beam with EA = GA = 1/p."""
    section = {"EA": 1 / p, "GA2": 1 / p, "GA3": 1 / p, "GJ": 1e4, "EI2": 1.4e4, "EI3": 5.6e4}
    section |= {"mass_per_length": 1.2, "rotary_inertia2": 6e-4, "rotary_inertia3": 1e-3}
    return {
        "structure": {"type": "spatial_beam", "length": 10.0, "pretwist": 0.8, "section": section},
        "motion": {"type": "constant", "speed": 0.0},
        "model": {"theory": "consistent_linear"},
        "mesh": {"elements": 8},
        "modes": {"count": 4},
    }


def strip(length: float) -> Callable[[float], dict[str, Any]]:
    """Return h ↦ scene of a strip of width 1 and thickness h, with unit bending stiffness and mass per length."""

    def scene(h: float) -> dict[str, Any]:
        plate = {"length": length, "width": 1.0, "thickness": h, "nu": 0.3, "E": 12 / h**3, "rho": 1 / h}
        return {
            "structure": {"type": "plate", **plate},
            "motion": {"type": "constant", "speed": 0.0},
            "model": {"theory": "consistent_linear"},
            "mesh": {"elements": [8, 2]},
            "modes": {"count": 3},
        }

    return scene


def in_decimals() -> Iterator[Row]:
    """Yield the cases whose truth is computed in 50 digits."""
    for elements in (4, 16, 64):
        for slenderness in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7):
            truth = np.array(timoshenko_decimal.frequencies(elements, slenderness))
            scene, name = slender_beam(slenderness, elements), f"{elements} elements, r/L {slenderness:g}"
            yield from _rows(f"{name}, K", plain(scene), truth)
            yield from _rows(name, of_modes(scene), truth)


def in_the_limit() -> Iterator[Row]:
    """Yield the cases whose truth is a limit."""
    families: list[tuple[str, Callable[[float], dict[str, Any]], float, tuple[float, ...]]] = [
        ("consistent_linear, spinning", stiff_beam("consistent_linear", 16), 1e-9, (1e-10, 1e-12, 1e-14)),
        ("reissner, spinning", stiff_beam("reissner", 8), 1e-9, (1e-10, 1e-12, 1e-14)),
        ("spatial beam, pretwist", twisted_beam, 1e-8, (1e-10, 1e-12, 1e-14)),
        ("strip 10:1", strip(10.0), 1e-3, (2e-4, 1e-4, 1e-5)),
        ("strip 30:1", strip(30.0), 1e-3, (1e-4, 3e-5, 1e-5)),
    ]
    for name, scene, first, places in families:
        at = first * np.array([1.0, 0.5, 0.25])
        benign = [modes(scene(float(p))) for p in at]
        known = np.array([column(result, "frequency") for result in benign])
        sure = np.array([column(result, "error_bound") for result in benign])
        for p in places:
            weights = [np.prod([(p - q) / (at[i] - q) for q in at if q != at[i]]) for i in range(3)]
            uncertainty = np.abs(weights) @ sure + np.abs(weights @ known / known[-1] - 1) ** 1.5
            yield from _rows(f"{name}, {p:g}", of_modes(scene(p)), weights @ known, uncertainty)


def column(result: ModesResult, name: str) -> Any:
    """Return a column of the first three modes that do not stretch or shear the axis or mid-surface."""
    return np.array([row[name] for row in result.rows if not row["label"].endswith(("axial", "in-plane"))][:3])


def of_modes(scene: dict[str, Any]) -> tuple[Any, Any]:
    """Return (λ, bounds) as `rotfem.modes` gives them."""
    result = modes(scene)
    return result.eigenvalues, result.column("error_bound")


def plain(scene: dict[str, Any]) -> tuple[Any, Any]:
    """Return (λ, bounds) of M, C and K as they are assembled, without what keeps their digits; none if it fails."""
    analysis = ModalAnalysis(Problem.of(scene))
    analysis.equilibrium(0.0)
    try:
        pairs = Pencil(*analysis.system.mass_damping_stiffness()).solve(4)
    except ComputationError:
        return np.zeros(0), np.zeros(0)
    return pairs.values, pairs.bounds


def _rows(name: str, told: tuple[Any, Any], truth: Any, uncertainty: Any = (0.0,) * 3) -> Iterator[Row]:
    """Yield a row for each frequency of the truth; none where the computation says itself that it failed."""
    found, bounds = told
    left = list(range(len(found)))
    for i, omega in enumerate(truth[: len(found)]):
        # Of hopeless cases the order of the modes means nothing: a frequency is compared with the nearest.
        j = min(left, key=lambda j: abs(found[j] - 1j * omega) / abs(found[j]) / bounds[j])
        left.remove(j)
        error = float(abs(found[j] - 1j * omega) / abs(found[j]))
        yield Row(name, i + 1, error, float(bounds[j]), float(uncertainty[i]))


def main() -> None:
    """Print the table, and the largest and the median ratio."""
    rows = [*in_decimals(), *in_the_limit()]
    print(f"{'case':<44}{'mode':>5}{'error':>10}{'bound':>10}{'ratio':>8}")
    for row in rows:
        print(f"{row.case:<44}{row.mode:>5}{row.error:>10.1e}{row.bound:>10.1e}{row.ratio:>8.3f}")
    ratios = [row.ratio for row in rows]
    print(f"{len({row.case for row in rows})} cases, largest ratio {max(ratios):.2f}, median {np.median(ratios):.3f}")


if __name__ == "__main__":
    main()
