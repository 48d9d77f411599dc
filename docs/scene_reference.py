"""Writes docs/scene-reference.md from the tables of the program, so that it says what they say.

./with-fenicsx python3 docs/scene_reference.py
"""

from __future__ import annotations

import inspect
import itertools
import json
import math
import re
import typing
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import NoneType, UnionType
from typing import Any

from pydantic.fields import FieldInfo

from rotfem import registry
from rotfem.scene import beams, loads, motion, plates, section, settings, structure, supports
from rotfem.scene.extensions import Extensions
from rotfem.scene.scene import Scene
from rotfem.scene.table import SceneModel
from rotfem.scene.values import padded, parameters_of

PAGE = Path(__file__).with_name("scene-reference.md")

HEAD = """# Scene keys

All tables of a scene with their keys. `docs/scene_reference.py` writes this page from the tables of the program. What
goes beyond one key is in [scene.md](scene.md).

A default of – is none. Rows are `[[x, value], …]` over the span or `[[t, value], …]` over time, or the path of a CSV
file of them. Where a number has a unit, a text may give another one: `"12.1 rpm"`. A table that is a kind of another
one has its keys too. A test checks every example.
"""

#: Heading, table, example and the structure that the example is about.
TABLES: tuple[tuple[str, type[SceneModel], str], ...] = (
    ("Above all tables", Scene, "toml\naccuracy = 1e-3\naccuracy_budget = '2 min'"),
    (
        '`[structure]`, `type = "planar_beam"`',
        beams.PlanarBeamStructure,
        "toml\n[structure]\ntype = 'planar_beam'\nlength = 10.0\nhub_radius = 1.0\ntip_mass = 0.5\n"
        "section = { EA = 2.8e7, GA = 1e7, EI = 1.4e4, mass_per_length = 1.2 }",
    ),
    (
        '`[structure]`, `type = "spatial_beam"`',
        beams.SpatialBeamStructure,
        "toml\n[structure]\ntype = 'spatial_beam'\nlength = 20.0\nhub_radius = 1.0\nprecone = '2.5 deg'\n"
        "pretwist = [[0, '13 deg'], [20, 0]]\n[structure.section]\nshape = 'rectangle'\n"
        "width = [[0, 1.0], [20, 0.4]]\nheight = [[0, 0.2], [20, 0.05]]\nE = '30 GPa'\nnu = 0.3\nrho = 1900",
    ),
    (
        '`[structure]`, `type = "plate"`',
        plates.PlateStructure,
        "toml\n[structure]\ntype = 'plate'\nlength = 2.0\nwidth = 0.5\nthickness = '5 mm'\nE = '70 GPa'\nnu = 0.33\n"
        "rho = 2700\npoint_masses = [[1.9, 0.0, 0.2]]\nline_masses = { tip = 0.5 }",
    ),
    ("`[structure.section]` of a planar beam", section.PlanarSection, ""),
    ("`[structure.section]` of a spatial beam", section.SpatialSection, ""),
    (
        "`[structure.damping]`",
        structure.DampingTable,
        "toml\n[structure.damping]\nkelvin_voigt = 1e-4\nmodal = [0.0048, 0.0048, 0.006]",
    ),
    (
        "`[structure.root]` of a planar beam",
        structure.Root,
        "toml\n[structure.root]\nlag_stiffness = 5e4\nlag_damping = 20",
    ),
    (
        "`[structure.root]` of a spatial beam",
        structure.SpatialRoot,
        "toml spatial\n[structure.root]\nflap_stiffness = 0\nlag_stiffness = 0\nhinge_offset = 0.3\npitch = '8 deg'",
    ),
    (
        "`structure.root.pitch` as a table",
        structure.PitchAngle,
        "toml spatial\n[structure.root.pitch]\nvalue = '8 deg'\n"
        "harmonic = [{ amplitude = '3 deg', per_rev = 1, phase = '90 deg' }]",
    ),
    (
        "`[[structure.supports]]`",
        supports.SupportTable,
        "toml spatial\nmotion = { type = 'constant', speed = 100, axis = [1, 0, 0] }\n[structure]\n"
        "root = { driven = true }\nsupports = [{ x = 0, stiffness = 1e6, damping = 200 }, { x = 10, stiffness = 1e6 }]",
    ),
    (
        "Coefficients of supports as tables",
        supports.CoefficientTable,
        "toml spatial\nmotion = { type = 'constant', speed = 100, axis = [1, 0, 0] }\n[structure]\n"
        "supports = [{ x = 10, stiffness = { over_speed = [[0, 1e6], [100, 2e6, 3e6]] } }]",
    ),
    (
        "`housing` of a support",
        supports.Housing,
        "toml spatial\nmotion = { type = 'constant', speed = 100, axis = [1, 0, 0] }\n[structure]\n"
        "supports = [{ x = 10, stiffness = 1e6, housing = [{ mass = 20, stiffness = 5e6 }] }]",
    ),
    (
        "`[[structure.masses]]`",
        beams.SpatialPointMass,
        "toml spatial\n[[structure.masses]]\nx = 4.0\nmass = 2.0\noffset = [0, 0.1, 0]\ninertia = 0.02",
    ),
    (
        "`disk` of a mass",
        beams.DiskTable,
        "toml spatial\n[[structure.masses]]\nx = 4.0\n"
        "disk = { outer_diameter = '280 mm', width = '70 mm', rho = 7810 }",
    ),
    ("`[motion]`, of every type", motion.MotionTable, ""),
    ('`[motion]`, `type = "constant"`', motion.ConstantMotion, "toml\n[motion]\ntype = 'constant'\nspeed = '12.1 rpm'"),
    (
        '`[motion]`, `type = "spin_up"`',
        motion.SpinUpMotion,
        "toml\n[motion]\ntype = 'spin_up'\nspeed = 6.0\nduration = 15.0\n[time]\nend = 20.0\nstep = 0.01",
    ),
    (
        '`[motion]`, `type = "table"`',
        motion.TableMotion,
        "toml\n[motion]\ntype = 'table'\ntable = [[0, 0], [2, '60 rpm'], [5, '60 rpm']]\n"
        "[time]\nend = 5.0\nstep = 0.01",
    ),
    (
        '`[motion]`, `type = "torque"`',
        motion.TorqueMotion,
        "toml\n[motion]\ntype = 'torque'\nhub_inertia = 200.0\npulses = [[0, 0.5, 400], [2, 2.5, -400]]\n"
        "[time]\nend = 4.0\nstep = 0.01",
    ),
    ('`[motion]`, `type = "callable"`', motion.CallableMotion, ""),
    (
        "`[model]`",
        settings.ModelTable,
        "toml\n[model]\ntheory = 'consistent_linear'\neffects = ['coriolis', 'centrifugal', 'euler']",
    ),
    (
        "`[initial]`",
        settings.Initial,
        "toml\n[initial]\nmode = 1\namplitude = 0.05\n[time]\nend = 2.0\nstep = 0.01",
    ),
    (
        "`[loads]`",
        loads.LoadsTable,
        "toml\n[loads]\ntip_force = { over_time = [[0, 0, 0], [0.1, 0, 50]], kind = 'follower' }\n"
        "distributed_moment = { over_span = [[0, 0], [10, 0.4]] }\n[time]\nend = 1.0\nstep = 0.01",
    ),
    ("A load", loads.LoadTable, "toml\n[loads.tip_force]\nvalue = [0, 20]\nkind = 'dead'"),
    (
        "A load over the span",
        loads.SpanLoad,
        "toml\n[loads.distributed]\nover_span = [[0, 0, 0], [4, 0, 3], [4, 0, 0], [10, 0, 0]]",
    ),
    (
        "`[loads.pressure]`",
        loads.Pressure,
        "toml plate\n[loads.pressure]\nover_span = [[0, 100], [2, 0]]\nkind = 'follower'",
    ),
    ("`[[loads.at]]`", loads.PointLoad, "toml\n[[loads.at]]\nx = 4.0\nforce = [0, 20]"),
    (
        "`[[loads.unbalance]]`",
        loads.UnbalanceTable,
        "toml spatial\nmotion = { type = 'constant', speed = 100, axis = [1, 0, 0] }\n"
        "[[loads.unbalance]]\nx = 4.0\nkg_m = 1e-3\nphase = '30 deg'",
    ),
    (
        "`harmonic` of a load",
        loads.Harmonic,
        "toml\n[loads]\ntip_force = { harmonic = { amplitude = [0, 1], frequency = '1 Hz' } }",
    ),
    ("`[mesh]` of a beam", settings.BeamMesh, "toml\n[mesh]\nelements = 8\ndegree = 3"),
    ("`[mesh]` of a plate", settings.PlateMesh, "toml plate\n[mesh]\nelements = [16, 4]\ncell = 'triangle'"),
    ("`[time]`", settings.Time, "toml\n[time]\nend = 20.0\ntolerance = 1e-4\nscheme = 'esdirk4'\noutput_step = 0.02"),
    ("`[modes]`", settings.ModesTable, "toml\n[modes]\ncount = 8\nabout = 'steady'"),
    ("`[solver]`", settings.Solver, "toml\n[solver]\nmax_iterations = 50"),
    (
        "`[output]`",
        settings.OutputTable,
        "toml\n[output]\nstations = [0, 2.5, 5]\nquantities = ['M', 'N']\nspeed = 'rpm'\nfrequency = 'Hz'",
    ),
    ("`[extensions]`", Extensions, ""),
)

