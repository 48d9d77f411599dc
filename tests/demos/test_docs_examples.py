"""The Python examples of the documentation run as they stand, one document a process, and print what they say."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.launch import ROOT, environment

#: Document ↦ how many lines of it, at least, say what they print.
DOCUMENTS = {"docs/python.md": 22, "docs/extending.md": 11, "README.md": 3}

#: Runs a script, and tells what every line of it printed, as JSON.
RUNNER = """
import json, runpy, sys
printed = {}
def say(*values):
    printed.setdefault(sys._getframe(1).f_lineno, []).append(" ".join(map(str, values)))
runpy.run_path(sys.argv[1], init_globals={"print": say}, run_name="example")
json.dump(printed, sys.stdout)
"""

#: A line that says what it prints, and a number of which only the first digits are given.
SAYING, CUT = re.compile(r"\s*print\(.*\)\s{2,}# (.*)$"), re.compile(r"-?\d+\.\d+…")

#: Spaces inside the brackets of an array, by which NumPy aligns its columns.
PADDING = re.compile(r"(?<=\[)\s+|\s+(?=\])")


def script(document: str) -> str:
    """Return the Python blocks of a document, each line where it stands there."""
    lines, inside = [], False
    for line in (ROOT / document).read_text(encoding="utf-8").splitlines():
        fence = line.startswith("```")
        inside = line == "```python" if fence else inside
        lines.append(line if inside and not fence else "")
    return "\n".join(lines) + "\n"


def differences(said: str, printed: str) -> str:
    """Return how the text printed differs from what a document says, "" if it does not.

    A number that ends in "…" may differ by one in its last digit; any other "…" stands for anything.
    """
    said, printed = (PADDING.sub("", text) for text in (said, printed))
    cut = [number[:-1] for number in CUT.findall(said)]
    pattern = re.escape(said).replace(r"\ ", r"\s+")
    for number in cut:
        pattern = pattern.replace(re.escape(f"{number}…"), r"(-?\d+(?:\.\d*)?(?:e[+-]\d+)?)", 1)
    match = re.fullmatch(pattern.replace("…", ".*"), printed, re.DOTALL)
    if match is None:
        return f"{printed!r} is not {said!r}"
    for number, found in zip(cut, match.groups(), strict=True):
        unit = 10.0 ** -len(number.partition(".")[2])
        if abs(float(found) - float(number)) > 1.001 * unit:
            return f"{found} is not {number}…"
    return ""


@pytest.mark.demos
@pytest.mark.parametrize("document", DOCUMENTS)
def test_examples(document: str, tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    (tmp_path / "demos").symlink_to(ROOT / "demos")
    code, file = script(document), tmp_path / "example.py"
    file.write_text(code, encoding="utf-8")
    command = [sys.executable, "-c", RUNNER, str(file)]
    done = subprocess.run(command, cwd=tmp_path, env=environment(), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    printed = json.loads(done.stdout)
    sayings = {i: match[1] for i, line in enumerate(code.splitlines(), 1) if (match := SAYING.match(line))}
    assert len(sayings) >= DOCUMENTS[document]
    wrong = {f"{document}:{i}": differences(said, "; ".join(printed.get(str(i), []))) for i, said in sayings.items()}
    assert {place: why for place, why in wrong.items() if why} == {}
    assert sorted(map(int, printed)) == sorted(sayings), "a line prints, but does not say what"


def test_every_example_is_run() -> None:
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")]
    with_examples = {str(page.relative_to(ROOT)) for page in pages if "```python" in page.read_text(encoding="utf-8")}
    assert with_examples == set(DOCUMENTS)
