"""ROSS's rotor files, TOML or JSON, as `Rotor.save` writes them: shaft, disks, point masses, bearings, seals, housings.

ROSS has z along the shaft and x, y across it, which are our axes 1, 2 and 3: the spin keeps its sense, and [[kxx, kxy],
[kyx, kyy]] is our matrix. Rows over `frequency` are over the speed, as ROSS takes them. Elements of one node are
layers, which share displacements and turns, so that stiffness and mass add up.
"""

from __future__ import annotations

import json
import re
import tomllib
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import AliasChoices, BaseModel, ConfigDict, Field, ValidationError, create_model

from rotfem.registry import register
from rotfem.scene.blades.deck import Asked, BladeFormat, Deck
from rotfem.scene.section_shapes import tube
from rotfem.scene.table import LISTED, scene_error
from rotfem.scene.values import Array, NonNegative, Number, Positive

#: Rows of a cone in a shaft of layers; stiffness is linear between.
CONE_ROWS = 33
#: Keys of a shaft element that are left out ↦ their value where they change nothing, and the key of a scene for them.
LEFT_OUT: dict[str, tuple[Any, str]] = {
    "shear_effects": (True, "structure.section.shear_correction"),
    "rotary_inertia": (True, "model.effects"),
    "gyroscopic": (True, "model.effects"),
    "axial_force": (0.0, "loads.tip_force"),
    "torque": (0.0, ""),
    "alpha": (0.0, ""),
    "beta": (0.0, ""),
}
Node = Annotated[int, Field(strict=True, ge=0)]
Over = Annotated[tuple[Number, ...], LISTED, Field(min_length=1)]
ZERO = (0.0,)


class Element(BaseModel):
    """An element at a node; further keys say how it was computed, or is drawn."""

    n: Node


class Material(BaseModel):
    """Young's and shear modulus (Pa), density (kg/m³)."""

    E: Positive
    G_s: Positive
    rho: Positive


class ShaftElement(Element):
    """A cylinder or a cone from its node to the next one."""

    model_config = ConfigDict(extra="allow")

    L: Positive
    idl: NonNegative
    odl: Positive
    idr: NonNegative
    odr: Positive
    material: Material
    shear_method_calc: Literal["cowper", "hutchinson"] = "cowper"

    def tube(self, s: Array) -> dict[str, Array]:
        """Return radii (m), material and shear correction at parts s of its length."""
        ends = {"outer_radius": (self.odl, self.odr), "inner_radius": (self.idl, self.idr)}
        out: dict[str, Any] = {key: np.interp(s, [0, 1], values).round(12) / 2 for key, values in ends.items()}
        out |= {"E": np.full_like(s, self.material.E), "rho": np.full_like(s, self.material.rho)}
        out["nu"] = nu = out["E"] / (2 * self.material.G_s) - 1
        out["shear_correction"] = tube(nu, out["outer_radius"], out["inner_radius"]).shear_correction
        if self.shear_method_calc == "hutchinson":  # J. Appl. Mech. 68 (2001) 87-92
            m2 = (out["inner_radius"] / out["outer_radius"]) ** 2
            both, bore = (1 + m2) ** 2, 4 * m2 * (5 + 6 * nu + 2 * nu**2)
            out["shear_correction"] = 6 * both * (1 + nu) / (both * (7 + 12 * nu + 4 * nu**2) + bore)
        return out


class DiskElement(Element):
    """A disk or a gear."""

    m: NonNegative
    Ip: NonNegative
    Id: NonNegative


class PointMass(Element):
    """A mass on the shaft, or of a housing."""

    mx: NonNegative
    my: NonNegative


class Bearing(Element):
    """A bearing or a seal on the ground or on another node."""

    n_link: Node | None = None
    frequency: Over | None = Field(None, validation_alias=AliasChoices("frequency", "omega", "speed"))

    def series(self, letter: str) -> Array:
        """Return the coefficients xx, xy, yx, yy of a letter, (frequencies, 4)."""
        columns = (getattr(self, letter + d) for d in ("xx", "xy", "yx", "yy"))
        return np.stack([np.broadcast_to(values, len(self.frequency or ZERO)) for values in columns], axis=-1)

    def coefficients(self) -> dict[str, Any]:
        """Return stiffness and damping, those that are not zero."""
        out: dict[str, Any] = {}
        for key, rows in (("stiffness", self.series("k")), ("damping", self.series("c"))):
            coupled, differ = np.any(rows[:, 1:3]), np.any(rows[:, 0] != rows[:, 3])
            if np.any(rows != rows[0]):
                values = rows if coupled else rows[:, [0, 3]] if differ else rows[:, :1]
                out[key] = {"over_speed": np.column_stack([self.frequency or ZERO, values]).tolist()}
            elif np.any(rows):
                out[key] = rows[0].reshape(2, 2).tolist() if coupled or differ else float(rows[0, 0])
        return out


