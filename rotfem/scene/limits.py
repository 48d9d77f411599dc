"""The [limits] table: how much a scene may ask for before it is taken for a slip, and how to ask for more."""

from __future__ import annotations

from typing import Annotated

from pydantic import PlainValidator, ValidationError, ValidationInfo
from pydantic_core import PydanticCustomError

from rotfem.scene.values import Bounds, SceneModel, problem

Limit = Annotated[int, PlainValidator(Bounds(ge=1).integer)]


class Limits(SceneModel):
    """The [limits] table. What lies above is refused before it is computed.

    Attributes:
        steps: steps of a time history.
        rows: rows of a table.
        modes: modes at one speed.
        speeds: speeds of a Campbell diagram.
    """

    steps: Limit = 10_000_000
    rows: Limit = 2_000_000
    modes: Limit = 1_000
    speeds: Limit = 100_000

    def refusal(self, name: str, wanted: float) -> str | None:
        """Return why so many are refused, with how to allow them; None where they are not.

        Args:
            name: of the limit.
            wanted: how many there would be.
        """
        most = getattr(self, name)
        if wanted <= most:
            return None
        return f"makes {wanted:.4g} {name}, more than limits.{name} = {most}; a larger one in [limits] allows them"

    def check(self, name: str, wanted: float, key: str = "", value: object = None) -> None:
        """Refuse more than a limit.

        Args:
            name: of the limit.
            wanted: how many there would be.
            key: what asks for them.
            value: what it holds.

        Raises:
            PydanticCustomError: they are more.
        """
        if (why := self.refusal(name, wanted)) is not None:
            raise problem(key, value, why)


def limits_of(tables: object) -> Limits:
    """Return the limits of a scene's tables; where those are wrong, which is reported elsewhere, the usual ones."""
    given = tables.get("limits") if isinstance(tables, dict) else None
    try:
        return Limits.model_validate({} if given is None else given)
    except (ValidationError, PydanticCustomError):
        return Limits()


def limits_in(info: ValidationInfo) -> Limits:
    """Return the limits of the scene being validated; the usual ones outside of a scene."""
    found = (info.context or {}).get("limits")
    return found if isinstance(found, Limits) else Limits()
