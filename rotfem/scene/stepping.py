"""The [time] table: how long, in which steps and by which scheme, whose parameters are keys of the table too."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any, Self

import pydantic
from pydantic import ConfigDict, ValidationInfo, model_validator

from rotfem import registry
from rotfem.errors import show
from rotfem.scene.values import Count, Number, Positive, SceneModel, as_name, problem


def parameters_of(scheme: type) -> dict[str, Field[Any]]:
    """Return name ↦ field of the parameters of a class of `Scheme`."""
    return {field.name: field for field in fields(scheme) if field.init} if is_dataclass(scheme) else {}


def estimates_error(scheme: type) -> bool:
    """Return whether a class of `Scheme` says `local_error` itself, rather than have what all schemes inherit."""
    base: Any = next(parent for parent in scheme.__mro__ if "registry" in vars(parent))
    own: Any = scheme
    return own.local_error is not base.local_error


def usual(given: Mapping[str, Any]) -> str:
    """Return the name of the scheme of a [time] table that names none, by what it gives.

    Fixed steps are generalised-α's; to a tolerance one of higher order needs far fewer steps.
    """
    fixed = "generalised_alpha"
    of_fixed = any(key in given for key in parameters_of(registry.schemes[fixed]))
    return "esdirk4" if given.get("tolerance") is not None and not of_fixed else fixed


class Time(SceneModel):
    """The [time] table. Either step or tolerance is given; the parameters of the scheme are keys as well.

    Attributes:
        end: final time (s).
        step: time step (s), or None for adaptive steps.
        tolerance: error of all adaptive steps together, relative to the largest displacement, or None.
        max_step: longest adaptive step (s), or None.
        min_step: shortest adaptive step (s), or None.
        scheme: name of a registered scheme; if not given, the usual one of fixed or adaptive steps.
        output_every: number of steps from one output to the next.
        output_step: time (s) from one output to the next, wherever steps end; None where steps are counted.
    """

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Number]

    end: Positive = pydantic.Field(description="a number greater than 0 (s)")
    step: Positive | None = None
    tolerance: Positive | None = None
    max_step: Positive | None = None
    min_step: Positive | None = None
    scheme: str = "generalised_alpha"
    output_every: Count = 1
    output_step: Positive | None = None

    @classmethod
    def keys(cls) -> list[str]:
        """Return the keys of the table and the parameters of all schemes."""
        return list(dict.fromkeys([*super().keys(), *(key for s in registry.schemes for key in parameters_of(s))]))

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters of the scheme by name, those that are not given with their defaults."""
        return dict(self.__pydantic_extra__)

    @property
    def spectral_radius(self) -> float | None:
        """ρ∞ of generalised-α; None for a scheme without."""
        return self.parameters.get("spectral_radius")

    @property
    def beta(self) -> float | None:
        """Newmark's β; None for a scheme without."""
        return self.parameters.get("beta")

    @property
    def gamma(self) -> float | None:
        """Newmark's γ; None for a scheme without."""
        return self.parameters.get("gamma")

    @model_validator(mode="before")
    @classmethod
    def _fill_scheme(cls, data: Any, info: ValidationInfo) -> Any:
        """Add the parameters of the chosen scheme that are not given; a slip in its name comes before all others.

        Where an accuracy is wanted and no steps are given, they follow from it.
        """
        if not isinstance(data, Mapping):
            return data
        given = {key: value for key, value in data.items() if value is not None}
        wanted = (info.context or {}).get("accuracy")
        if isinstance(wanted, float) and wanted > 0.0 and not {"step", "tolerance"} & given.keys():
            given["tolerance"] = wanted
        name = as_name(given.get("scheme", usual(given)), registry.schemes, "scheme")
        defaults = {}
        for key, field in parameters_of(registry.schemes[name]).items():
            if key in cls.model_fields:
                raise problem("scheme", name, f"cannot have a parameter {key}, which is a key of [time] already")
            if field.default is not MISSING:
                defaults[key] = field.default
            elif key not in given:
                raise problem(key, None, f'required key is missing; scheme = "{name}" needs it')
        return defaults | {"scheme": name} | given

    @model_validator(mode="after")
    def _check_scheme(self) -> Self:
        scheme = registry.schemes[self.scheme]
        own = parameters_of(scheme)
        for key, value in self.parameters.items():
            if key not in own:
                raise problem(key, value, f'has no meaning with scheme = "{self.scheme}"')
        for key, allowed in scheme.check(self.parameters).items():
            raise problem(key, self.parameters[key], allowed)
        if self.tolerance is not None and not estimates_error(scheme):
            able = ", ".join(show(other.name) for other in registry.schemes if estimates_error(other))
            reason = f'scheme = "{self.scheme}" does not estimate its error, so its steps are fixed: give step instead'
            raise problem("tolerance", self.tolerance, f"{reason} (adaptive steps: {able})")
        return self

    @model_validator(mode="after")
    def _check_steps(self) -> Self:
        if (self.step is None) == (self.tolerance is None):
            reason = "give exactly one of step (fixed steps, s) and tolerance (adaptive steps)"
            raise problem("step", self.step, reason)
        if self.step is not None and self.step > self.end:
            raise problem("step", self.step, f"must be at most time.end = {self.end:g}")
        if self.output_step is not None and self.output_every != 1:
            raise problem("output_step", self.output_step, "cannot be combined with output_every, which counts steps")
        for key in ("max_step", "min_step"):
            if self.tolerance is None and getattr(self, key) is not None:
                raise problem(key, getattr(self, key), "has a meaning only with tolerance (adaptive steps)")
        if self.max_step is not None and self.min_step is not None and self.min_step > self.max_step:
            raise problem("min_step", self.min_step, f"must be at most max_step = {self.max_step:g}")
        return self
