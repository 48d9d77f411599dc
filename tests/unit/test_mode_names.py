"""Names of modes."""

from __future__ import annotations

from typing import Any

import pytest

import rotfem
from rotfem.structures.mode_names import ModeName, distinct, nodal_lines


@pytest.mark.parametrize(
    ("name", "said"),
    [
        (ModeName("flapwise", 1), "1st flapwise"),
        (ModeName("axial", 11), "11th axial"),
        (ModeName("torsion", 23), "23rd torsion"),
        (ModeName("edgewise", 4).mixed_with("flapwise"), "4th edgewise–flapwise"),
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


@pytest.mark.parametrize(
    ("shape", "axis", "first"),
    [
        ({"shape": "circle", "radius": 0.01}, [0, 0.2, 1], "out-of-plane"),
        ({"shape": "circle", "radius": 0.01}, [0, 1, 0], "out-of-plane"),
        ({"shape": "rectangle", "width": 0.03, "height": 0.01}, [0, 0, 1], "flapwise"),
    ],
    ids=["round", "round, about direction 2", "blade"],
)
def test_beams_without_an_edge_bend_in_and_out_of_the_plane(
    shape: dict[str, Any], axis: list[float], first: str
) -> None:
    """The centrifugal force softens a round beam in the plane of rotation, by Ω², so the lowest mode is in it."""
    section = {"E": 7e10, "nu": 0.3, "rho": 2700.0, **shape}
    scene = {
        "structure": {"type": "spatial_beam", "length": 1.0, "section": section},
        "motion": {"type": "constant", "speed": 10.0, "axis": axis},
        "modes": {"count": 2},
        "output": {"error": False},
    }
    labels = rotfem.modes(scene).labels
    assert labels[-1 if "circle" in shape.values() else 0] == f"1st {first}"
