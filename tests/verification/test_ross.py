"""Shafts against ROSS 2.3.0 (`tests/reference/ross.json`, made by its `Rotor`), and its rotor files."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rotfem

pytestmark = pytest.mark.usefixtures("unestimated")

REFERENCE = Path(__file__).parent.parent / "reference"
ROSS = json.loads((REFERENCE / "ross.json").read_text())
EXAMPLE = REFERENCE / "ross_rotor_example.toml"
EVERY = REFERENCE / "ross_every_element.json"

SPEEDS = np.linspace(4.0, 400.0, 100)


def over_speed(*columns: np.ndarray) -> dict[str, Any]:
    return {"over_speed": np.column_stack([SPEEDS, *columns]).tolist()}


PART = SPEEDS / 400.0
BEARINGS: dict[str, dict[str, Any]] = {
    "example": {"stiffness": [[1e6, 0], [0, 0.8e6]], "damping": [[200, 0], [0, 150]]},
    "over_speed": {
        "stiffness": over_speed(1e6 * (1 + PART**2), 8e5 * (1 + 0.5 * PART**2)),
        "damping": over_speed(2e3 / (1 + PART), 1.5e3 / (1 + PART)),
    },
    "cross": {"stiffness": [[1.2e6, 3e5], [-6e5, 2e6]], "damping": [[3e3, -8e2], [-7e2, 5e3]]},
}


def scene_on(bearing: dict[str, Any]) -> dict[str, Any]:
    """Return ROSS's `rotor_example` on two bearings, 1 kg mm off the axis at its first disk."""
    disk = {"outer_diameter": 0.28, "inner_diameter": 0.05, "width": 0.07, "rho": 7810.0}
    section = {"shape": "circle", "radius": 0.025, "E": 211e9, "nu": 211e9 / 81.2e9 / 2 - 1, "rho": 7810.0}
    structure = {"type": "spatial_beam", "length": 1.5, "root": {"driven": True}, "section": section}
    structure |= {"supports": [{"x": x, **bearing} for x in (0.0, 1.5)]}
    return {
        "structure": structure | {"masses": [{"x": x, "disk": disk} for x in (0.5, 1.0)]},
        "motion": {"type": "constant", "speed": 0.0, "axis": [1, 0, 0]},
        "loads": {"unbalance": [{"x": 0.5, "kg_m": 1e-3, "phase": 0.5}]},
        "mesh": {"elements": 9, "degree": 3},
        "modes": {"count": 10},
    }


def log_decrement(row: dict[str, Any]) -> float:
    return float(2 * np.pi * row["damping"] / np.sqrt(1 - row["damping"] ** 2))


@pytest.mark.parametrize("case", BEARINGS)
def test_whirl_damping_and_unbalance(case: str) -> None:
    """Frequencies, log decrements, amplitudes, phases and forces on bearings: 2e-5 of ROSS with 48 elements.

    Tables have the speeds of ROSS's among their rows: it interpolates otherwise. No node of the mesh is at 0.75.
    """
    expected, scene = ROSS[case], scene_on(BEARINGS[case])
    for i, speed in enumerate(ROSS["speeds"]):
        rows = rotfem.modes(scene | {"motion": scene["motion"] | {"speed": speed}}).rows
        rows = sorted(
            (r for r in rows if "torsion" not in r["label"] and r["frequency"] > 0), key=lambda r: r["frequency"]
        )[:6]
        np.testing.assert_allclose([r["frequency"] for r in rows], expected["frequency"][i], rtol=2e-5)
        np.testing.assert_allclose([log_decrement(r) for r in rows], expected["log_decrement"][i], rtol=2e-5)
    found = rotfem.unbalance(scene, ROSS["speeds"], probes=[(0.75, 0.0)])
    for name in expected.keys() - {"frequency", "log_decrement"}:
        component, x = name.split("@")
        of = found.at(float(x))
        value = of[component] * np.exp(1j * of[f"{component}_phase"])
        np.testing.assert_allclose(value, np.array(expected[name]) @ [1.0, 1.0j], rtol=2e-5)


def test_rotor_example_from_its_file(tmp_path: Path) -> None:
    """Modes of `rotor_example`, read, written and read again, at 200 rad/s: ROSS with 48 elements, 1e-5."""
    rotfem.import_blade(EXAMPLE, changes=["motion.speed=200.0"]).write(tmp_path / "rotor.toml")
    rows = rotfem.modes(tmp_path / "rotor.toml").rows
    found = [row["frequency"] for row in rows if "whirl" in row["label"]][:4]
    np.testing.assert_allclose(found, [91.757449, 96.31681, 272.65241, 298.34897], rtol=1e-5)


