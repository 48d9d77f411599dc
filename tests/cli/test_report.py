"""`--report`: one file, opened in a Chromium without a screen: tables sort, figures answer, modes move."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.beams import MODAL_SCENE

pytest.importorskip("bokeh", reason="the report needs bokeh")
BROWSER = next((found for name in ("chromium-headless-shell", "chromium") if (found := shutil.which(name))), None)
Rotfem = Callable[..., Any]
SCENE = MODAL_SCENE
DEMOS = Path(__file__).resolve().parents[2] / "demos"

#: Before all else: what goes wrong is kept, and frames come by the clock of the page, which runs ahead of ours.
FIRST = """<script>
requestAnimationFrame = draw => setTimeout(() => draw(performance.now()), 20);
window.wrong = [];
for (const name of ["error", "warn"]) console[name] = (...said) => wrong.push(said.join(" "));
addEventListener("error", event => wrong.push(event.message));
</script>"""

#: After all else: what a person does, and what comes of it, as JSON in the page.
LAST = """<script>
const pause = time => new Promise(done => setTimeout(done, time));
const column = (table, i) => [...table.tBodies[0].rows].map(row => +row.cells[i].textContent);
const pixels = canvas => canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data.join("");
async function act() {
  const said = {tables: [], figures: window.Bokeh ? [...Bokeh.index.query(v => v.model.type === "Figure")].length : 0};
  for (const table of document.querySelectorAll("table")) {
    const i = [...table.tBodies[0].rows[0].cells].findIndex(cell => cell.textContent && !isNaN(cell.textContent));
    if (i < 0 || column(table, i).some(isNaN)) continue;
    const head = table.tHead.rows[0].cells[i];
    head.click();
    const up = column(table, i);
    head.click();
    said.tables.push([up, column(table, i), head.ariaSort]);
  }
  const canvas = document.querySelector(".modes canvas");
  if (canvas) {
    const then = pixels(canvas);
    await pause(300);
    said.moved = then !== pixels(canvas);
  }
  return said;
}
async function finish() {
  const said = await act().catch(error => ({wrong: [error.stack]}));
  said.wrong = [...wrong, ...(said.wrong || [])];
  const end = document.createElement("pre");
  end.id = "said";
  end.textContent = JSON.stringify(said);
  document.body.append(end);
}
addEventListener("load", () => setTimeout(finish, 1500));
</script>"""


def opened(folder: Path, page: Path) -> dict[str, Any]:
    """Return what comes of a person's acts on a page, in a Chromium without a network."""
    if BROWSER is None:
        pytest.skip("there is no Chromium: ./with-fenicsx installs it where Debian's packages are")
    acted = page.with_name("acted.html")
    text = page.read_text(encoding="utf-8").replace("<head>", "<head>" + FIRST, 1).replace("</body>", LAST + "</body>")
    acted.write_text(text, encoding="utf-8")
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--dump-dom"]
    options += ["--disable-dev-shm-usage", f"--user-data-dir={folder / 'browser'}", "--proxy-server=127.0.0.1:9"]
    command = [BROWSER, *options, "--virtual-time-budget=8000", acted.as_uri()]
    shown = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120).stdout
    found = re.search(r'<pre id="said">(.*?)</pre>', shown, re.DOTALL)
    assert found is not None, "the page did not get to its end"
    said: dict[str, Any] = json.loads(html.unescape(found[1]))
    return said


def check_page(folder: Path, page: Path) -> dict[str, Any]:
    """Check what all reports have in common; return what comes of a person's acts."""
    text = page.read_text(encoding="utf-8")
    assert len(text.encode()) <= 3_000_000
    outside = r'(?:src|href)\s*=\s*["\']?(?:https?:)?//'
    assert not re.search(outside, re.sub(r"<script.*?</script>", "", text, flags=re.DOTALL))
    said = opened(folder, page)
    assert said["wrong"] == []
    assert said["tables"]
    for up, down, way in said["tables"]:
        assert (up, down, way) == (sorted(up), sorted(down, reverse=True), "descending")
    return said


def test_report_of_modes(folder: Path, rotfem: Rotfem) -> None:
    """The name of the scene is harmful: a text of the page, and nothing else."""
    (folder / "beam.toml").rename(folder / "a<b>.toml")
    done = rotfem("modes", "a<b>.toml", "--report", "--no-error", "--no-plots", "-q", "-o", "out")
    assert done.status == 0, done.err
    page = folder / "out" / "report.html"
    text = page.read_text(encoding="utf-8")
    assert "<h1>a&lt;b&gt;</h1>" in text
    assert "a<b>" not in text
    said = check_page(folder, page)
    assert said["moved"]
    assert said["figures"] == 3


def test_report_of_a_spin_up(folder: Path, rotfem: Rotfem) -> None:
    options = ("--set", "time.step=0.02", "--set", "time.output_every=1", "--no-error", "--no-plots", "-q")
    done = rotfem("run", str(DEMOS / "spin_up.toml"), *options, "--report", "-o", "out")
    assert done.status == 0, done.err
    said = check_page(folder, folder / "out" / "report.html")
    assert said["figures"] == 8


def test_report_of_a_run_that_failed(folder: Path, rotfem: Rotfem) -> None:
    options = ("--set", "model.theory=linear", "--no-error", "--no-plots", "-q")
    done = rotfem("run", str(DEMOS / "spin_up.toml"), "--set", "time.step=0.02", *options, "--report", "-o", "out")
    assert done.status == 3
    text = (folder / "out" / "report.html").read_text(encoding="utf-8")
    assert 'class="status failed"' in text
    assert re.search(r'class="note failed">the linear solution diverged.*model.theory = ', text)


@pytest.mark.parametrize(
    "verb", [("check",), ("campbell", "--speeds", "0:4:5"), ("explain",)], ids=lambda verb: verb[0]
)
def test_every_verb_has_a_report(folder: Path, rotfem: Rotfem, verb: tuple[str, ...]) -> None:
    done = rotfem(verb[0], "beam.toml", *verb[1:], "--report", "--no-plots", "-q", "-o", "out")
    assert done.status == 0, done.err
    text = (folder / "out" / "report.html").read_text(encoding="utf-8")
    assert f"rotfem {verb[0]}</p>" in text
    assert ("data-root-id" in text) == (verb[0] != "explain")  # a figure that answers, or bars as a picture
    assert not re.search(r"@(title|library|content|modes|scripts)@", text)