_COEFFICIENTS: Any = {f"{letter}{d}": (Over, ZERO) for letter in "kcm" for d in ("xx", "xy", "yx", "yy", "zz")}
BearingElement: Any = create_model("BearingElement", __base__=Bearing, **_COEFFICIENTS)

E = TypeVar("E", bound=Element)


def recognises(deck: Deck) -> bool:
    """Return whether it has the version of ROSS that wrote it."""
    return re.search(r'\bross_version"?\s*[:=]', deck.text) is not None


def elements(deck: Deck) -> dict[str, Element]:
    """Return name ↦ element of a file; a bearing of any class, and a gear, is known by its coefficients."""
    try:
        data = json.loads(deck.text) if deck.text.lstrip().startswith("{") else tomllib.loads(deck.text)
    except (ValueError, RecursionError) as error:
        deck.fail(f"not valid JSON or TOML: {error}")
    out = dict[str, Element]()
    for name, keys in data.items():
        if name in ("ross_version", "parameters") or name.startswith("_"):
            continue
        kinds: dict[str, type[Element]] = {"ShaftElement": ShaftElement, "PointMass": PointMass}
        known = {*keys} if isinstance(keys, dict) else set()
        kind = kinds.get(name.partition("_")[0], BearingElement if "kxx" in known else DiskElement)
        if kind is DiskElement and "Ip" not in known:
            deck.fail(f"{name} is none of what is read: shaft elements, disks, point masses, bearings and seals")
        try:
            out[name] = kind.model_validate(keys)
            if isinstance(element := out[name], Bearing):
                element.coefficients()
        except ValidationError as error:
            found = scene_error("", error)
            deck.fail(f"{name}.{found.key} {found.allowed}")
        except ValueError:
            deck.fail(f"{name}.frequency must have as many values as kxx, kxy, …")
    return out


def read(deck: Deck, asked: Asked) -> dict[str, Any]:
    """Return length, section, masses and supports of a rotor, and a root that holds it along and about its axis alone.

    Args:
        deck: the file.
        asked: what the scene gives; hints say what is left out.
    """
    every = elements(deck)

    def of(kind: type[E]) -> list[E]:
        return [element for element in every.values() if isinstance(element, kind)]

    for name, e in every.items():
        if isinstance(e, ShaftElement) and not (e.idl < e.odl and e.idr < e.odr and 3 * e.material.G_s >= e.material.E):
            deck.fail(f"{name} must have idl < odl, idr < odr and a material of G_s ≥ E/3")
    layers = dict[int, list[ShaftElement]]()
    for element in of(ShaftElement):
        layers.setdefault(element.n, []).append(element)
    if sorted(layers) != list(range(len(layers))) or not layers:
        deck.fail(
            "must have one shaft, its elements at n = 0, 1, … without a gap; coaxial and geared rotors have several"
        )
    if any(len({element.L for element in here}) > 1 for here in layers.values()):
        deck.fail("must have one L of all shaft elements of one n")
    x = [float(f"{place:.12g}") for place in np.cumsum([0.0, *(layers[n][0].L for n in sorted(layers))])]
    if beyond := [disk.n for disk in of(DiskElement) if disk.n >= len(x)]:
        deck.fail(f"a disk is at n = {beyond[0]}; must be a node of the shaft, 0 to {len(x) - 1}")
    for key, (usual, ours) in LEFT_OUT.items():
        if number := sum(getattr(element, key, usual) != usual for element in of(ShaftElement)):
            asked.leaves_out(deck, f"{key} of {number} shaft elements", ours)
    disks = [{"mass": disk.m, "polar_inertia": disk.Ip, "transverse_inertia": disk.Id} for disk in of(DiskElement)]
    masses: list[dict[str, Any]] = [{"x": x[e.n], **disk} for e, disk in zip(of(DiskElement), disks, strict=True)]
    housed = dict[int, float]()  # node ↦ mass
    for body in of(PointMass):
        if body.mx != body.my:
            deck.fail(f"the point mass at n = {body.n} must have mx = my")
        housed[body.n] = housed.get(body.n, 0.0) + body.mx
    masses += [{"x": x[n], "mass": housed.pop(n)} for n in sorted(housed) if n < len(x)]
    under = dict[int, list[Bearing]]()
    for bearing in of(Bearing):
        under.setdefault(bearing.n, []).append(bearing)
    supports = []
    for bearing in (b for n in range(len(x)) for b in under.pop(n, [])):
        support: dict[str, Any] = {"x": x[bearing.n], **bearing.coefficients()}
        node = bearing.n_link
        while node is not None:
            below = under.pop(node, [])
            if len(below) != 1:
                deck.fail(f"n_link = {node} must be the node of a housing, with one bearing on it and one under it")
            housing = {"mass": housed.pop(node, 0.0), **below[0].coefficients()}
            support["housing"], node = [*support.get("housing", []), housing], below[0].n_link
        supports += [support] if len(support) > 1 else []
        added = bearing.series("m")
        if np.all(added == added[0, 0] * np.array([1.0, 0.0, 0.0, 1.0])) and added[0, 0] >= 0.0:
            masses += [{"x": x[bearing.n], "mass": float(added[0, 0])}] if added[0, 0] > 0.0 else []
        else:
            asked.leaves_out(deck, f"mxx … myy of the bearing at n = {bearing.n}, which differ by direction or speed")
        if any(np.any(getattr(bearing, f"{letter}zz")) for letter in "kcm"):
            asked.leaves_out(deck, f"kzz, czz, mzz of the bearing at n = {bearing.n}")
    if lost := sorted({*under, *housed}):
        deck.fail(f"nothing links what is at n = {lost[0]} to the shaft, whose nodes are 0 to {len(x) - 1}")
    asked.leaves_out(deck, "that the shaft is free along and about its axis", "root.free")
    keys = {"length": x[-1], "root": {"driven": True}, "section": section([layers[n] for n in sorted(layers)], x)}
    return keys | {name: rows for name, rows in (("masses", masses), ("supports", supports)) if rows}


