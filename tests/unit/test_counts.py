"""What computations cost, in counts that no other load of the machine changes.

Factorisations and iterations of Newton's method in a step; of a Campbell diagram eigenproblems, products in their
Krylov spaces, matrices assembled, and bytes of matrices for each unknown. A change that makes one larger is seen here
before a clock shows it; one that makes it smaller is to be noted here, so that it stays.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import pytest

import rotfem
from rotfem.commands.problem import Problem
from rotfem.numerics import eigenproblem, forms
from tests.beams import STRUCTURE

#: Part by which a count may differ: other versions of FEniCSx and SLEPc have other counts.
TOLERANCE = 0.15

BEAM: dict[str, Any] = {
    "structure": {"type": "planar_beam", "length": 10.0, "section": STRUCTURE["section"]},
    "mesh": {"elements": 4, "degree": 3},
    "motion": {"type": "spin_up", "speed": 6.0, "duration": 15.0},
}
PLATE: dict[str, Any] = {
    "structure": {"type": "plate", "length": 1.0, "width": 1.0, "thickness": 0.01, "E": 7e10, "nu": 0.3, "rho": 2700.0},
    "mesh": {"elements": [6, 6]},
    "motion": {"type": "spin_up", "speed": 20.0, "duration": 0.5, "axis": [0, 1, 0]},
}
LINEAR = {"model": {"theory": "consistent_linear"}}
STILL = {"motion": {"type": "constant", "speed": 0.0}, "modes": {"count": 5}}


@pytest.mark.parametrize(
    ("tables", "steps", "known"),
    [
        (BEAM, 100, (1.0, 1.0)),
        (BEAM | LINEAR, 100, (1.0, 1.0)),
        (PLATE | {"mesh": {"elements": [4, 4]}}, 10, (0.9, 8.1)),
    ],
    ids=["beam", "linear beam", "plate"],
)
def test_a_step(tables: dict[str, Any], steps: int, known: tuple[float, float]) -> None:
    """Factorisations and Newton iterations of a step: those of so many steps taken off those of twice as many."""
    found = []
    for number in (steps, 2 * steps):
        time = {"time": {"end": 0.02 * number, "step": 0.02}, "output": {"error": False}}
        summary = rotfem.run(tables | time).summary
        found.append([summary["factorisations"], summary["newton_iterations"]])
    for few, many, value in zip(*found, known, strict=True):
        assert (many - few) / steps == pytest.approx(value, rel=TOLERANCE, abs=0.02)


@pytest.mark.parametrize(
    ("tables", "number", "known"),
    [
        (BEAM, 20, {"eigenproblems": 3, "products": 162, "matrices": 26, "bytes": 507}),
        (PLATE, 3, {"eigenproblems": 9, "products": 522, "matrices": 26, "bytes": 2557}),
    ],
    ids=["beam, 20 speeds", "plate, 3 speeds"],
)
def test_a_diagram(
    monkeypatch: pytest.MonkeyPatch, tables: dict[str, Any], number: int, known: dict[str, float]
) -> None:
    counts: Counter[str] = Counter()
    found, assemble = eigenproblem.Pencil._found, forms.Assembler.__call__

    def krylov(pep: Any, *arguments: Any) -> Any:
        out = found(pep, *arguments)
        counts.update(eigenproblems=1, products=pep.getIterationNumber() * pep.getDimensions()[1])
        return out

    def assembled(self: Any, *arguments: Any, **named: Any) -> Any:
        counts["matrices"] += 1
        return assemble(self, *arguments, **named)

    monkeypatch.setattr(eigenproblem.Pencil, "_found", staticmethod(krylov))
    monkeypatch.setattr(forms.Assembler, "__call__", assembled)
    linear = tables | LINEAR | STILL
    rotfem.campbell(linear, [0.5 * i for i in range(number)], orders=0)
    made = dict(counts)
    system = Problem.of(linear).system()
    entries = sum(p.operator.getInfo()["nz_used"] for p in system.pieces if p.kind in "MCK")
    made["bytes"] = 12 * entries / system.A.getSize()[0]
    assert made == pytest.approx(known, rel=TOLERANCE)
