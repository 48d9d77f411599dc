"""A scene is valid or an error names what is wrong with it, whatever it holds and however it is written."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import hypothesis.strategies as st
import tomli_w
from hypothesis import given, settings

from rotfem.errors import SceneError
from rotfem.scene import Scene, load_scene
from tests.fuzz.mutants import mutants
from tests.fuzz.seeds import COMPUTED, SCENES, SEEDS
from tests.fuzz.trying import VALIDATION, check_message, within

FOLDER = str(next(iter(SCENES)).parent)
#: Scenes as text, without those that name other files.
TEXTS = [tomli_w.dumps(tables).encode() for tables in SEEDS["all"]]
BYTES = [b"\0", b"\xff", b"\xef\xbb\xbf", b"\r\n", *b"\n [ ] = \" # e999 nan inf - . '''".split(b" ")]
BYTES += [b"9" * 5000, b"\xed\xa0\x80", b"\x1b[2J", "Ω̈".encode()]


def accepted(make: Any) -> Scene | None:
    """Return the scene, None where it is refused as it should be."""
    with within(VALIDATION):
        try:
            return make()
        except SceneError as error:
            check_message(error)
            return None


@settings(max_examples=50)
@given(mutants("all"))
def test_tables_of_any_kind(tables: Any) -> None:
    scene = accepted(lambda: Scene.from_dict(tables, directory=FOLDER))
    if scene is not None:
        again = Scene.from_dict(scene.to_dict(), directory=FOLDER)
        assert again.to_dict() == scene.to_dict()
        scene.digest()


@st.composite
def written(draw: st.DrawFn) -> bytes:
    """Return the text of a scene with some bytes put in, taken out, or the end missing."""
    text = draw(st.sampled_from(TEXTS))
    for _ in range(draw(st.integers(0, 3))):
        here = draw(st.integers(0, len(text)))
        gone = draw(st.sampled_from([0, 0, 1, 5, len(text)]))
        text = text[:here] + draw(st.one_of(st.sampled_from(BYTES), st.binary(max_size=4))) + text[here + gone :]
    return text


@settings(max_examples=50)
@given(written())
def test_files_of_any_kind(text: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "beam.toml"
        path.write_bytes(text)
        accepted(lambda: load_scene(path))


CELLS = [
    "",
    "w # s",
    " 3 ",
    *["0", "1", "2.5", "-1e3", "1e999", "nan", "inf", "O", "1_0", "１", "t", "0x1p3", "1d5", '"1"', "+"],
]
cells = st.one_of(st.sampled_from(CELLS), st.floats().map(repr), st.text(max_size=6))
lines = st.lists(cells, min_size=1, max_size=4).map(",".join)


@settings(max_examples=50)
@given(st.lists(lines, max_size=6).map("\n".join))
def test_tables_in_files_of_any_kind(text: str) -> None:
    beam = COMPUTED["adaptive"] | {"motion": {"type": "table", "table": "speed.csv"}}
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "speed.csv").write_bytes(text.encode("utf-8", "surrogatepass"))
        accepted(lambda: Scene.from_dict(beam, directory=folder))
