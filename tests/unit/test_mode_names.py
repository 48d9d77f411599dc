"""Names of modes."""

from __future__ import annotations

import pytest

from rotfem.structures.mode_names import ModeName, distinct, nodal_lines


@pytest.mark.parametrize(
    ("name", "said"),
    [
        (ModeName("flapwise", 1), "1st flapwise"),
        (ModeName("axial", 11), "11th axial"),
        (ModeName("torsion", 23), "23rd torsion"),
        (ModeName("edgewise", 4).mixed_with("flap"), "4th edgewise–flapwise"),
        (ModeName("bending", 1, nodal_lines(1, 1)), "1 nodal diameter, 1 circle"),
        (ModeName("bending", 1, nodal_lines(0, 2), rest="forward"), "0 nodal diameters, 2 circles, forward"),
    ],
)
def test_words(name: ModeName, said: str) -> None:
    assert str(name) == said


def test_modes_of_one_name_have_letters() -> None:
    names = [
        ModeName("edgewise", 2),
        ModeName("axial", 1),
        ModeName("edgewise", 2, rest="slow"),
        ModeName("edgewise", 2),
    ]
    assert distinct(names) == ["2nd edgewise, a", "1st axial", "2nd edgewise, slow", "2nd edgewise, b"]
