"""The floating frame as the forms see it: constants for its angular velocity, acceleration and gravity."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import default_scalar_type, fem, mesh

from rotfem.mechanics.motion import Motion
from rotfem.numerics import forms

Array = npt.NDArray[np.float64]


class Frame:
    """The constants of the floating frame in the forms: w, dw (its rate), a_o, v_o and gravity, all frame components.

    A constant comes into being when a form first asks for it, so an effect that is off leaves none behind.

    Args:
        domain: the mesh the constants live on.
        planar: motion in the plane (a_1, a_2) only; w then has one unknown component and the cross products of the
            forms lose their zero terms symbolically.
        fixed: the frame translates with the hub but does not rotate (the inertial-frame form).
        gravity: inertial components, m/s^2.
        pitching: the frame pitches over time.

    Attributes:
        constants: name ↦ constant in the forms.
        slices: name ↦ which components of a vector of the frame it has.
    """

    def __init__(
        self,
        domain: mesh.Mesh,
        planar: bool,
        fixed: bool = False,
        gravity: npt.ArrayLike = (0, 0, 0),
        pitching: bool = False,
    ):
        self._domain, self.planar, self.fixed, self.pitching = domain, planar, fixed, pitching
        self._gravity = np.asarray(gravity, dtype=float)
        self.constants: dict[str, fem.Constant] = {}
        self._entries: dict[str, Array] = {}  # of the constants, where they are
        turn, plane = (slice(2, 3), slice(0, 2)) if planar else (slice(0, 3), slice(0, 3))
        self.slices = {"w": turn, "dw": turn, "a_o": plane, "v_o": plane, "gravity": plane}
        self.slices |= dict.fromkeys(("pitch", "pitch_rate"), slice(0, 2)) | {"psi": slice(0, 1)}

    def _constant(self, name: str, size: int) -> fem.Constant:
        if name not in self.constants:
            self.constants[name] = forms.constant(self._domain, np.zeros(size, dtype=default_scalar_type))
            self._entries[name] = self.constants[name].value
        return self.constants[name]

    def _vector(self, name: str) -> Any:
        """Return a vector of the frame; in the plane w and dw have component 3 alone, the others lack it."""
        if not self.planar:
            return self._constant(name, 3)
        if name in ("w", "dw"):
            return ufl.as_vector((0, 0, self._constant(name, 1)[0]))
        c = self._constant(name, 2)
        return ufl.as_vector((c[0], c[1], 0))

    w = property(lambda self: self._vector("w"), doc="Angular velocity, rad/s.")
    dw = property(lambda self: self._vector("dw"), doc="Rate of the angular velocity, rad/s².")
    a_o = property(lambda self: self._vector("a_o"), doc="Absolute acceleration of the origin, m/s².")
    v_o = property(lambda self: self._vector("v_o"), doc="Velocity of the origin, m/s, by a pitch about another axis.")
    gravity = property(lambda self: self._vector("gravity"), doc="Acceleration of gravity, m/s².")

    @property
    def psi(self) -> Any:
        """Angle of the hub about axis 3, rad, which a frame that does not rotate sees."""
        return self._constant("psi", 1)[0]

    @property
    def pitch(self) -> tuple[Any, Any]:
        """(cos φ, sin φ) of the turn φ of a frame that pitches; the constants are zero at φ = 0."""
        c = self._constant("pitch", 2)
        return 1 + c[0], c[1]

    @property
    def pitch_rate(self) -> tuple[Any, Any]:
        """Their rates, 1/s."""
        c = self._constant("pitch_rate", 2)
        return c[0], c[1]

    def values(self, motion: Motion, t: float) -> dict[str, Array]:
        """Return the value of every constant in use at time t (s), as arrays of the constants' sizes."""
        out: dict[str, Array] = {}
        moved = motion.frame(t)
        for name in self.constants:
            if name == "gravity":
                value = self._gravity if self.fixed else motion.rotation(t).T @ self._gravity
            elif name == "psi":
                value = motion.angle(t) * motion.axis[2:]
            else:
                value = motion.rotation(t) @ moved[name] if self.fixed and name == "a_o" else moved[name]
            out[name] = value[self.slices[name]]
        return out

    def set(self, values: dict[str, Array]) -> None:
        """Write values (from `values`) into the constants."""
        for name, value in values.items():
            self._entries[name][:] = value
