"""Texts such as "12.1 rpm" as numbers in a unit that is wanted; the units are those of pint."""

from __future__ import annotations

import re
from contextlib import suppress
from contextvars import ContextVar
from functools import cache, lru_cache
from typing import Any

from rotfem.errors import InputError, SceneError

#: Unit in which messages show angular speeds besides rad/s.
SPEED: ContextVar[str] = ContextVar("SPEED", default="rad/s")

_NUMBER = r"(?>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
#: A name with a power of one digit: what a user writes is given to pint, which would compute 9**9**9 as well.
_NAMED = r"(?:[^\W\d]\w*|°|%)(?:(?:\*\*|\^)-?\d|⁻?[¹²³⁴])?"
_QUANTITY = re.compile(rf"\s*({_NUMBER})\s*((?:1\s*/\s*)?{_NAMED}(?:\s*[*/·\s]\s*{_NAMED})*)\s*")
#: Numbers, and the unit at the end of them all.
_NUMBERS = re.compile(r"\s*([-+0-9.eE:,\s]*[\d.])\s*([^\W\d].*?)?\s*")


def is_quantity(text: str) -> bool:
    """Return whether a text is written as a number with a unit, known or not."""
    return _QUANTITY.fullmatch(text) is not None


def quantity(text: str, unit: str) -> float:
    """Return the number of a text such as "12.1 rpm", in a unit."""
    found = _QUANTITY.fullmatch(text)
    if found is None:
        raise ValueError(f"must be a number ({shown(unit)}), or one with a unit in quotes")
    return float(found[1]) * _factor(found[2].strip(), unit)


def unit_of(text: str) -> str:
    """Return the unit at the end of a text such as "12.1 rpm" or "0:15:31rpm"; empty where there is none."""
    found = _NUMBERS.fullmatch(text)
    return found[2] or "" if found else ""


def si(value: float | str, unit: str, key: str) -> float:
    """Return a number in a unit, of a number or a text such as "12.1 rpm"."""
    try:
        return quantity(value, unit) if isinstance(value, str) else value
    except ValueError as error:
        raise InputError(key, value, str(error)) from None


def split_unit(text: str, unit: str = "rad/s") -> tuple[str, float]:
    """Return the numbers of a text without the unit that ends it, and that unit in the wanted one; 1 without."""
    found = _NUMBERS.fullmatch(text)
    if found is None:
        raise ValueError("must be numbers, with a unit at the end of them all or without")
    return found[1], quantity(f"1 {found[2]}", unit) if found[2] else 1.0


def seconds_of(text: str | float, file: str = "", key: str = "cost --budget") -> float:
    """Return seconds from a number, or text such as "60s", "2min", "1h"."""
    with suppress(ValueError):
        number, unit = split_unit(str(text), "s")
        if 0.0 < (value := float(number) * unit) < 1e9:
            return value
    raise SceneError(file, key, text, "must be a time greater than 0, such as 60s, 2min or 1h")


def speed_text(omega: float, digits: int = 6) -> str:
    """Return an angular speed (rad/s) as messages have it: "3.8 rad/s", or "3.8 rad/s (36.3 rpm)"."""
    text, unit = f"{omega:.{digits}g} rad/s", SPEED.get()
    return text if unit == "rad/s" else f"{text} ({omega / quantity(f'1 {unit}', 'rad/s'):.{digits}g} {unit})"


def shown(unit: str) -> str:
    """Return a unit as it is printed: kg·m², N·m."""
    return re.sub(r"\*\*([234])", lambda power: "²³⁴"[int(power[1]) - 2], unit).replace("*", "·")


@cache
def _registry() -> Any:
    """Return pint's units, in which a hertz is a turn a second, as it is of everything that has a frequency here."""
    import pint  # takes a fifth of a second: only where there is a unit

    registry: Any = pint.UnitRegistry(cache_folder=None)
    for definition in ("hertz = turn / second = Hz", "@alias turn = rev", "newton_meter = newton * meter = Nm"):
        registry.define(definition)
    return registry


@lru_cache(maxsize=256)
def _factor(name: str, unit: str) -> float:
    """Return how many of a unit another one is."""
    import pint

    registry = _registry()
    try:
        one = registry.Quantity(1.0, registry.parse_units(name))
        return float(one.m_as(unit) if unit else one.to_base_units().magnitude)
    except pint.DimensionalityError:
        raise ValueError(f"{name!r} is no unit of the kind of {shown(unit)}") from None
    except Exception:  # pint has errors of its own, Python's tokenizer and parser theirs
        raise ValueError(f"{name!r} is no unit that is known; must be one of the kind of {shown(unit)}") from None
