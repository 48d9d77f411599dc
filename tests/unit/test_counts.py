"""What computations cost in counts that no other load of the machine changes, against `counts.json`.

    ./with-fenicsx python3 tests/unit/test_counts.py     # writes the table anew

What is counted: calls of Python functions of the package in a step or at a speed, factorisations and iterations of
Newton's method in a step, matrices assembled, eigenproblems and the vectors of their Krylov spaces, forms compiled, and
bytes of matrices for each unknown. A change that makes one larger is seen here before a clock shows it. One that makes
it smaller is to be noted in the table, so that it stays.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import rotfem
from rotfem.commands.problem import Problem
from rotfem.equations import model as model_module
from rotfem.numerics import eigenproblem, forms
from tests.beams import STRUCTURE

TABLE = Path(__file__).with_name("counts.json")

#: Part by which a count may differ: other versions of Python, FEniCSx and SLEPc have other counts.
TOLERANCE = 0.15

BEAM: dict[str, Any] = {
    "structure": {
        "type": "planar_beam",
        "length": 10.0,
        "section": STRUCTURE["section"],
    },
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


@contextmanager
def counted() -> Iterator[Counter[str]]:
    """Count calls in the package, and what is patched here, until the end of the block."""
    counts: Counter[str] = Counter()
    package = str(Path(rotfem.__file__).parent)

    def seen(frame: Any, event: str, _: Any) -> None:
        if event == "call" and frame.f_code.co_filename.startswith(package):
            counts["calls"] += 1

    def patched(holder: Any, name: str, what: str, size: Callable[..., int] = lambda *_: 1) -> None:
        real = getattr(holder, name)

        def wrapper(*arguments: Any, **named: Any) -> Any:
            counts[what] += size(*arguments)
            return real(*arguments, **named)

        patch.setattr(holder, name, wrapper)

    def krylov(pep: Any, *arguments: Any) -> Any:
        found = real_found(pep, *arguments)
        counts["eigenproblems"] += 1
        counts["krylov_products"] += pep.getIterationNumber() * pep.getDimensions()[1]
        return found

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(model_module, "_KNOWN", {})  # of tests before this one
        patched(forms, "_compiled", "forms_compiled", lambda _, several, *__: len(several))
        patched(forms.Assembler, "__call__", "matrices_assembled")
        real_found = eigenproblem.Pencil._found
        patch.setattr(eigenproblem.Pencil, "_found", staticmethod(krylov))
        sys.setprofile(seen)
        try:
            yield counts
        finally:
            sys.setprofile(None)


def of_a_step(tables: dict[str, Any], steps: int) -> dict[str, float]:
    """Return counts for a step of a run: those of so many steps taken off those of twice as many."""
    found = []
    for number in (2 * steps, steps, 2 * steps):  # the first one compiles, where the cache of forms is empty
        time = {"time": {"end": 0.02 * number, "step": 0.02}, "output": {"error": False}}
        with counted() as counts:
            summary = rotfem.run(tables | time).summary
        found.append(counts | {name: summary[name] for name in ("factorisations", "newton_iterations")})
    names = ("calls", "factorisations", "newton_iterations")
    return {name: (found[2][name] - found[1][name]) / steps for name in names}


def of_a_diagram(tables: dict[str, Any], number: int) -> dict[str, float]:
    """Return counts of a Campbell diagram of so many speeds, its calls for each speed, and bytes for each unknown."""
    speeds = [0.5 * i for i in range(number)]
    with counted() as counts:
        rotfem.campbell(tables, speeds, orders=0)
    system = Problem.of(tables).system()
    entries = sum(p.operator.getInfo()["nz_used"] for p in system.pieces if p.kind in "MCK")
    out: dict[str, float] = {name: counts[name] for name in sorted(counts) if name != "calls"}
    return out | {"calls": counts["calls"] / number, "bytes": 12 * entries / system.A.getSize()[0]}


CASES: dict[str, Callable[[], dict[str, float]]] = {
    "step of a beam": lambda: of_a_step(BEAM, 100),
    "step of a linear beam": lambda: of_a_step(BEAM | LINEAR, 100),
    "step of a plate": lambda: of_a_step(PLATE | {"mesh": {"elements": [4, 4]}}, 10),
    "diagram of a linear beam, 20 speeds": lambda: of_a_diagram(BEAM | LINEAR | STILL, 20),
    "diagram of a linear plate, 3 speeds": lambda: of_a_diagram(PLATE | LINEAR | STILL, 3),
}


@pytest.mark.parametrize("case", CASES)
def test_counts_are_those_of_the_table(case: str) -> None:
    """Exact to TOLERANCE, small numbers to one."""
    known, found = json.loads(TABLE.read_text(encoding="utf-8"))[case], CASES[case]()
    assert found.keys() == known.keys()
    for name, value in found.items():
        assert value == pytest.approx(known[name], rel=TOLERANCE, abs=0.02), f"{case}, {name}: see {TABLE.name}"


if __name__ == "__main__":
    table = {case: {name: round(value, 3) for name, value in made().items()} for case, made in CASES.items()}
    TABLE.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
