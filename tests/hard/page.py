"""Writes docs/hard-cases.md from the cases and what became of them before and after.

    ./with-fenicsx python tests/hard/page.py try RECORD.json [PATTERN]   try all cases with the rotfem that is imported
    ./with-fenicsx python tests/hard/page.py write                       write the page from both records

Each case is tried in a process of its own, which is ended when its time is over. The record of the code as it was
before is made by starting this file in a checkout of that code, with ROTFEM_TREE naming it.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path[:0] = [os.environ.get("ROTFEM_TREE", str(ROOT)), str(ROOT)]

from tests.hard.case import CLASSES, MEANINGS, Case, attempt  # noqa: E402
from tests.hard.catalogue import catalogue  # noqa: E402

#: The program as it was before these cases were tried.
BEFORE = "the code at commit 277dc66"


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


def record(path: Path, pattern: str = "") -> None:
    """Try the cases whose key contains a pattern; add what became of them to a record."""
    out = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    for case in catalogue():
        if pattern in case.key:
            out[case.key] = tried(case)
            print(
                f"{out[case.key]['found']:8} {case.expected:8} {out[case.key]['seconds']:6.1f} s  {case.key}",
                flush=True,
            )
            path.write_text(json.dumps(out, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def page() -> str:
    """Return the page."""
    before, after = (json.loads((HERE / f"{name}.json").read_text(encoding="utf-8")) for name in ("before", "after"))
    cases = [case for case in catalogue() if case.key in before and case.key in after]
    lines = [
        "# Hard cases",
        "",
        "Scenes that break codes of this kind, each with what is right for it and the class its computation must be",
        "in. `tests/hard` holds them; `tests/hard/page.py` writes this page from its records. Cases marked * are left",
        "to the nightly suite (`./with-fenicsx pytest -m nightly tests/hard`).",
        "",
        *(f"- **{name}**: {meaning}." for name, meaning in MEANINGS.items()),
        "",
        "## In all",
        "",
        f"Before is {BEFORE}, on the same cases.",
        "",
        "| | " + " | ".join(CLASSES) + " | all |",
        "|---|" + "---|" * (len(CLASSES) + 1),
    ]
    for name, found in (("before", before), ("now", after)):
        count = Counter(found[case.key]["found"] for case in cases)
        lines.append(f"| {name} | " + " | ".join(str(count[c]) for c in CLASSES) + f" | {len(cases)} |")
    for topic in dict.fromkeys(case.topic for case in cases):
        lines += ["", f"## {topic[0].upper()}{topic[1:]}", ""]
        lines += ["| case | must be | before | now | error now / tolerance | reference |", "|---|---|---|---|---|---|"]
        lines += [row(case, before[case.key], after[case.key]) for case in cases if case.topic == topic]
    return "\n".join(lines) + "\n"


def row(case: Case, before: dict[str, Any], after: dict[str, Any]) -> str:
    """Return the row of a case."""
    error = "" if after["error"] is None else f"{after['error']:.1e} / {case.tolerance:.0e}"
    was = before["found"] + ("" if before["error"] is None else f", {before['error']:.1e}")
    star = "\\*" if case.nightly else ""
    return f"| {case.name} | {case.expected} | {was} | {after['found']}{star} | {error} | {case.source} |"


if __name__ == "__main__":
    verb, *rest = sys.argv[1:]
    if verb == "one":
        chosen = next(case for case in catalogue() if case.key == rest[0])
        print(json.dumps(asdict(attempt(chosen))))
    elif verb == "try":
        record(Path(rest[0]), *rest[1:])
    else:
        (ROOT / "docs" / "hard-cases.md").write_text(page(), encoding="utf-8")
