"""OpenFAST's main file (.fst): which of its modules has the blades, ElastoDyn or BeamDyn, and where their root is."""

from __future__ import annotations

from typing import Any

from rotfem.registry import register
from rotfem.scene.blades import beamdyn, elastodyn
from rotfem.scene.blades.deck import Deck
from rotfem.scene.blades.formats import Asked, BladeFormat
from rotfem.scene.files import existing_file_beside

#: Values of CompElast that are known: blades of ElastoDyn, and of BeamDyn on ElastoDyn's hub.
ELASTODYN, BEAMDYN = 1, 2


def recognises(deck: Deck) -> bool:
    """Return whether the first line says so, and of no module."""
    return deck.lines[0].upper().strip(" -`").startswith("OPENFAST INPUT FILE")


def read(deck: Deck, asked: Asked) -> dict[str, Any]:
    """Return what the files of blade 1 have; of BeamDyn's, with root and precone of ElastoDyn's main file."""
    if not recognises(deck):
        deck.fail("the first line must say OpenFAST INPUT FILE; main files of FAST 8 and before are not known", 1)
    which = deck.count("CompElast", 0)
    if which not in (ELASTODYN, BEAMDYN):
        line, _ = deck.named("CompElast")
        deck.fail(f"CompElast = {which} is not known; known: 1 (ElastoDyn) and 2 (BeamDyn)", line, 1)
    main = _named(deck, "EDFile")
    if which == ELASTODYN:
        return elastodyn.read(main, asked)
    return beamdyn.read(_named(deck, "BDBldFile(1)"), asked) | elastodyn.root(main)


def _named(deck: Deck, name: str) -> Deck:
    line, value = deck.named(name)
    return Deck(existing_file_beside(deck.path, value, line))


register(BladeFormat("openfast", "OpenFAST's main file (.fst)", recognises, read))
