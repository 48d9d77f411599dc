"""Writes docs/hard-cases.md from the cases and what became of them.

    ./with-fenicsx python tests/hard/page.py try [PATTERN]   try the cases whose key contains a pattern, and record it
    ./with-fenicsx python tests/hard/page.py write           write the page from the record

Each case is tried in a process of its own, which is ended when its time is over.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
RECORD = HERE / "record.json"
sys.path.insert(0, str(ROOT))

from tests.hard.case import MEANINGS, Case, attempt  # noqa: E402
from tests.hard.catalogue import catalogue  # noqa: E402


def tried(case: Case) -> dict[str, Any]:
    """Return what becomes of a case in a process of its own: class, error, what was said, seconds."""
    begin = perf_counter()
    command = [sys.executable, __file__, "one", case.key]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=case.seconds, check=False)
    except subprocess.TimeoutExpired:
        return {"found": "endless", "error": None, "said": f"{case.seconds:g} s", "seconds": case.seconds}
    lines = done.stdout.strip().splitlines()
    if done.returncode or not lines:
        said = (done.stderr.strip().splitlines() or [f"status {done.returncode}"])[-1]
        return {"found": "crashed", "error": None, "said": said, "seconds": perf_counter() - begin}
    return {**json.loads(lines[-1]), "seconds": round(perf_counter() - begin, 2)}


def record(pattern: str = "") -> None:
    """Try the cases whose key contains a pattern; record what became of them."""
    out = json.loads(RECORD.read_text(encoding="utf-8"))
    for case in catalogue():
        if pattern in case.key:
            out[case.key] = now = tried(case)
            print(f"{now['found']:8} {case.expected:8} {now['seconds']:6.1f} s  {case.key}", flush=True)
            RECORD.write_text(json.dumps(out, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def page() -> str:
    """Return the page."""
    found = json.loads(RECORD.read_text(encoding="utf-8"))
    cases = [case for case in catalogue() if case.key in found]
    count = Counter(found[case.key]["found"] for case in cases)
    lines = [
        "# Hard cases",
        "",
        "Scenes that break codes of this kind, each with what is right for it and the class its computation must be",
        "in. `tests/hard` holds them; `tests/hard/page.py` writes this page from its record. Cases marked * are left",
        "to the nightly suite (`./with-fenicsx pytest -m nightly tests/hard`).",
        "",
        "| class | cases | meaning |",
        "|---|---|---|",
        *(f"| {name} | {count[name]} | {meaning} |" for name, meaning in MEANINGS.items()),
        f"| all | {len(cases)} | |",
    ]
    for topic in dict.fromkeys(case.topic for case in cases):
        lines += ["", f"## {topic[0].upper()}{topic[1:]}", ""]
        lines += ["| case | must be | is | error / tolerance | reference |", "|---|---|---|---|---|"]
        lines += [row(case, found[case.key]) for case in cases if case.topic == topic]
    return "\n".join(lines) + "\n"


def row(case: Case, found: dict[str, Any]) -> str:
    """Return the row of a case."""
    error = "" if found["error"] is None else f"{found['error']:.1e} / {case.tolerance:.0e}"
    star = "\\*" if case.nightly else ""
    return f"| {case.name} | {case.expected} | {found['found']}{star} | {error} | {case.source} |"


if __name__ == "__main__":
    verb, *rest = sys.argv[1:]
    if verb == "one":
        chosen = next(case for case in catalogue() if case.key == rest[0])
        print(json.dumps(asdict(attempt(chosen))))
    elif verb == "try":
        record(*rest)
    else:
        (ROOT / "docs" / "hard-cases.md").write_text(page(), encoding="utf-8")
