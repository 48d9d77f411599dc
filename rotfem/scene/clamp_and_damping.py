"""What the structures of a scene share: damping and the position of the clamp."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Self, TypeAlias

import numpy as np
from pydantic import ConfigDict, PlainValidator, model_validator
from pydantic_core import PydanticCustomError

from rotfem.registry import damping_models
from rotfem.scene.values import Bounds, NonNegative, SceneModel, as_vector, problem

#: One ratio for the first modes, one for each in the order of frequency, or family ↦ such ratios.
Ratios: TypeAlias = float | tuple[float, ...] | dict[str, tuple[float, ...]]

_RATIO = Bounds(ge=0.0, lt=1.0)


def _as_rayleigh(value: Any) -> tuple[float, float]:
    a0, a1 = as_vector(value, (2,))
    if a0 < 0.0 or a1 < 0.0:
        raise problem("", value, "must be [a0, a1], both at least 0")
    return a0, a1


def _as_modal(value: Any) -> Ratios:
    if isinstance(value, Mapping):
        return {str(family): _as_ratios(given, str(family)) for family, given in value.items()}
    return _as_ratios(value, "") if isinstance(value, list | tuple) else _RATIO.number(value)


def _as_ratios(value: Any, key: str) -> tuple[float, ...]:
    """Return ratios in the order of frequency; a number is one."""
    entries = value if isinstance(value, list | tuple) else [value]
    try:
        return tuple(_RATIO.number(entry) for entry in entries)
    except PydanticCustomError as error:
        many = "must be damping ratios (0.005 is half a per cent); one " if entries is value else ""
        raise problem(key, value, f"{many}{error.message()}") from None


class Damping(SceneModel):
    """The [structure.damping] table.

    Attributes:
        kelvin_voigt: η (s) in stress = C (ε + η ε̇).
        rayleigh: (a0, a1): mass-proportional (1/s) and stiffness-proportional (s) coefficient.
        modal: damping ratios of modes at rest: one for the first ten, one for each in the order of frequency, or by
            family. See `rotfem.equations.modal_damping`.

    The coefficients of registered damping models are further keys.
    """

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, NonNegative]

    kelvin_voigt: NonNegative = 0.0
    rayleigh: Annotated[tuple[float, float], PlainValidator(_as_rayleigh)] = (0.0, 0.0)
    modal: Annotated[Ratios, PlainValidator(_as_modal)] = 0.0

    @classmethod
    def keys(cls) -> list[str]:
        """Return the keys of the table and those of all registered models."""
        return [*super().keys(), *damping_models.names]

    @model_validator(mode="after")
    def _check_models(self) -> Self:
        for name in self.models:
            if name not in damping_models:
                raise problem(name, self.models[name], "is no registered damping model")
        return self

    @property
    def models(self) -> dict[str, float]:
        """Coefficients of registered models by name, those that are not zero."""
        return {name: c for name, c in self.__pydantic_extra__.items() if c != 0.0}

    @property
    def is_zero(self) -> bool:
        """Whether there is no damping at all."""
        return self.kelvin_voigt == 0.0 and self.rayleigh == (0.0, 0.0) and not self.has_modal and not self.models

    @property
    def has_modal(self) -> bool:
        """Whether modes at rest have ratios that are not zero."""
        families = self.modal.values() if isinstance(self.modal, dict) else [self.modal]
        return any(bool(np.any(np.asarray(ratios))) for ratios in families)


def check_one_hub(hub_radius: float, hub_offset: tuple[float, float, float] | None) -> None:
    """Refuse a clamp whose position is given twice."""
    if hub_offset is not None and hub_radius != 0.0:
        raise problem("hub_offset", hub_offset, "give either hub_radius or hub_offset")
