"""Every hard case is in the class it must be in; docs/hard-cases.md lists them all."""

from __future__ import annotations

import re
import signal
from typing import Any

import pytest

from tests.hard.case import Case, attempt
from tests.hard.catalogue import catalogue
from tests.launch import ROOT

CASES = catalogue()


def parameters(case: Case) -> Any:
    return pytest.param(case, id=case.key, marks=[pytest.mark.nightly] if case.nightly else [])


def too_long(signum: int, frame: Any) -> None:
    raise TimeoutError("the case did not end in the time allowed")


@pytest.mark.parametrize("case", [parameters(case) for case in CASES])
def test_case(case: Case) -> None:
    before = signal.signal(signal.SIGALRM, too_long)
    signal.alarm(int(4 * case.seconds))  # a cold compilation, a busy machine
    try:
        outcome = attempt(case)
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
    assert outcome.found == case.expected, outcome
    if case.words and case.expected != "right":
        assert re.search(case.words, outcome.said), outcome.said


def test_the_page_lists_the_cases_as_they_are() -> None:
    page = (ROOT / "docs" / "hard-cases.md").read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if line.startswith("| ")]
    for case in CASES:
        assert any(f"| {case.name} |" in row and f"| {case.expected} |" in row for row in rows), case.key