COLUMNS = "| key | type | unit | default | meaning |\n|---|---|---|---|---|"
_UNIT = re.compile(r" ?\(((?:1|m|kg|N|Pa|rad|s|J|[·/²³⁴^ ,-])+)\)")


def described(table: type) -> dict[str, str]:
    """Return key ↦ what the docstrings of a table and of those it derives from say of it."""
    out: dict[str, str] = {}
    for base in reversed(table.__mro__):
        _, _, text = inspect.cleandoc(base.__doc__ or "").partition("Attributes:\n")
        for names, meaning in re.findall(r"^ {4}([\w, ]+): (.*(?:\n {8}.*)*)", text, re.MULTILINE):
            out |= dict.fromkeys(names.split(", "), re.sub(r"\s*\n\s*", " ", meaning))
    return out


def kind(annotation: Any, metadata: Sequence[Any] = ()) -> str:
    """Return in words what a value may be."""
    if typing.get_origin(annotation) is typing.Annotated:
        annotation, *more = typing.get_args(annotation)
        return kind(annotation, [*more, *metadata])
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if annotation in (float, int):
        bounds = [each for m in metadata for each in getattr(m, "metadata", [m])]
        signs = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤"}
        said = [
            f"{sign} {getattr(b, name):g}".replace("e-0", "e-")
            for b in bounds
            for name, sign in signs.items()
            if abs(getattr(b, name, math.inf)) < 1e9
        ]
        return f"{'number' if annotation is float else 'integer'} {', '.join(said)}".strip()
    if origin is typing.Literal:
        return ", ".join(f'`"{name}"`' for name in arguments)
    if isinstance(annotation, type) and issubclass(annotation, SceneModel):
        name = re.sub("([a-z])([A-Z])", r"\1 \2", annotation.__name__.removesuffix("Table")).lower()
        return name if issubclass(annotation, loads.Signal) else "table"
    if origin in (typing.Union, UnionType):
        return ", ".join(dict.fromkeys(kind(a) for a in arguments if a is not NoneType))
    if any(getattr(m, "func", None) is padded for m in metadata):
        return "2 or 3 numbers"
    if origin is tuple:
        entries = {kind(a) for a in arguments if a is not ...}
        if entries == {"table"}:
            return "list of tables"
        if entries & {"list"} or any("numbers" in entry for entry in entries):
            return "rows"
        return "list" if ... in arguments or len(entries) > 1 else f"{len(arguments)} numbers"
    words = {bool: "true, false", str: "text", dict: "table", Callable: "Python function", Any: "list"}
    return words[origin or annotation]


