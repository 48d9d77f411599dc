"""An inextensible, unshearable cantilever as a chain of rigid links: a model that shares nothing with the program.

Link i of length l = L/N and mass m = ρA l has the absolute angle φ_i; springs EI/l join the links, 2 EI/l the first to
the hub. With c_ij = N − max(i, j) − ½, and N − i − 2/3 on the diagonal, the kinetic energy of a chain at rest at its
root is

    T = ½ m l² Σ_ij c_ij φ'_i φ'_j cos(φ_i − φ_j),

and a root on a hub of radius R at the angle ψ(t) adds its acceleration, R(−ψ'² , ψ'') along and across the hub. The
error is of second order in l: `extrapolated` removes it. `python link_chain.py` prints the numbers that the hard cases
hold.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Chain:
    """A chain of links.

    Attributes:
        links: N.
        length, EI, mass_per_length: of the beam, m, N·m², kg/m.
        hub_radius: R, m.
        angle, speed, rate: ψ, ψ', ψ'' of the hub over t.
    """

    links: int
    length: float = 10.0
    EI: float = 1.4e4
    mass_per_length: float = 1.2
    hub_radius: float = 0.0
    angle: Callable[[float], float] = lambda t: 0.0
    speed: Callable[[float], float] = lambda t: 0.0
    rate: Callable[[float], float] = lambda t: 0.0

    def moments(self, phi: Array, psi: float) -> Array:
        """Return the moments of the springs on the links, N·m."""
        k = self.EI * self.links / self.length
        bend = np.diff(phi, prepend=psi) * np.where(np.arange(self.links) == 0, 2.0, 1.0) * k
        return np.append(bend[1:], 0.0) - bend

    def acceleration(self, t: float, phi: Array, omega: Array, force: float = 0.0) -> Array:
        """Return φ''; force is one at the tip across the undeformed beam that rests (N)."""
        N, link = self.links, self.length / self.links
        i = np.arange(N)
        c = N - np.maximum(i[:, None], i[None, :]) - 0.5
        c[i, i] = N - i - 2.0 / 3.0
        m = self.mass_per_length * link
        difference = phi[:, None] - phi[None, :]
        M = m * link * link * c * np.cos(difference)
        b = self.moments(phi, self.angle(t)) - m * link * link * (c * np.sin(difference)) @ omega**2
        outward, across = -self.hub_radius * self.speed(t) ** 2, self.hub_radius * self.rate(t)
        theta = phi - self.angle(t)
        b += m * link * (N - i - 0.5) * (outward * np.sin(theta) - across * np.cos(theta))
        return np.asarray(np.linalg.solve(M, b))

    def static(self, u2: float) -> Array:
        """Return φ at rest under the transverse tip force that displaces the tip by u2 (m)."""
        from scipy.optimize import fsolve

        link = self.length / self.links

        def residual(x: Array, target: float) -> Array:
            phi = x[:-1]
            return np.append(
                self.moments(phi, 0.0) + 1e4 * x[-1] * link * np.cos(phi), np.sum(link * np.sin(phi)) - target
            )

        x = np.zeros(self.links + 1)
        for share in np.linspace(0.0, 1.0, 9)[1:]:
            x = np.asarray(fsolve(residual, x, args=(share * u2,), xtol=1e-13))
        return x[:-1]

    def history(self, times: Array, phi: Array) -> Array:
        """Return u2 of the tip (m), in the axes of the hub, at the times, from rest in the hub's frame."""
        N = self.links

        def f(t: float, y: Array) -> Array:
            return np.concatenate([y[N:], self.acceleration(t, y[:N], y[N:])])

        start = np.concatenate([phi + self.angle(0.0), np.full(N, self.speed(0.0))])
        done: Any = solve_ivp(f, (0.0, times[-1]), start, "DOP853", times, rtol=1e-8, atol=1e-10)
        psi = np.array([self.angle(t) for t in times])
        return np.asarray(np.sum(np.sin(done.y[:N] - psi), axis=0) * self.length / N)


def extrapolated(value: Callable[[int], Array], links: tuple[int, int] = (16, 32)) -> tuple[Array, float]:
    """Return a value without its error of second order, and the largest change that the extrapolation made."""
    coarse, fine = (value(n) for n in links)
    r = (links[1] / links[0]) ** 2
    out = (r * fine - coarse) / (r - 1)
    return np.asarray(out), float(np.max(np.abs(out - fine)))


def release(u2: float, times: Array, links: int) -> Array:
    """Return u2 of the tip of a beam that is let go from a tip displacement."""
    chain = Chain(links)
    return chain.history(times, chain.static(u2))


def spin_up(EI: float, speed: float, duration: float, times: Array, links: int) -> Array:
    """Return u2 of the tip of a beam spun up smoothly (Kane, Ryan & Banerjee 1987)."""
    T, k = duration, 2 * np.pi / duration

    def omega(t: float) -> float:
        return float(speed * (t / T - np.sin(k * t) / (2 * np.pi))) if t < T else speed

    def rate(t: float) -> float:
        return float(speed / T * (1 - np.cos(k * t))) if t < T else 0.0

    def angle(t: float) -> float:
        s = min(t, T)
        return float(speed * (s * s / (2 * T) + (np.cos(k * s) - 1) / (2 * np.pi * k)) + speed * max(t - T, 0.0))

    return Chain(links, EI=EI, angle=angle, speed=omega, rate=rate).history(times, np.zeros(links))


if __name__ == "__main__":
    at = np.array([0.5, 1.0, 1.5, 2.0])
    for u2 in (0.1, 1.0, 3.0, 5.0, 8.0):
        print("release", u2, *extrapolated(lambda n, u2=u2: release(u2, at, n)))
    at = np.array([5.0, 7.5, 10.0, 15.0, 18.0])
    for EI, speed in ((1.4e4, 6.0), (1.4e3, 6.0), (1.4e2, 6.0)):
        print("spin-up", EI, speed, *extrapolated(lambda n, EI=EI, s=speed: spin_up(EI, s, 15.0, at, n)))
