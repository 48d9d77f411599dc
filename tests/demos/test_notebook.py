"""The first tutorial as a notebook: it runs, and shows figures and tables without a magic word."""

from __future__ import annotations

from typing import Any

import pytest

from tests.launch import ROOT, environment

jupytext = pytest.importorskip("jupytext")
nbclient = pytest.importorskip("nbclient")


@pytest.fixture(scope="module")
def executed(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Return the notebook with its outputs; a last cell shows the result of each verb."""
    notebook = jupytext.read(ROOT / "docs" / "tutorials" / "blade.py")
    for name in ("modes", "diagram"):
        notebook.cells.append(jupytext.reads(f"# %%\n{name}", fmt="py:percent").cells[0])
    folder = tmp_path_factory.mktemp("notebook")
    with pytest.MonkeyPatch.context() as patch:
        for name, value in environment().items():
            patch.setenv(name, value)
        patch.setenv("IPYTHONDIR", str(folder))  # no profile of the user
        resources = {"metadata": {"path": str(folder)}}
        return nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3", resources=resources).execute()


def shown(cell: Any) -> dict[str, Any]:
    """Return media type ↦ what the last output of a cell is."""
    return dict(cell.outputs[-1].data) if cell.outputs and "data" in cell.outputs[-1] else {}


def test_figures_show_without_a_magic_word(executed: Any) -> None:
    plots = [cell for cell in executed.cells if cell.source.rstrip().endswith(".plot()")]
    assert plots
    assert all("image/png" in shown(cell) for cell in plots)


def test_a_result_shows_tables_and_a_figure(executed: Any) -> None:
    for cell in executed.cells[-2:]:
        page = shown(cell)["text/html"]
        assert "<table>" in page
        assert "data:image/png;base64" in page


def test_no_output_is_long(executed: Any) -> None:
    texts = [shown(cell).get("text/plain", "") for cell in executed.cells if cell.cell_type == "code"]
    assert texts
    assert max(map(len, texts)) < 500