def default(field: FieldInfo) -> str:
    """Return the default as a scene would have it."""
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True)
    if value is None or isinstance(value, SceneModel) or value in ((), {}):
        return "–"
    if isinstance(value, str | bool):
        return f"`{json.dumps(value)}`"
    if isinstance(value, tuple) and not any(itertools.chain(*(v if isinstance(v, tuple) else [v] for v in value))):
        return "0"
    return f"`{list(value)}`".replace(".0", "") if isinstance(value, tuple) else f"`{value:.7g}`"


def rows(table: type[SceneModel]) -> Iterator[str]:
    """Yield a row of the page for each key that no table before it has for all of its kind."""
    says, tables = described(table), [of for _, of, _ in TABLES]
    known = {key for base in table.__mro__[1:] if base in tables for key in base.model_fields} | {"type"}
    for name, field in table.model_fields.items():
        if name in known or (table is Scene and not name.startswith("accuracy")):
            continue
        words, meaning = kind(field.annotation, field.metadata), says.get(name, field.description or "")
        units = list(_UNIT.finditer(meaning))
        unit = units[-1 if words == "Python function" else 0] if units else None
        meaning = meaning.replace(unit[0], "", 1) if unit else meaning
        meaning = re.sub("[,;]? or None|None if not given", "", meaning).replace("None", "none")
        meaning = meaning.replace("|", "\\|").strip(" .;")
        yield f"| `{name}` | {words} | {unit[1] if unit else ''} | {default(field)} | {meaning} |"


def page() -> str:
    """Return the whole page."""
    out = [HEAD]
    for heading, table, example in TABLES:
        out += [f"## {heading}\n", COLUMNS, *rows(table), ""]
        if issubclass(table, section.Section):
            out += ["Give exactly one of these sets:\n", *(f"- {way.name}: {way}" for way in table.WAYS)]
            for shape in registry.shapes:
                sizes = " or ".join(", ".join(choice) for choice in shape.choices)
                out.append(f'- `shape = "{shape.name}"`, E, nu, rho, and in m {sizes}')
            out.append("")
        if table is settings.Time:
            out += ["Parameters of schemes are keys too:\n"]
            for scheme in registry.schemes:
                given = (f"`{key} = {field.default:g}`" for key, field in parameters_of(scheme).items())
                out.append(f"- `{scheme.name}`: {', '.join(given) or 'none'}")
            out.append("")
        out += [f"```{example}\n```\n".replace("'", '"')] if example else []
    lists = (("Theories", registry.theories), ("Effects", registry.effects), ("Schemes", registry.schemes))
    out += ["## Names\n", *(f"- {title}: {', '.join(f'`{n}`' for n in names.names)}" for title, names in lists)]
    return "\n".join(out) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
