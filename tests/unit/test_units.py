"""Values with units: what they come to, that every key has its unit, and what is refused."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, get_args, get_type_hints

import pytest

from rotfem import Scene, SceneError
from rotfem.commands.campbell import parse_speeds
from rotfem.results.columns import ShownUnits
from rotfem.scene.table import SceneModel, in_units
from rotfem.units import quantity
from tests.beams import STRUCTURE

BEAM: dict[str, Any] = {
    "structure": {
        "type": "planar_beam",
        "length": 10.0,
        "section": STRUCTURE["section"],
    },
    "motion": {"type": "constant", "speed": 6.0},
}


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("12.1 rpm", "rad/s", 12.1 * math.pi / 30),
        ("0.7 Hz", "rad/s", 0.7 * 2 * math.pi),  # a frequency, not a rate of 0.7 rad/s
        ("3 deg", "rad", math.pi / 60),
        ("10°", "rad", math.pi / 18),
        ("2 GPa", "Pa", 2e9),
        ("-5e-1mm", "m", -5e-4),
        ("2.7 g/cm^3", "kg/m**3", 2700.0),
        ("7850 kg·m⁻³", "kg/m**3", 7850.0),
        ("12 kN·m", "N*m", 12e3),
        ("12 Nm", "N*m", 12.0),
        ("4e6 N m²", "N*m**2", 4e6),
        ("9 rev/min", "rad/s", 0.3 * math.pi),
    ],
)
def test_value_in_si(text, unit, value):
    assert quantity(text, unit) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize("text", ["12", "m", "3 m + 2 m", "2 m**9**9**9", "1 m.__class__", "1 (m)", "", "nan m", "1e3"])
def test_no_quantity(text):
    with pytest.raises(ValueError, match=r"must be a number \(m\)"):
        quantity(text, "m")


def test_scene_in_units_is_that_in_si():
    """Every place where a number may stand: plain, in a taper, a table, a vector, a table of a load, an override."""
    tables = {
        "structure": {
            "type": "planar_beam",
            "length": "1000 cm",
            "section": BEAM["structure"]["section"] | {"EI": [[0, "14 kN m²"], ["10 m", "7 kN m²"]]},
            "damping": {"rayleigh": ["0.1 1/s", "2 ms"]},
        },
        "motion": {"type": "torque", "hub_inertia": "500 kg m²", "pulses": [["0 s", "100 ms", "2 kN·m"]]},
        "loads": {
            "tip_force": {"over_time": [[0, 0, 0], ["1 min", "1 kN", 3]], "kind": "follower"},
            "tip_moment": "2 Nm",
        },
        "time": {"end": "2 min", "step": "10 ms"},
    }
    scene = Scene.from_dict(tables)
    assert scene.structure.length == 10.0
    assert scene.structure.section.EI == ((0.0, 14e3), (10.0, 7e3))
    assert scene.structure.damping.rayleigh == pytest.approx((0.1, 2e-3), rel=1e-14)
    assert scene.motion.hub_inertia == 500.0
    assert scene.motion.pulses == ((0.0, 0.1, 2000.0),)
    assert scene.loads.tip_force.over_time == ((0.0, 0.0, 0.0, 0.0), (60.0, 1000.0, 3.0, 0.0))
    assert scene.loads.tip_moment.value == (2.0,)
    assert (scene.time.end, scene.time.step) == (120.0, 0.01)
    assert scene.replace({"time.end": "3 min"}).time.end == 180.0


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("motion.speed", "12.1 rmp", "'rmp' is no unit that is known; must be one of the kind of rad/s"),
        ("motion.speed", "3 m", "'m' is no unit of the kind of rad/s"),
        ("structure.section.EI", [[0, "1 N*m^2"], ["10 s", 3]], "'s' is no unit of the kind of m"),
        ("structure.length", "ten", "must be a number"),
        ("structure.length", "10", "must be a number"),
        ("mesh.elements", "3 m", "must be an integer"),
    ],
)
def test_wrong_unit_names_its_key(key, value, message):
    with pytest.raises(SceneError) as caught:
        Scene.from_dict(BEAM).replace({key: value})
    assert key in str(caught.value)
    assert message in str(caught.value)


def test_region_and_type_decide():
    """The unit of a plate's regions is that of all of them, those of loads and of a table follow their types."""
    plate = {"type": "plate", "length": "1 m", "width": 1, "thickness": [[0, "3 mm"], ["100 cm", 0.001]]}
    plate |= {"E": "70 GPa", "nu": 0.3, "rho": 2700}
    tables = {"structure": plate, "motion": BEAM["motion"], "loads": {"distributed": [0, 0, "2 kPa"]}}
    found = Scene.from_dict(tables)
    assert found.structure.thickness == ((0.0, 3e-3), (1.0, 1e-3))
    assert found.loads.distributed.value == (0.0, 0.0, 2e3)
    with pytest.raises(SceneError, match="'kPa' is no unit of the kind of N/m"):
        Scene.from_dict(BEAM | {"loads": {"distributed": [0, "2 kPa"]}})
    table = {"motion": {"type": "table", "table": [[0, 0], ["1 s", "60 rpm"]]}}
    assert Scene.from_dict(BEAM | table).motion.table[1] == pytest.approx([1.0, 2 * math.pi])


#: Numbers without a unit, and what has those of its table: matrices, ratios, amplitudes of loads.
PURE = {
    "free",
    "over_speed",
    "over_frequency",
    "over_both",
    "nu",
    "nu12",
    "shear_correction",
    "stiffness",
    "mass",
    "axis",
    "tolerance",
    "per_rev",
    "value",
    "table",
}
PURE |= {"fields", "accuracy", "increment_tolerance", "regions", "speed", "rate", "angle", "elements", "orders"}


def tables(of: type[SceneModel] = SceneModel) -> Iterator[type[SceneModel]]:
    """Yield all tables of a scene."""
    for table in of.__subclasses__():
        yield table
        yield from tables(table)


def has_unit(kind: Any) -> bool:
    """Return whether a type says a unit."""
    return getattr(getattr(kind, "func", None), "func", None) is in_units or any(map(has_unit, get_args(kind)))


def test_every_number_has_its_unit():
    """What a new key holds is looked for here: numbers, vectors and tables have a unit or are known to have none."""
    for table in {table for table in tables() if table.__module__.startswith("rotfem.")}:
        hints = get_type_hints(table, include_extras=True)
        for name, field in table.model_fields.items():
            words = str(field.annotation)
            if ("float" in words or "tuple[" in words) and not any(
                w in words for w in ("Callable", "rotfem", "tuple[str")
            ):
                assert has_unit(hints[name]) or name in PURE, (table, name)


def test_speeds_of_a_range_in_rpm():
    assert parse_speeds("0:60:3rpm") == pytest.approx([0.0, math.pi, 2 * math.pi], rel=1e-14)
    assert parse_speeds("1,2 Hz") == pytest.approx([2 * math.pi, 4 * math.pi], rel=1e-14)
    assert parse_speeds("1e1:2e1:2") == [10.0, 20.0]
    with pytest.raises(SceneError, match="rpm"):
        parse_speeds("0:60:3m")


def test_shown_units_add_columns():
    """Files keep their SI columns; those of other units stand beside them, and that of Hz there is already."""
    units = ShownUnits.of({"scene": {"output": {"speed": "rpm", "frequency": "Hz"}}})
    row = {"speed": math.pi, "frequency": 4 * math.pi, "frequency_hz": 2.0}
    assert units.rows([row]) == [row | {"speed_rpm": pytest.approx(30.0)}]
    assert ShownUnits.of({}).rows([row]) == [row]
