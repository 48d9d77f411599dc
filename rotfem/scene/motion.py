"""The [motion] table: how the hub turns and moves."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, ConfigDict, StrictBool

from rotfem.registry import Registry, motion_laws, register
from rotfem.scene.loads import Signal, TimeFunction, function_of
from rotfem.scene.table import SceneModel, one_of, problem, unit
from rotfem.scene.values import (
    Matrix,
    NonNegative,
    Number,
    Positive,
    TimeTable,
    Vector,
    WithParameters,
)


def _any(axis: tuple[float, ...]) -> tuple[float, ...]:
    if not any(axis):
        raise problem("", None, "must be a direction; not all three components can be 0")
    return axis


def _check_pulses(pulses: Matrix) -> Matrix:
    for i, (start, end, _) in enumerate(pulses, start=1):
        if end <= start:
            raise problem("", None, f"pulse {i} must end after it starts; it runs from {start:g} to {end:g} s")
    return pulses


Speed = Annotated[Number, unit("rad/s")]
Pulses = Annotated[tuple[Vector, ...], AfterValidator(_check_pulses), unit("s", "s", "N*m")]


class MotionTable(SceneModel):
    """What all motions share.

    Attributes:
        axis: direction of the angular velocity in the frame, of any length.
        base_acceleration: absolute acceleration of the frame's origin in frame components (m/s²), or None.
    """

    registry: ClassVar[Registry[Any]] = motion_laws
    #: Whether the speed is constant and prescribed, so that there is a steady state.
    is_steady: ClassVar[bool] = False
    #: Whether the hub is free, its angle an unknown.
    is_free: ClassVar[bool] = False

    axis: Annotated[Vector, AfterValidator(_any)] = (0.0, 0.0, 1.0)
    base_acceleration: Signal | None = None


class ConstantMotion(MotionTable):
    """Steady rotation.

    Attributes:
        speed: Ω (rad/s).
    """

    name: ClassVar[str] = "constant"
    is_steady: ClassVar[bool] = True
    type: Literal["constant"]
    speed: Speed


class SpinUpMotion(MotionTable):
    """Smooth spin-up from rest, Ω(t) = speed (t/T − sin(2πt/T)/2π), then constant.

    Attributes:
        speed: final speed (rad/s).
        duration: T (s).
    """

    name: ClassVar[str] = "spin_up"
    type: Literal["spin_up"]
    speed: Speed
    duration: Annotated[Positive, unit("s")]


class TableMotion(MotionTable):
    """Speed interpolated in a table.

    Attributes:
        table: rows (t, Ω) in s and rad/s, constant outside; or the path of a CSV file.
        interpolation: between the rows; "pchip" does not overshoot.
    """

    name: ClassVar[str] = "table"
    type: Literal["table"]
    table: Annotated[TimeTable, unit("rad/s", over=("s",))]
    interpolation: Literal["pchip", "cubic", "linear"] = "pchip"


class TorqueMotion(MotionTable):
    """Free hub under a torque; the hub angle is an unknown.

    Attributes:
        hub_inertia: I_R (kg·m²).
        pulses: rows (start, end, torque) in s, s, N·m; they add up where they overlap. None if not given.
        table: rows (t, torque), instead of pulses, or None.
        function: Python function (t, psi, psi_dot, tip) ↦ torque, instead of them, or None: a controller. The tip is a
            dictionary of its displacements and rotations, as the columns of results name them: u1, u2, …
        coupled: whether the hub feels the structure's elastic motion.
        hub_damping: viscous damping of the hub (N·m·s).
        speed: initial speed of the hub (rad/s).
    """

    name: ClassVar[str] = "torque"
    is_free: ClassVar[bool] = True
    type: Literal["torque"]
    hub_inertia: Annotated[Positive, unit("kg*m**2")]
    pulses: Pulses | None = None
    table: Annotated[TimeTable, unit("N*m", over=("s",))] | None = None
    function: Annotated[Callable[..., float], function_of("(t, psi, psi_dot, tip)", 4)] | None = None
    coupled: StrictBool = True
    hub_damping: Annotated[NonNegative, unit("N*m*s")] = 0.0
    speed: Speed = 0.0

    def _check(self) -> None:
        given = [name for name in ("pulses", "table", "function") if getattr(self, name) is not None]
        if len(given) > 1:
            raise problem(given[1], None, "give one of pulses, table and function")


class CallableMotion(MotionTable):
    """Speed given by a Python function; not available in a file.

    Attributes:
        speed: t (s) ↦ Ω (rad/s).
        rate: t (s) ↦ dΩ/dt (rad/s²), or None.
        angle: t (s) ↦ ψ (rad), or None.
    """

    name: ClassVar[str] = "callable"
    type: Literal["callable"]
    speed: TimeFunction
    rate: TimeFunction | None = None
    angle: TimeFunction | None = None


class LawMotion(WithParameters, MotionTable):
    """Rotation by a registered `MotionLaw`, whose parameters are keys of the table.

    Attributes:
        type: name of the law.
    """

    model_config = ConfigDict(extra="allow")  # pydantic takes that of the last base

    CHOICE, ENTRIES = "type", motion_laws

    type: str

    @property
    def law(self) -> Any:
        """The law with its parameters."""
        return motion_laws[self.type](**self.parameters)


_TABLES = (ConstantMotion, SpinUpMotion, TableMotion, TorqueMotion, CallableMotion)
for _table in _TABLES:
    register(_table)

if TYPE_CHECKING:
    AnyMotion = ConstantMotion | SpinUpMotion | TableMotion | TorqueMotion | CallableMotion | LawMotion
else:
    AnyMotion = Annotated[Any, one_of({table.name: table for table in _TABLES}, LawMotion)]
