"""Values with units: "12.1 rpm", "3 deg", "0.7 Hz", "2 GPa" in the place of numbers, and the unit that each key has.

A scene is in SI units and in radians. What is written with a unit is turned into them before anything is validated, so
that nothing else of the program knows of units.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

from rotfem.errors import SceneError
from rotfem.units import is_quantity, quantity

#: A unit of all numbers below a key, or one for each column of its rows.
Unit: TypeAlias = str | tuple[str, ...]

_STIFFNESS = dict.fromkeys(("EA", "GA", "GA2", "GA3"), "N") | dict.fromkeys(("EI", "EI2", "EI3", "GJ"), "N*m**2")
_MODULI = dict.fromkeys(("E", "E1", "E2", "G12", "G13", "G23"), "Pa")
_LENGTHS = ("width", "height", "radius", "outer_radius", "inner_radius", "wall")
_INERTIAS = dict.fromkeys(("rotary_inertia", "rotary_inertia2", "rotary_inertia3"), "kg*m")
_MOMENTS_OF_AREA = dict.fromkeys(("second_moment", "second_moment2", "second_moment3", "torsion_constant"), "m**4")

#: Dotted key ↦ its unit. Of a table [[x, value], …] it is that of the values; x is in m, t of motion and loads in s.
UNITS: dict[str, Unit] = {
    **{f"structure.{key}": "m" for key in ("length", "width", "thickness", "hub_radius", "hub_offset", "tip_offset")},
    "structure.line": ("m",),
    "structure.tip_mass": "kg",
    "structure.tip_inertia": ("kg*m**2",),
    **{f"structure.{key}": "rad" for key in ("pretwist", "sweep", "precone")},
    **{f"structure.section.{key}": "rad" for key in ("pretwist", "precone", "principal_angle")},
    **{f"structure.{key}": unit for key, unit in _MODULI.items()},
    "structure.rho": "kg/m**3",
    "structure.point_masses": ("m", "m", "kg"),
    "structure.line_masses": "kg/m",
    **{f"structure.section.{key}": unit for key, unit in (_STIFFNESS | _INERTIAS | _MOMENTS_OF_AREA).items()},
    **{
        f"structure.section.{key}": "m"
        for key in (*_LENGTHS, "mass_center", "shear_center", "tension_center", "polar_radius")
    },
    "structure.section.mass_per_length": "kg/m",
    "structure.section.E": "Pa",
    "structure.section.rho": "kg/m**3",
    "structure.section.area": "m**2",
    "structure.damping.kelvin_voigt": "s",
    "structure.damping.rayleigh": ("1/s", "s"),
    "structure.damping.modal": "dimensionless",
    "accuracy_budget": "s",
    "motion.speed": "rad/s",
    "motion.duration": "s",
    "motion.hub_inertia": "kg*m**2",
    "motion.hub_damping": "N*m*s",
    "motion.base_acceleration": "m/s**2",
    "motion.pulses": ("s", "s", "N*m"),
    "initial.tip_displacement": "m",
    "initial.amplitude": "m",
    "initial.phase": "rad",
    "initial.velocity": ("m", "m/s"),
    "loads.gravity": "m/s**2",
    "loads.tip_force": "N",
    "loads.tip_moment": "N*m",
    "loads.distributed_moment": "N",
    "loads.pressure": "Pa",
    "loads.at.x": "m",
    "loads.at.force": "N",
    "loads.at.moment": "N*m",
    **{f"structure.root.{name}_stiffness": "N*m" for name in ("lag", "flap", "pitch")},
    **{f"structure.root.{name}_damping": "N*m*s" for name in ("lag", "flap", "pitch")},
    "structure.root.hinge_offset": "m",
    "structure.root.pitch": "rad",
    "structure.masses.x": "m",
    "structure.masses.mass": "kg",
    "structure.masses.offset": "m",
    "structure.masses.inertia": ("kg*m**2",),
    "output.stations": "m",
    **{f"time.{key}": "s" for key in ("end", "step", "max_step", "min_step", "output_step")},
}

#: Keys of whose unit something else of the scene decides: key ↦ (what does, its value ↦ the unit).
DEPENDING: dict[str, tuple[str, dict[str, Unit]]] = {
    "motion.table": ("motion.type", {"table": "rad/s", "torque": "N*m"}),
    "loads.distributed": (
        "structure.type",
        {"planar_beam": "N/m", "spatial_beam": "N/m", "plate": "N/m**2"},
    ),
}

#: What any load, or the pitch, may have below it ↦ its unit; the unit of what is not here is that of the load.
HARMONIC: dict[str, Unit] = {"harmonic.frequency": "rad/s", "harmonic.per_rev": "", "harmonic.phase": "rad"}

#: Tables of loads whose first columns are no times ↦ units of these.
OVER: dict[str, tuple[str, ...]] = {"over_span": ("m",), "amplitude": ("m",), "over_span_and_time": ("m", "s")}

#: Part of a scene, or one of its keys ↦ unit of the first column of its tables.
_ABSCISSAE = {"structure": "m", "motion": "s", "loads": "s", "structure.root.pitch": "s"}


def in_si(tables: dict[str, Any], file: str) -> dict[str, Any]:
    """Return a scene's tables with every value that has a unit as a number in SI units and radians.

    Args:
        tables: nested tables of a scene; not changed. Numbers are in SI units already and stay as they are; so does
            what is no value of a key that has a unit.
        file: name for error messages.

    Raises:
        SceneError: a unit is not known, or is not of the kind that the key needs.
    """
    return {
        str(part): _converted(value, (str(part),), lambda key: _unit_of(key, tables), file)
        for part, value in tables.items()
    }


def _converted(value: Any, path: tuple[str, ...], unit_of: Callable[[str], Unit | None], file: str) -> Any:
    """Return what stands below a key, in SI units; `path` has the numbers of the entries of lists as well."""
    if isinstance(value, Mapping):
        return {key: _converted(entry, (*path, str(key)), unit_of, file) for key, entry in value.items()}
    if isinstance(value, list) and any(isinstance(entry, Mapping) for entry in value):
        return [_converted(entry, (*path, str(i)), unit_of, file) for i, entry in enumerate(value)]
    if not _has_text(value):
        return value
    key = ".".join(part for part in path if not part.isdigit())
    unit = unit_of(key)
    if unit is None or (isinstance(value, str) and not is_quantity(value)):
        return value
    try:
        over_time = next((name for name in (key, key.rpartition(".")[0]) if name in _ABSCISSAE), path[0])
        first = OVER.get(path[-1], (_ABSCISSAE.get(over_time, ""),))
        return _in_units(value, unit, first)
    except ValueError as error:
        raise SceneError(file, ".".join(path), value, str(error)) from None


def _has_text(value: Any) -> bool:
    if isinstance(value, list | tuple):
        return any(_has_text(entry) for entry in value)
    return isinstance(value, str)


def _unit_of(key: str, tables: Mapping[str, Any]) -> Unit | None:
    """Return the unit of a dotted key, or of the nearest table above that has one; None if there is none."""
    if (
        key.startswith(("loads.", "structure.root.pitch."))
        and (own := HARMONIC.get(".".join(key.split(".")[-2:]))) is not None
    ):
        return own
    while key:
        if key in UNITS:
            return UNITS[key]
        if key in DEPENDING:
            other, units = DEPENDING[key]
            part, name = other.split(".")
            table = tables.get(part)
            return units.get(str(table.get(name))) if isinstance(table, Mapping) else None
        key = key.rpartition(".")[0]
    return None


def _in_units(value: Any, unit: Unit, first: tuple[str, ...]) -> Any:
    """Return a value, a vector or a table as numbers.

    Args:
        value: a text, a number, or lists of them.
        unit: of the numbers, or of the columns of the rows.
        first: units of the first columns of a table whose columns have no units of their own.
    """
    if isinstance(value, str):
        return quantity(value, unit if isinstance(unit, str) else unit[0])
    if not isinstance(value, list | tuple):
        return value
    if any(isinstance(entry, list | tuple) for entry in value):
        columns = unit if isinstance(unit, tuple) else (*first, unit)
        return [_row(entry, columns) if isinstance(entry, list | tuple) else entry for entry in value]
    return _row(value, unit if isinstance(unit, tuple) else (unit,))


def _row(entries: Sequence[Any], units: tuple[str, ...]) -> list[Any]:
    """Return the entries of a row in the units of its columns; the last unit is that of all further ones."""
    return [
        quantity(entry, units[min(i, len(units) - 1)]) if isinstance(entry, str) else entry
        for i, entry in enumerate(entries)
    ]
