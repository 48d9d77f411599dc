"""A blade file is a blade or refused in one line that names it, whatever stands in it."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import hypothesis.strategies as st
from hypothesis import given, settings

from rotfem.errors import InputError
from rotfem.scene import Scene, SpatialBeamStructure
from tests import blade_decks as decks
from tests import blade_main_decks as mains
from tests.blade_scenes import RIGID, STIFF
from tests.fuzz.trying import VALIDATION, check_finite, check_message, within

LENGTH = {"length": decks.LENGTH}
REFERENCE = Path(__file__).parent.parent / "reference"

#: Name of a file ↦ (text, keys of the section beside it, keys of the structure).
SEEDS: dict[str, tuple[str, Mapping[str, Any], Mapping[str, Any]]] = {
    "elastodyn.dat": (decks.elastodyn(), RIGID, LENGTH),
    "elastodyn_main.dat": (mains.elastodyn_main("elastodyn.dat"), RIGID, {}),
    "beamdyn.dat": (decks.beamdyn_blade(), {}, LENGTH),
    "primary.dat": (mains.beamdyn_primary(mains.PRIMARY, "beamdyn.dat"), {}, {}),
    "bmodes.dat": (decks.bmodes(), STIFF, LENGTH),
    "main.bmi": (mains.bmodes_main("bmodes.dat"), STIFF, {}),
    "blade.st": (decks.hawc2(True), {}, {}),
    "centres.st": (decks.hawc2(False), {}, {}),
    "main.htc": (mains.hawc2_htc(), {"body": "blade1"}, {}),
    "one.yaml": (decks.windio(), {}, {}),
    "two.yaml": (decks.windio_2(), {}, {}),
    "rotor.toml": ((REFERENCE / "ross_rotor_example.toml").read_text(), {}, {}),
    "rotor.json": ((REFERENCE / "ross_every_element.json").read_text(), {}, {}),
}
NUMBER = re.compile(r"-?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?")
NUMBERS = ["0", "-1", "1", "3", "99", "1e9", "1e300", "-1e308", "1e-320", "1e400", "9" * 30, "nan", "inf", ".", "1,5"]
PIECES = ["\0", "é", "\t", "{", "]", ": ", "- ", '"', "'", ";", "#", "$1 2\n", "&a ", "*a", "!!python/name:os.system "]
PIECES += ["begin main_body;\n", "end;\n", "continue_in_file main.htc;\n", "exit;\n", "~", "\ud7ff", "1 2 3\n"]


@st.composite
def files(draw: st.DrawFn) -> tuple[str, str]:
    """Return the name of a file and its text with numbers changed, pieces put in, lines moved, or the end missing."""
    name = draw(st.sampled_from(sorted(SEEDS)))
    text = SEEDS[name][0]
    for _ in range(draw(st.integers(1, 3))):
        what, here = draw(st.integers(0, 6)), draw(st.integers(0, len(text)))
        found, lines = list(NUMBER.finditer(text)), text.split("\n")
        if what <= 2 and found:
            hit = draw(st.sampled_from(found))
            text = text[: hit.start()] + draw(st.sampled_from(NUMBERS)) + text[hit.end() :]
        elif what == 3:
            text = text[:here] + draw(st.sampled_from(PIECES)) + text[here + draw(st.integers(0, 20)) :]
        elif what == 4:
            line = lines.pop(draw(st.integers(0, len(lines) - 1)))
            text = "\n".join(lines)
        elif what == 5:
            line = draw(st.sampled_from(lines))
            lines.insert(draw(st.integers(0, len(lines))), line)
            text = "\n".join(lines)
        else:
            text = text[:here]
    return name, text


@settings(max_examples=60)
@given(files())
def test_blade_files_of_any_kind(file: tuple[str, str]) -> None:
    name, text = file
    with tempfile.TemporaryDirectory() as folder:
        for other, (good, _, _) in SEEDS.items():
            (Path(folder) / other).write_text(good)
        (Path(folder) / name).write_text(text)
        section, structure = SEEDS[name][1:]
        tables = {"type": "spatial_beam", **structure, "section": {"from": name, **section}}
        try:
            with within(VALIDATION):
                scene = Scene.from_dict(
                    {"structure": tables, "motion": {"type": "constant", "speed": 1.0}}, directory=folder
                )
        except InputError as error:
            check_message(error)
            return
        beam = scene.structure
        assert isinstance(beam, SpatialBeamStructure)
        check_finite(beam.section.at(beam.length / 3), "section")
