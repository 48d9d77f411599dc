"""What a long computation says where there is no bar."""

from __future__ import annotations

import pytest

from rotfem.commands import console


@pytest.mark.parametrize("wanted", [True, False])
def test_lines_with_a_predicted_time(
    wanted: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing before ten seconds and five of marching, then at doubled times, by the pace of the march so far."""
    now = [0.0]
    monkeypatch.setattr(console, "monotonic", lambda: now[0])
    progress = console.ProgressBar("arm", wanted)
    for now[0], share in ((8.0, 0.0), (11.0, 0.05), (13.0, 0.1), (15.0, 0.2), (27.0, 0.4), (60.0, 1.0)):
        progress(share)
    lines = ["arm: 10 % after 13 s, about 45 s to go", "arm: 40 % after 27 s, about 28.5 s to go"]
    assert capsys.readouterr().err.splitlines() == (lines if wanted else [])
