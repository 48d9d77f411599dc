"""What holds a beam: hinges, springs, dampers and pitch angle of its root, and the supports of a shaft."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, NamedTuple, cast

import numpy as np
from pydantic import BeforeValidator, Field, StrictBool

from rotfem.scene.loads import Given, Harmonic, TimeFunction
from rotfem.scene.table import SceneModel, problem, unit
from rotfem.scene.values import Matrix, NonNegative, Number, TimeTable


class HarmonicAngle(Harmonic):
    """A harmonic part of an angle."""

    amplitude: Annotated[Number, unit("rad")]


class PitchAngle(Given):
    """The pitch over time: one of value, table and function, and harmonics in addition or alone.

    In a scene it may be written without its table: a number is a value, [[t, angle], …] or the path of a CSV file a
    table.

    Attributes:
        value: a constant angle (rad), or None.
        table: rows (t, angle) in s and rad, at rest before the first and after the last; or None.
        function: Python function t (s) ↦ angle (rad), or None.
        rate: Python function t (s) ↦ rate of the function's angle (rad/s); by default differences.
        harmonic: added to these.
    """

    WAYS: ClassVar[tuple[str, ...]] = ("value", "table", "function")

    value: Annotated[Number, unit("rad")] | None = None
    table: Annotated[TimeTable, unit("rad", over=("s",))] | None = None
    function: TimeFunction | None = None
    rate: TimeFunction | None = None
    harmonic: tuple[HarmonicAngle, ...] = ()

    @property
    def changes(self) -> bool:
        """Whether it changes with time; a function is taken to."""
        moves = self.table is not None and len({angle for _, angle in self.table}) > 1
        return moves or self.function is not None or any(h.amplitude != 0.0 for h in self.harmonic)

    @property
    def constant(self) -> float:
        """The angle of one that does not change, rad."""
        return (self.value or 0.0) + (self.table[0][1] if self.table is not None else 0.0)

    def _check(self) -> None:
        super()._check()
        if self.rate is not None and self.function is None:
            raise problem("rate", None, "is that of a function; tables and harmonics have their own")


class Hinge(NamedTuple):
    """A turn that the root may make: its name, and stiffness (N·m/rad) and damping (N·m·s/rad) against it."""

    name: str
    stiffness: float
    damping: float


Spring = Annotated[NonNegative, unit("N*m")]
Damper = Annotated[NonNegative, unit("N*m*s")]


class Root(SceneModel):
    """What holds the root of a beam: rigid but about the axes that have a stiffness; 0 is a hinge.

    Attributes:
        lag_stiffness: against turns about direction 3 (N·m/rad), or None: rigid.
        lag_damping: against their rate (N·m·s/rad).
        hinge_offset: from the end of the hub to the root (m), a rigid arm in direction 1.
    """

    #: Name of a turn ↦ the axis that it is about.
    AXES: ClassVar[dict[str, int]] = {"lag": 3}

    lag_stiffness: Spring | None = None
    lag_damping: Damper = 0.0
    hinge_offset: Annotated[NonNegative, unit("m")] = 0.0

    @property
    def hinges(self) -> dict[int, Hinge]:
        """Axis, 1 to 3, ↦ the hinge about it; axes that are rigid are left out."""
        given = ((axis, name, getattr(self, f"{name}_stiffness")) for name, axis in self.AXES.items())
        return {a: Hinge(name, k, getattr(self, f"{name}_damping")) for a, name, k in given if k is not None}

    def _check(self) -> None:
        for name in self.AXES:
            damping = getattr(self, f"{name}_damping")
            if damping > 0.0 and getattr(self, f"{name}_stiffness") is None:
                why = f"needs {name}_stiffness, which may be 0: without it the root is rigid"
                raise problem(f"{name}_damping", damping, why)


class SpatialRoot(Root):
    """What holds the root of a spatial beam.

    Attributes:
        flap_stiffness: against turns about direction 2 (N·m/rad), or None: rigid.
        flap_damping: against their rate (N·m·s/rad).
        pitch_stiffness: against turns about the axis of the blade (N·m/rad), or None: rigid.
        pitch_damping: against their rate (N·m·s/rad).
        pitch: angle that the whole blade is turned by about its axis at the root (rad), a number or over time.
        driven: whether the drive constrains a shaft along and about its axis alone; `supports` carry the rest.
    """

    AXES: ClassVar[dict[str, int]] = {"pitch": 1, "flap": 2, "lag": 3}

    flap_stiffness: Spring | None = None
    flap_damping: Damper = 0.0
    pitch_stiffness: Spring | None = None
    pitch_damping: Damper = 0.0
    pitch: PitchAngle = Field(default_factory=lambda: cast(Any, 0.0), validate_default=True)
    driven: StrictBool = False

    def check(self, precone: float) -> None:
        """Refuse one spring of the two whose axes the precone (rad), or a pitch over time, turns, the other rigid.

        And springs of a root that a drive leaves free.
        """
        if self.driven and (self.hinges or self.pitch.changes):
            why = "leaves the root free to turn, without hinges and a pitch over time; structure.supports hold it"
            raise problem("root.driven", self.driven, why)
        pairs = [(1, 3, "a precone")] if precone != 0.0 else []
        for first, second, what in [*pairs, (2, 3, "a pitch over time")] if self.pitch.changes else pairs:
            if (first in self.hinges) != (second in self.hinges):
                missing = next(name for name, axis in self.AXES.items() if axis in {first, second} - self.hinges.keys())
                why = f"must be given too with {what}, which turns the axes of both; a large number holds it"
                raise problem(f"root.{missing}_stiffness", None, why)


def _isotropic(value: Any) -> Any:
    """Return that times the identity of a number."""
    return value if isinstance(value, list | tuple) else ((value, 0.0), (0.0, value))


#: yy and zz are at least 0; a number stands for that times the identity.
TwoByTwo = Annotated[tuple[tuple[NonNegative, Number], tuple[Number, NonNegative]], BeforeValidator(_isotropic)]


class SupportTable(SceneModel):
    """A bearing of a shaft: a spring and a damper between a section and the fixed frame, across the axis of spin.

    Forces along directions 2 and 3 of the fixed frame are −stiffness · (y, z) − damping · (ẏ, ż).

    Attributes:
        x: place along the beam (m).
        stiffness: of the spring (N/m), a number or [[yy, yz], [zy, zz]].
        damping: of the damper (N·s/m), likewise.
    """

    x: Annotated[Number, unit("m")]
    stiffness: Annotated[TwoByTwo, unit("N/m")] = ((0.0, 0.0), (0.0, 0.0))
    damping: Annotated[TwoByTwo, unit("N*s/m")] = ((0.0, 0.0), (0.0, 0.0))

    def _check(self) -> None:
        if not np.any(self.stiffness) and not np.any(self.damping):
            raise problem("stiffness", None, "give stiffness, damping, or both")

    @property
    def isotropic(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """(a, b) of the part [[a, b], [−b, a]] of stiffness and damping, which every rotating frame sees alike."""
        (k, c), (d, e) = ((A[0][0] + A[1][1], A[0][1] - A[1][0]) for A in (self.stiffness, self.damping))
        return (k / 2, c / 2), (d / 2, e / 2)

    @property
    def anisotropic(self) -> tuple[Matrix, Matrix]:
        """The rest of both, [[a, b], [b, −a]]: how they differ by direction."""
        rest = [((A[0][0] - A[1][1]) / 2, (A[0][1] + A[1][0]) / 2) for A in (self.stiffness, self.damping)]
        stiffness, damping = (((a, b), (b, -a)) for a, b in rest)
        return stiffness, damping
