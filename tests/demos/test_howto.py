"""The complete scenes of docs/howto.md are computed: as they stand, but for a shorter time."""

from __future__ import annotations

import re
import tomllib

import pytest

import rotfem
from tests.launch import ROOT

SCENES = re.findall(r"^## (.*?)\n.*?^```toml\n(.*?)^```", (ROOT / "docs" / "howto.md").read_text(), re.M | re.S)


def test_there_are_scenes() -> None:
    titles = " ".join(title for title, _ in SCENES)
    assert [word for word in ("blade", "shaft", "torque", "pitch") if word not in titles] == []


@pytest.mark.demos
@pytest.mark.parametrize(("title", "text"), SCENES, ids=[title for title, _ in SCENES])
def test_scene_is_computed(title: str, text: str) -> None:
    scene = rotfem.Scene.from_dict(tomllib.loads(text), name=title)
    if scene.time is None:
        modes = rotfem.modes(scene)
        assert len(modes.frequencies) == scene.modes.count
        assert modes.stable
        return
    result = rotfem.run(scene.replace({"time.end": 60 * scene.time.step}), hint=None)
    assert result.status == "done"
    assert abs(result.tip["u2"]).max() > 0.0
