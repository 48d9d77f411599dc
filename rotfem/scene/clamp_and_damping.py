"""What the structures of a scene share: damping and the position of the clamp."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import PlainValidator

from rotfem.scene.values import NonNegative, SceneModel, as_vector, problem


def _as_rayleigh(value: Any) -> tuple[float, float]:
    a0, a1 = as_vector(value, (2,))
    if a0 < 0.0 or a1 < 0.0:
        raise problem("", value, "must be [a0, a1], both at least 0")
    return a0, a1


class Damping(SceneModel):
    """The [structure.damping] table.

    Attributes:
        kelvin_voigt: η (s) in stress = C (ε + η ε̇).
        rayleigh: (a0, a1): mass-proportional (1/s) and stiffness-proportional (s) coefficient.
    """

    kelvin_voigt: NonNegative = 0.0
    rayleigh: Annotated[tuple[float, float], PlainValidator(_as_rayleigh)] = (0.0, 0.0)

    @property
    def is_zero(self) -> bool:
        """Whether there is no damping at all."""
        return self.kelvin_voigt == 0.0 and self.rayleigh == (0.0, 0.0)


def check_one_hub(hub_radius: float, hub_offset: tuple[float, float, float] | None) -> None:
    """Refuse a clamp whose position is given twice."""
    if hub_offset is not None and hub_radius != 0.0:
        raise problem("hub_offset", hub_offset, "give either hub_radius or hub_offset")
