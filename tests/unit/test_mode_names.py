"""Names of modes."""

from __future__ import annotations

import numpy as np
import pytest

from rotfem.structures.mode_names import ModeName, Wave, distinct, nodal_lines, with_overdamped, with_whirl


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


def test_overdamped_modes_have_their_place_in_the_family() -> None:
    """λ of a mode that vibrates, then the slow and the fast one of λ² + 4 λ + 1 = 0."""
    values = np.array([-0.1 + 1j, -2 + np.sqrt(3), -2 - np.sqrt(3)])
    one = np.ones(3)
    names = with_overdamped([ModeName("flapwise", n) for n in (1, 5, 5)], values, (one, one), one > 0)
    assert [*map(str, names)] == ["1st flapwise", "2nd flapwise, slow", "2nd flapwise, fast"]


def test_a_shaft_whirls_or_bends() -> None:
    """At 1 rad/s, forward 3 and backward 5 rad/s in the rotor; a standing mode is neither edge- nor flapwise."""
    names = [ModeName("edgewise", 1), ModeName("flapwise", 2), ModeName("edgewise–torsion", 1)]
    waves = [Wave(1, share, shaft=True) for share in (1.0, -1.0, 0.0)]
    found = with_whirl(names, waves, np.array([3.0, 5.0, 7.0]), 1.0)
    assert [*map(str, found)] == ["1st forward whirl", "1st backward whirl", "1st bending–torsion"]
