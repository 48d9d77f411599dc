"""Names of modes as engineers say them."""

from __future__ import annotations

import pytest

from rotfem.structures.mode_names import engineers_name


@pytest.mark.parametrize(
    ("label", "name"),
    [
        ("flap 1", "1st flapwise"),
        ("lag 2", "2nd edgewise"),
        ("torsion 3", "3rd torsion"),
        ("axial 11", "11th axial"),
        ("flap 22b", "22nd flapwise, b"),
        ("lag–flap 4", "4th edgewise–flapwise"),
        ("lag 4, slow", "4th edgewise, slow"),
        ("bending 1 backward", "1st backward whirl"),
        ("bending 2", "2nd bending"),
        ("in-plane 1", "1st in-plane"),
        ("diameters 2.1 forward", "2 diameters, forward"),
        ("diameters 1.2a", "1 diameter, 1 circle, a"),
        ("diameters 0.3", "0 diameters, 2 circles"),
        ("chordwise 2.1", "chordwise 2.1"),
        ("rigid body", "rigid body"),
    ],
)
def test_engineers_name(label: str, name: str) -> None:
    assert engineers_name(label) == name
