"""A motion law of a user's own: a speed that wobbles, Ω(t) = mean + amplitude sin(2πft), f in 1/s."""

from dataclasses import dataclass
from math import cos, pi, sin

from rotfem import MotionLaw, register


@dataclass(frozen=True)
class Wobble(MotionLaw):
    """Ω, its rate and the angle; the fields are keys of [motion]."""

    name = "wobble"
    breakpoints = ()  # smooth everywhere

    mean: float
    amplitude: float = 0.0
    frequency: float = 1.0

    @classmethod
    def check(cls, parameters):
        """Return what is not allowed."""
        return {} if parameters["frequency"] > 0.0 else {"frequency": "must be greater than 0"}

    def speed(self, t):
        """Return Ω, rad/s."""
        return self.mean + self.amplitude * sin(2 * pi * self.frequency * t)

    def rate(self, t):
        """Return dΩ/dt, rad/s²."""
        return 2 * pi * self.frequency * self.amplitude * cos(2 * pi * self.frequency * t)

    def angle(self, t):
        """Return ψ, rad."""
        k = 2 * pi * self.frequency
        return self.mean * t + self.amplitude * (1 - cos(k * t)) / k


register(Wobble)