def section(layers: list[list[ShaftElement]], x: list[float]) -> dict[str, Any]:
    """Return the section: a tube of steps and cones, or stiffness and mass per length of a shaft with layers."""
    single = all(len(here) == 1 for here in layers)
    rows = dict[str, list[tuple[float, float]]]()
    for here, first, last in zip(layers, x, x[1:], strict=False):
        cone = any(e.idr != e.idl or e.odr != e.odl for e in here)
        s = np.linspace(0.0, 1.0, CONE_ROWS if cone and not single else 2, dtype=np.float64)
        tubes, places = [element.tube(s) for element in here], first + (last - first) * s
        for key, values in (tubes[0] if single else added(tubes)).items():
            rows.setdefault(key, []).extend(zip(map(float, places), map(float, values), strict=True))
    if single and all(here[0].shear_method_calc == "cowper" for here in layers):
        del rows["shear_correction"]
    out: dict[str, Any] = {key: table(each) for key, each in rows.items()}
    if out.get("inner_radius") == 0.0:
        del out["inner_radius"]
        return {"shape": "circle", "radius": out.pop("outer_radius"), **out}
    return {"shape": "tube", **out} if single else out


def added(tubes: list[dict[str, Array]]) -> dict[str, Array]:
    """Return stiffness and mass per length of layers."""
    out = dict[str, Any]()
    for layer in tubes:
        g = tube(layer["nu"], layer["outer_radius"], layer["inner_radius"])
        E, G, rho = layer["E"], layer["E"] / (2 + 2 * layer["nu"]), layer["rho"]
        each = {"EA": E * g.area, "GJ": G * g.torsion_constant, "mass_per_length": rho * g.area}
        each |= {f"GA{i}": layer["shear_correction"] * G * g.area for i in (2, 3)}
        each |= {f"{key}{i}": c * g.second_moment2 for key, c in (("EI", E), ("rotary_inertia", rho)) for i in (2, 3)}
        out = {key: out.get(key, 0.0) + value for key, value in each.items()}
    return out


def table(rows: list[tuple[float, float]]) -> float | list[tuple[float, float]]:
    """Return rows (x, value) without those between two of the same value; the value if it is the same everywhere."""
    values = [value for _, value in rows]
    kept = [rows[i] for i in range(len(rows)) if not 0 < i < len(rows) - 1 or len({*values[i - 1 : i + 2]}) > 1]
    return values[0] if len({*values}) == 1 else list(dict.fromkeys(kept))


register(BladeFormat("ross", "ROSS's rotor file, as Rotor.save writes it", recognises, read))
