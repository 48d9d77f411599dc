"""The [structure.root] table of beams: hinges, springs and dampers between hub and blade, and the pitch angle."""

from __future__ import annotations

from typing import ClassVar, NamedTuple, Self

from pydantic import model_validator

from rotfem.scene.pitch import PitchAngle
from rotfem.scene.structure import StructureTable
from rotfem.scene.values import NonNegative, SceneModel, problem


class Hinge(NamedTuple):
    """A turn that the root may make: its name, and stiffness (N·m/rad) and damping (N·m·s/rad) against it."""

    name: str
    stiffness: float
    damping: float


class Root(SceneModel):
    """What holds the root of a beam: rigid but about the axes that have a stiffness; 0 is a hinge.

    Attributes:
        lag_stiffness: against turns about direction 3 (N·m/rad), or None: rigid.
        lag_damping: against their rate (N·m·s/rad).
        hinge_offset: from the end of the hub to the root (m), a rigid arm in direction 1.
    """

    #: Name of a turn ↦ the axis that it is about.
    AXES: ClassVar[dict[str, int]] = {"lag": 3}

    lag_stiffness: NonNegative | None = None
    lag_damping: NonNegative = 0.0
    hinge_offset: NonNegative = 0.0

    @property
    def hinges(self) -> dict[int, Hinge]:
        """Axis, 1 to 3, ↦ the hinge about it; axes that are rigid are left out."""
        given = ((axis, name, getattr(self, f"{name}_stiffness")) for name, axis in self.AXES.items())
        return {a: Hinge(name, k, getattr(self, f"{name}_damping")) for a, name, k in given if k is not None}

    @model_validator(mode="after")
    def _check_dampers(self) -> Self:
        for name in self.AXES:
            damping = getattr(self, f"{name}_damping")
            if damping > 0.0 and getattr(self, f"{name}_stiffness") is None:
                why = f"needs {name}_stiffness, which may be 0: without it the root is rigid"
                raise problem(f"{name}_damping", damping, why)
        return self


class SpatialRoot(Root):
    """What holds the root of a spatial beam.

    Attributes:
        flap_stiffness: against turns about direction 2 (N·m/rad), or None: rigid.
        flap_damping: against their rate (N·m·s/rad).
        pitch_stiffness: against turns about the axis of the blade (N·m/rad), or None: rigid.
        pitch_damping: against their rate (N·m·s/rad).
        pitch: angle that the whole blade is turned by about its axis at the root (rad), a number or over time.
    """

    AXES: ClassVar[dict[str, int]] = {"pitch": 1, "flap": 2, "lag": 3}

    flap_stiffness: NonNegative | None = None
    flap_damping: NonNegative = 0.0
    pitch_stiffness: NonNegative | None = None
    pitch_damping: NonNegative = 0.0
    pitch: PitchAngle = PitchAngle(value=0.0)


class Held(StructureTable):
    """What a beam has of its `root`."""

    @property
    def hinges(self) -> dict[int, Hinge]:
        """Axis ↦ the hinge about it at the root."""
        root: Root = vars(self)["root"]
        return root.hinges

    @property
    def pitches(self) -> bool:
        """Whether its pitch changes with time."""
        root: Root = vars(self)["root"]
        return isinstance(root, SpatialRoot) and root.pitch.changes


def check_pitch(root: SpatialRoot) -> None:
    """Refuse one spring of the two whose axes a pitch over time turns, the other rigid.

    Raises:
        PydanticCustomError: says which is missing.
    """
    if not root.pitch.changes or (2 in root.hinges) == (3 in root.hinges):
        return
    missing = "lag" if 2 in root.hinges else "flap"
    why = "must be given too with a pitch over time, which turns the axes of both; a large number holds it"
    raise problem(f"root.{missing}_stiffness", None, why)


def check_cone(root: SpatialRoot, precone: float) -> None:
    """Refuse one spring of the two whose axes the precone turns, the other rigid.

    Raises:
        PydanticCustomError: says which is missing.
    """
    if precone == 0.0 or (1 in root.hinges) == (3 in root.hinges):
        return
    missing = "lag" if 1 in root.hinges else "pitch"
    why = "must be given too with a precone, which turns the axes of both; a large number holds it"
    raise problem(f"root.{missing}_stiffness", None, why)
