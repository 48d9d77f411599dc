"""TOML blocks of the documentation are scenes, or parts of one; the page of keys is up to date; sentences are short."""

from __future__ import annotations

import re
import runpy
import tomllib
from pathlib import Path
from typing import Any

import pytest

import rotfem
from tests import blade_decks

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
#: Words of a sentence at most; formulas need longer ones.
LONGEST = 30

_PLANAR = {"type": "planar_beam", "length": 10.0, "section": {"EA": 2.8e7, "GA": 1e7, "EI": 1.4e4}}
_PLANAR["section"]["mass_per_length"] = 1.2  # type: ignore[index]
_SPATIAL = {"shape": "tube", "outer_radius": 0.1, "wall": 0.01, "E": 7e10, "nu": 0.3, "rho": 2700.0}
#: What follows "toml" at a fence ↦ the structure that completes a block without one of its own.
STRUCTURES: dict[str, dict[str, Any]] = {
    "": _PLANAR,
    "spatial": {"type": "spatial_beam", "length": 10.0, "section": _SPATIAL},
    "plate": {"type": "plate", "length": 2.0, "width": 1.0, "thickness": 0.01, "E": 7e10, "nu": 0.3, "rho": 2700.0},
}

_BLOCK = re.compile(r"^```toml ?(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def blocks() -> list[tuple[str, str, str]]:
    """Return (place, what follows "toml", text) of all blocks."""
    out = []
    for document in DOCUMENTS:
        text = document.read_text(encoding="utf-8")
        for found in _BLOCK.finditer(text):
            out.append((f"{document.name}:{text.count(chr(10), 0, found.start()) + 1}", found[1], found[2]))
    return out


def completed(kind: str, tables: dict[str, Any]) -> dict[str, Any]:
    """Return the tables of a block with those that a scene must have and it leaves out."""
    own = tables.get("structure", {})
    structure = own if "type" in own and "length" in own | {"length": own.get("mesh")} else STRUCTURES[kind] | own
    return {"motion": {"type": "constant", "speed": 1.0}} | tables | {"structure": structure}


def test_there_are_blocks() -> None:
    assert len(blocks()) > 35


@pytest.mark.parametrize(("place", "kind", "text"), blocks(), ids=[block[0] for block in blocks()])
def test_block_is_a_scene(place: str, kind: str, text: str, tmp_path: Path) -> None:
    (tmp_path / "Blade.dat").write_text(blade_decks.elastodyn())
    (tmp_path / "annular_disk.msh").symlink_to(ROOT / "demos" / "annular_disk.msh")
    rotfem.Scene.from_dict(completed(kind, tomllib.loads(text)), name=place, directory=tmp_path).check_run()


def test_scene_reference_is_up_to_date() -> None:
    """After a change of a table: ./with-fenicsx python3 docs/scene_reference.py."""
    made = runpy.run_path(str(ROOT / "docs" / "scene_reference.py"))["page"]()
    assert (ROOT / "docs" / "scene-reference.md").read_text(encoding="utf-8") == made
    assert re.findall(r"^\| `(\w+)` .*\|  \|$", made, re.MULTILINE) == []  # every key has a meaning


def sentences(text: str) -> list[str]:
    """Return the sentences of a document: of paragraphs, list items and cells, without code and formulas."""
    text = re.sub(r"^```.*?^```", "\n", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"`[^`]*`", "code", re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text))
    text = re.sub(r"^(\s*[-*] |\s*\d+\. |#+ |\|)", r"\n\n", text, flags=re.MULTILINE)
    parts = (part for paragraph in re.split(r"\n\s*\n|\|", text) for part in re.split(r"(?<=[.!?:])\s+", paragraph))
    return [" ".join(part.split()) for part in parts]


PROSE = [*(path for path in DOCUMENTS if path.name != "theory.md"), *sorted((ROOT / "docs" / "tutorials").glob("*.py"))]


@pytest.mark.parametrize("document", PROSE, ids=lambda path: path.name)
def test_sentences_are_short(document: Path) -> None:
    text = document.read_text(encoding="utf-8")
    if document.suffix == ".py":  # the comments of a tutorial are its text
        text = "\n".join(line[2:] if line.startswith("# ") else "" for line in text.splitlines())
    said = sentences(text)
    assert [sentence for sentence in said if len(sentence.split()) > LONGEST] == []


def test_long_sentences_are_seen() -> None:
    """The test can fail."""
    assert max(len(s.split()) for s in sentences(f"Short. {'long ' * 31}end.\n\n- item")) == 32


def test_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 150
