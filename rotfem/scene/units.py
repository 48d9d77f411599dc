"""Values with units: "12.1 rpm", "3 deg", "0.7 Hz", "2 GPa" in the place of numbers, and the unit that each key has.

A scene is in SI units and in radians. What is written with a unit is turned into them before anything is validated, so
that nothing else of the program knows of units.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, TypeAlias, get_args

from rotfem.errors import SceneError
from rotfem.units import is_quantity, quantity, unit_of

#: A unit of all numbers below a key, or one for each column of its rows.
Unit: TypeAlias = str | tuple[str, ...]

#: Part of a scene ↦ unit ↦ its keys. Of a table [[x, value], …] it is that of the values; x is in m, t of motion and
#: loads in s.
_KEYS: dict[str, dict[Unit, str]] = {
    "structure": {
        "m": "length width thickness hub_radius hub_offset tip_offset masses.x masses.offset supports.x "
        "root.hinge_offset",
        ("m",): "line",
        "kg": "tip_mass masses.mass",
        ("kg*m**2",): "tip_inertia masses.inertia",
        "rad": "pretwist sweep precone root.pitch section.pretwist section.precone section.principal_angle",
        "Pa": "E E1 E2 G12 G13 G23 section.E",
        "kg/m**3": "rho section.rho",
        ("m", "m", "kg"): "point_masses",
        "kg/m": "line_masses section.mass_per_length",
        "s": "damping.kelvin_voigt",
        ("1/s", "s"): "damping.rayleigh",
        "dimensionless": "damping.modal",
        "N*m": "root.lag_stiffness root.flap_stiffness root.pitch_stiffness",
        "N/m": "supports.stiffness",
        "N*s/m": "supports.damping",
        "N*m*s": "root.lag_damping root.flap_damping root.pitch_damping",
    },
    "structure.section": {
        "N": "EA GA GA2 GA3",
        "N*m**2": "EI EI2 EI3 GJ",
        "kg*m": "rotary_inertia rotary_inertia2 rotary_inertia3",
        "m": "width height radius outer_radius inner_radius wall mass_center shear_center tension_center polar_radius",
        "m**2": "area",
        "m**4": "second_moment second_moment2 second_moment3 torsion_constant",
    },
    "motion": {
        "rad/s": "speed",
        "s": "duration",
        "kg*m**2": "hub_inertia",
        "N*m*s": "hub_damping",
        "m/s**2": "base_acceleration",
        ("s", "s", "N*m"): "pulses",
    },
    "initial": {"m": "tip_displacement amplitude", "rad": "phase", ("m", "m/s"): "velocity"},
    "loads": {
        "m/s**2": "gravity",
        "N": "tip_force distributed_moment at.force",
        "N*m": "tip_moment at.moment",
        "Pa": "pressure",
        "m": "at.x",
    },
    "modes": {"rad/s": "rated operating"},
    "output": {"m": "stations"},
    "time": {"s": "end step max_step min_step output_step breakpoints"},
}

#: Units in which speeds and frequencies can be printed and drawn.
AngularUnit = Literal["rad/s", "rpm", "Hz", "deg/s"]

#: Dotted key ↦ its unit.
UNITS: dict[str, Unit] = {
    f"{part}.{key}": unit for part, units in _KEYS.items() for unit, keys in units.items() for key in keys.split()
} | {"accuracy_budget": "s"}

#: Keys of whose unit something else of the scene decides: key ↦ (what does, its value ↦ the unit).
DEPENDING: dict[str, tuple[str, dict[str, Unit]]] = {
    "motion.table": ("motion.type", {"table": "rad/s", "torque": "N*m"}),
    "loads.distributed": ("structure.type", {"planar_beam": "N/m", "spatial_beam": "N/m", "plate": "N/m**2"}),
}

#: What any load, or the pitch, may have below it ↦ its unit; the unit of what is not here is that of the load.
HARMONIC: dict[str, Unit] = {"harmonic.frequency": "rad/s", "harmonic.per_rev": "", "harmonic.phase": "rad"}

#: Tables of loads whose first columns are no times ↦ units of these.
OVER: dict[str, tuple[str, ...]] = {"over_span": ("m",), "amplitude": ("m",), "over_span_and_time": ("m", "s")}

#: Part of a scene, or one of its keys ↦ unit of the first column of its tables.
_ABSCISSAE = {"structure": "m", "motion": "s", "loads": "s", "structure.root.pitch": "s"}


def in_si(tables: dict[str, Any], file: str) -> dict[str, Any]:
    """Return a scene's tables with every value that has a unit as a number in SI units and radians.

    Numbers are in SI units already and stay as they are; so does what is no value of a key that has a unit.

    Raises:
        SceneError: of the file: a unit is not known, or is not of the kind that the key needs.
    """
    return {
        str(part): _converted(value, (str(part),), lambda key: _unit_of(key, tables), file)
        for part, value in tables.items()
    }


def with_shown_speed(tables: dict[str, Any]) -> dict[str, Any]:
    """Return a scene's tables with the unit of motion.speed as that in which speeds are shown."""
    motion = tables.get("motion")
    return with_shown(tables, "speed", motion.get("speed") if isinstance(motion, Mapping) else None)


def with_shown(tables: dict[str, Any], what: str, given: object) -> dict[str, Any]:
    """Return a scene's tables with the unit of a text as output.speed or output.frequency.

    They stay as they are where they have that key, or the text has no unit that it may be.
    """
    output, unit = tables.get("output", {}), unit_of(given) if isinstance(given, str) else ""
    if not isinstance(output, Mapping) or what in output or unit not in get_args(AngularUnit):
        return tables
    return {**tables, "output": {**output, what: unit}}


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
    own = HARMONIC.get(".".join(key.split(".")[-2:]))
    if own is not None and key.startswith(("loads.", "structure.root.pitch.")):
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
    """Return a value, a vector or a table as numbers; `first` are units of columns before those of one unit."""
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