def test_every_element_of_a_file() -> None:
    """Layers, a bore, housings, a table that couples, a seal of negative stiffness with its mass: ROSS, refined, 2e-4.

    The seal makes forward whirl grow, and no other: axes and signs are ours.
    """
    scene = rotfem.import_blade(EVERY, changes=["modes.count=6", "mesh.elements=12"])
    assert scene.hints == (
        f"{EVERY.name}: left out: that the shaft is free along and about its axis; root.free is the key for it",
    )
    expected = {
        200.0: [("backward", 283.02899, 0.595708), ("forward", 283.80379, -0.4242511), ("backward", 967.06, 0.2927161)],
        400.0: [
            ("backward", 283.2605, 0.6004356),
            ("forward", 284.9505, -0.4379905),
            ("backward", 959.7665, 0.2684041),
        ],
    }
    for speed, known in expected.items():
        rows = [r for r in rotfem.modes(scene.replace({"motion.speed": speed})).rows if "whirl" in r["label"]][:3]
        assert [row["whirl"] for row in rows] == [way for way, *_ in known]
        found = [(row["frequency"], log_decrement(row)) for row in rows]
        np.testing.assert_allclose(found, [numbers for _, *numbers in known], rtol=2e-4)


def test_cones_and_shear_coefficients(tmp_path: Path) -> None:
    """A cone of one element is one, of two layers too; Hutchinson's coefficient is a key; what has no key is said."""
    data = json.loads(EVERY.read_text())
    shaft = [name for name in data if name.startswith("ShaftElement")]
    for name in shaft:
        data[name]["shear_method_calc"] = "hutchinson"
        if data[name]["idl"] == 0.05:
            del data[name]
    data[shaft[0]] |= {"odr": 0.06, "axial_force": 10.0, "alpha": 1.0}
    (tmp_path / "rotor.json").write_text(json.dumps(data))
    scene = rotfem.import_blade(tmp_path / "rotor.json")
    assert scene.structure.section.outer_radius[:3] == ((0.0, 0.025), (0.2, 0.03), (0.2, 0.025))
    nu = 211e9 / 81.2e9 / 2 - 1
    solid = 6 * (1 + nu) / (7 + 12 * nu + 4 * nu**2)
    np.testing.assert_allclose(scene.structure.section.shear_correction[0][1], solid)
    assert [hint.split("left out: ")[1] for hint in scene.hints[:2]] == [
        "axial_force of 1 shaft elements; loads.tip_force is the key for it",
        "alpha of 1 shaft elements",
    ]
    data[shaft[0] + "b"] = data[shaft[0]] | {"idl": 0.05, "idr": 0.06, "odl": 0.08, "odr": 0.1}
    (tmp_path / "rotor.json").write_text(json.dumps(data))
    layered = rotfem.import_blade(tmp_path / "rotor.json").structure.section
    radii = [np.interp(0.05, [0.0, 0.2], ends) / 2 for ends in ((0.05, 0.06), (0.08, 0.1))]
    I = np.pi / 4 * (radii[0] ** 4 + radii[1] ** 4 - radii[0] ** 4)  # noqa: E741  both of one material
    np.testing.assert_allclose(layered.central(0.05)["EI2"], 211e9 * I, rtol=1e-4)


STEEL = {"E": 211e9, "G_s": 81.2e9, "rho": 7810.0}


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"PointMass_Point Mass 0": {"n": 7, "mx": 1.0, "my": 2.0}}, "point mass at n = 7 must have mx = my"),
        ({"CouplingElement_a": {"n": 3, "m_l": 1.0}}, "CouplingElement_a is none of what is read"),
        ({"DiskElement_a": {"n": 9, "m": 1.0, "Ip": 1.0, "Id": 1.0}}, "a disk is at n = 9; must be a node"),
        ({"BearingElement_a": {"n": 3, "kxx": [1.0, 2.0]}}, "BearingElement_a.frequency must have as many values"),
        ({"BearingElement_a": {"n": 3, "kxx": [1.0], "n_link": 5}}, "n_link = 5 must be the node of a housing"),
        ({"BearingElement_a": {"n": 12, "kxx": [1.0]}}, "nothing links what is at n = 12"),
        ({"ShaftElement_a": {"n": 8}}, "ShaftElement_a.L required key is missing"),
        ({"ShaftElement_Shaft Element 3": None}, "must have one shaft"),
        (
            {"ShaftElement_a": {"n": 0, "L": 0.2, "idl": 0.1, "odl": 0.1, "idr": 0, "odr": 0.1, "material": STEEL}},
            "idl < odl",
        ),
        ({"PointMass_a": 3}, "PointMass_a"),
        ("{", "not valid JSON or TOML"),
    ],
)
def test_files_that_are_refused(tmp_path: Path, change: Any, why: str) -> None:
    """In one line with the element, and what is allowed."""
    data = json.loads(EVERY.read_text())
    for name, keys in change.items() if isinstance(change, dict) else ():
        data[name] = keys
    data = {name: keys for name, keys in data.items() if keys is not None}
    (tmp_path / "rotor.json").write_text(change if isinstance(change, str) else json.dumps(data))
    with pytest.raises(rotfem.SceneError, match=re.escape(why)) as refused:
        rotfem.import_blade(tmp_path / "rotor.json", "ross")
    assert "\n" not in str(refused.value)
