"""Motion laws of a user: how the speed depends on time, with parameters that a scene gives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

from rotfem.registry import Registry
from rotfem.registry import motion_laws as registered


class MotionLaw(ABC):
    """A prescribed rotation: `motion.type` of a scene names its class, the fields of a dataclass are keys of [motion].

    Attributes:
        name: what a scene calls it.
        rate: t (s) ↦ dΩ/dt (rad/s²), a method; None: differences of the speed.
        angle: t (s) ↦ ψ (rad), a method; None: a quadrature of the speed.
        breakpoints: times (s) between which the speed is smooth; steps end there. None: they are sought.
    """

    registry: ClassVar[Registry[Any]] = registered
    name: ClassVar[str]
    rate: Any = None
    angle: Any = None
    breakpoints: Any = None

    @abstractmethod
    def speed(self, t: float) -> float:
        """Return Ω (rad/s) at a time (s)."""

    @classmethod
    def check(cls, parameters: dict[str, Any]) -> dict[str, str]:
        """Return what is allowed, by name of the parameters that are not; every number is unless a class says more."""
        return {}
