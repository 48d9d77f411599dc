"""Supports of a beam: bearings, seals and struts, with coefficients that may depend on speed and whirl frequency."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeAlias

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Discriminator, Tag

from rotfem.scene.files import FROM_FILE
from rotfem.scene.table import SceneModel, in_units, problem, unit
from rotfem.scene.values import ROUND_OFF, Array, NonNegative, Number, Positive, check_increasing

#: A matrix of two rows of two: yy, yz, zy, zz.
ZERO = ((0.0, 0.0), (0.0, 0.0))


def _checked(matrix: Any) -> Any:
    """Return a matrix; refuse one that reads as two rows over the speed: rising, and no spring that gives no energy."""
    (yy, yz), (zy, zz) = matrix
    if 0.0 <= yy < zy and yz > 0.0 and zz > 0.0 and (yz + zy) ** 2 > 4.0 * yy * zz:
        why = "must be a number or [[yy, yz], [zy, zz]]; rows over the speed are { over_speed = [[speed, value], …] }"
        raise problem("", None, f"{why}, also where this is a matrix")
    return matrix


def _rows(rows: Any, keys: int) -> Any:
    """Return rows of so many places and 1, 2 or 4 entries with four of them: of all, of yy and zz, or of the matrix."""
    out = []
    for row in rows:
        entries = row[keys:]
        if len(entries) not in (1, 2, 4):
            allowed = "the value, the two yy, zz, or the four yy, yz, zy, zz"
            raise problem("", list(row), f"must be rows of {'one place' if keys == 1 else 'two places'} and {allowed}")
        yy, yz, zy, zz = entries if len(entries) == 4 else (entries[0], 0.0, 0.0, entries[-1])
        out.append((*row[:keys], yy, yz, zy, zz))
    return tuple(out)


Rows = tuple[tuple[Number, ...], ...]
Over = Annotated[Rows, FROM_FILE, AfterValidator(lambda rows: check_increasing(_rows(rows, 1)))]


class CoefficientTable(SceneModel):
    """A coefficient of a support over the speed of rotation and the frequency of whirl, by PCHIP; constant outside.

    Rows have the value of an isotropic support, or yy, zz, or yy, yz, zy, zz in their last columns.

    Attributes:
        over_speed: rows (speed, …), rad/s, or None.
        over_frequency: rows (frequency of whirl, …), rad/s, or None.
        over_both: rows (speed, frequency, …), every speed with every frequency, or None.
    """

    over_speed: Over | None = None
    over_frequency: Over | None = None
    over_both: Annotated[Rows, FROM_FILE, AfterValidator(lambda rows: _rows(rows, 2))] | None = None

    def _check(self) -> None:
        given = [name for name in type(self).model_fields if getattr(self, name) is not None]
        if len(given) != 1:
            raise problem("", None, "must have exactly one of over_speed, over_frequency and over_both")
        if self.over_both is not None:
            table = np.array(self.over_both)
            speeds, frequencies = np.unique(table[:, 0]), np.unique(table[:, 1])
            places = {row[:2] for row in self.over_both}
            if not len(places) == len(table) == len(speeds) * len(frequencies):
                raise problem("over_both", None, "must have every speed with every frequency, each once")

    @property
    def of_frequency(self) -> bool:
        """Whether it depends on the frequency of whirl."""
        return self.over_speed is None

    @property
    def rows(self) -> Array:
        """All matrices, (rows, 2, 2)."""
        table = self.over_speed or self.over_frequency or self.over_both
        return np.array(table)[:, -4:].reshape(-1, 2, 2)

    @cached_property
    def _splines(self) -> Any:
        from scipy.interpolate import PchipInterpolator, RegularGridInterpolator

        if self.over_both is None:
            table = np.array(self.over_speed or self.over_frequency)
            return PchipInterpolator(table[:, 0], table[:, 1:])
        table = np.array(sorted(self.over_both))
        axes = np.unique(table[:, 0]), np.unique(table[:, 1])
        method = "pchip" if min(map(len, axes)) > 3 else "linear"
        return RegularGridInterpolator(axes, table[:, 2:].reshape(len(axes[0]), len(axes[1]), 4), method=method)

    def at(self, speed: float, frequency: float) -> Array:
        """Return the matrix at a speed and a frequency of whirl (rad/s), shape (2, 2)."""
        place = np.abs([speed, frequency])
        if self.over_both is not None:
            axes = self._splines.grid
            inside = [float(np.clip(x, axis[0], axis[-1])) for x, axis in zip(place, axes, strict=True)]
            return np.asarray(self._splines(inside)).reshape(2, 2)
        x = place[int(self.of_frequency)]
        return np.asarray(self._splines(np.clip(x, self._splines.x[0], self._splines.x[-1]))).reshape(2, 2)

    def beyond(self, speeds: Array, frequencies: Array) -> str:
        """Return which of its range is exceeded by speeds or frequencies of whirl (rad/s); "" if none is."""
        table = np.array(self.over_speed or self.over_frequency or self.over_both)
        axes = [frequencies] if self.over_frequency else [speeds] if self.over_speed else [speeds, frequencies]
        names = ["frequencies of whirl"] if self.over_frequency else ["speeds", "frequencies of whirl"]
        for name, values, column in zip(names, axes, table.T, strict=False):
            first, last, sizes = min(column), max(column), np.abs(values)
            if np.any((sizes < first * (1 - ROUND_OFF)) | (sizes > last * (1 + ROUND_OFF))):
                return f"{name} from {first:g} to {last:g} rad/s"
        return ""


def _coefficient(name: str) -> Any:
    """Return the type of a coefficient with a unit: a number, a matrix, or a table over speed or frequency."""

    def read(value: Any) -> Any:
        if isinstance(value, Mapping):
            over = {"over_speed": ("rad/s",), "over_frequency": ("rad/s",), "over_both": ("rad/s", "rad/s")}
            return {key: in_units(rows, (name,), over.get(key, ())) for key, rows in value.items()}
        value = in_units(value, (name,))
        return value if isinstance(value, list | tuple | SceneModel) else ((value, 0.0), (0.0, value))

    two_by_two = Annotated[tuple[tuple[Number, Number], tuple[Number, Number]], AfterValidator(_checked)]
    ways = Annotated[two_by_two, Tag("<one>")] | Annotated[CoefficientTable, Tag("<table>")]
    kind = Discriminator(lambda value: "<one>" if isinstance(value, list | tuple) else "<table>")
    return Annotated[ways, kind, BeforeValidator(read)]


if TYPE_CHECKING:
    Stiffness: TypeAlias = Any
    Damping: TypeAlias = Any
    Tilting: TypeAlias = Any
    TiltDamping: TypeAlias = Any
else:
    Stiffness, Damping = _coefficient("N/m"), _coefficient("N*s/m")
    Tilting, TiltDamping = _coefficient("N*m"), _coefficient("N*m*s")


class Housing(SceneModel):
    """A mass under a support, on a spring and a damper.

    Attributes:
        mass: of both directions (kg).
        stiffness: to what is under it (N/m): the next housing, or the ground.
        damping: likewise (N·s/m).
    """

    mass: Annotated[NonNegative, unit("kg")] = 0.0
    stiffness: Stiffness = ZERO
    damping: Damping = ZERO


class SupportTable(SceneModel):
    """A bearing, a seal or a strut: springs and dampers between a section of a beam and what holds it.

    Forces along directions 2 and 3 are −stiffness · (y, z) − damping · (ẏ, ż), moments about them those of the turns.
    Coefficients are a number, [[yy, yz], [zy, zz]], or tables over the speed and the frequency of whirl.

    Attributes:
        x: place along the beam (m).
        stiffness: of displacements (N/m).
        damping: of their rates (N·s/m).
        tilt_stiffness: of turns (N·m/rad).
        tilt_damping: of their rates (N·m·s/rad).
        housing: masses under it, one after the other down to the ground.
        frame: what it stands in: the "fixed" frame, that of all bearings of a shaft, or the "rotating" one; by default
            that of the structure.
    """

    x: Annotated[Number, unit("m")]
    stiffness: Stiffness = ZERO
    damping: Damping = ZERO
    tilt_stiffness: Tilting = ZERO
    tilt_damping: TiltDamping = ZERO
    housing: tuple[Housing, ...] = ()
    frame: Literal["fixed", "rotating"] | None = None

    def _check(self) -> None:
        for i, under in enumerate(self.housing):
            if not np.any(matrices(under.stiffness)):
                raise problem(f"housing.{i}.stiffness", None, "must be given: without it nothing holds the housing")

    @property
    def holds(self) -> bool:
        """Whether it has a spring in both directions."""
        return bool(np.all(np.abs(matrices(self.stiffness)[:, (0, 1), (0, 1)]).max(axis=0) > 0.0))

    @property
    def springs(self) -> list[Any]:
        """Stiffnesses, of displacements and turns, and those under its housings."""
        return [self.stiffness, self.tilt_stiffness, *(under.stiffness for under in self.housing)]

    @property
    def dampers(self) -> list[Any]:
        """Dampings likewise."""
        return [self.damping, self.tilt_damping, *(under.damping for under in self.housing)]

    @property
    def of_frequency(self) -> bool:
        """Whether it depends on the frequency of whirl."""
        return any(isinstance(c, CoefficientTable) and c.of_frequency for c in (*self.springs, *self.dampers))

    @property
    def couples(self) -> bool:
        """Whether it couples both directions."""
        return any(bool(np.any(matrices(c)[:, (0, 1), (1, 0)])) for c in (*self.springs, *self.dampers))

    @property
    def feeds(self) -> bool:
        """Whether it dissipates or feeds energy: by dampers, or a stiffness that is not symmetric."""
        unequal = (np.any(A[:, 0, 1] != A[:, 1, 0]) for A in map(matrices, self.springs))
        return any(np.any(matrices(c)) for c in self.dampers) or any(unequal)

    @property
    def isotropic(self) -> bool:
        """Whether every rotating frame sees it alike: all matrices are [[a, b], [−b, a]]."""
        found = map(matrices, (*self.springs, *self.dampers))
        return all(np.all(A[:, 0, 0] == A[:, 1, 1]) and np.all(A[:, 0, 1] == -A[:, 1, 0]) for A in found)


class CouplingTable(SceneModel):
    """A coupling: springs and dampers between the two parts of a beam, which is rigid in all that is not given.

    Attributes:
        x: place along the beam (m), between its ends. What else stands there is on the side of the root.
        stiffness: across the beam (N/m).
        damping: likewise (N·s/m).
        tilt_stiffness: against bending (N·m/rad).
        tilt_damping: likewise (N·m·s/rad).
        torsion_stiffness: against twist (N·m/rad).
        torsion_damping: likewise (N·m·s/rad).
        axial_stiffness: along the beam (N/m).
        axial_damping: likewise (N·s/m).
    """

    x: Annotated[Number, unit("m")]
    stiffness: Annotated[Positive, unit("N/m")] | None = None
    damping: Annotated[NonNegative, unit("N*s/m")] = 0.0
    tilt_stiffness: Annotated[Positive, unit("N*m")] | None = None
    tilt_damping: Annotated[NonNegative, unit("N*m*s")] = 0.0
    torsion_stiffness: Annotated[Positive, unit("N*m")] | None = None
    torsion_damping: Annotated[NonNegative, unit("N*m*s")] = 0.0
    axial_stiffness: Annotated[Positive, unit("N/m")] | None = None
    axial_damping: Annotated[NonNegative, unit("N*s/m")] = 0.0

    #: Component that jumps ↦ first word of the keys of its stiffness and damping.
    _KINDS: ClassVar = {"u1": "axial_", "theta1": "torsion_", **dict.fromkeys(("theta2", "theta3"), "tilt_")}

    def of(self, component: str) -> tuple[float | None, float]:
        """Return stiffness and damping against a jump of a component; None of one that does not jump."""
        kind = self._KINDS.get(component, "")
        return getattr(self, f"{kind}stiffness"), getattr(self, f"{kind}damping")

    @property
    def feeds(self) -> bool:
        """Whether it has dampers."""
        return any((self.damping, self.tilt_damping, self.torsion_damping, self.axial_damping))

    def _check(self) -> None:
        kinds = {kind: self.of(name) for name, kind in {"u2": "", **self._KINDS}.items()}
        if not any(stiffness for stiffness, _ in kinds.values()):
            raise problem("stiffness", None, "give one: " + ", ".join(f"{kind}stiffness" for kind in kinds))
        for kind, (stiffness, damping) in kinds.items():
            if damping and stiffness is None:
                raise problem(f"{kind}damping", damping, f"needs {kind}stiffness, without which the coupling is rigid")


def matrices(coefficient: Any) -> Array:
    """Return all matrices (n, 2, 2) that a coefficient may have."""
    return coefficient.rows if isinstance(coefficient, CoefficientTable) else np.array([coefficient], dtype=float)
