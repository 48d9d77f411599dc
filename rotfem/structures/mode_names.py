"""Complex mode shapes: turned to their largest real part, their nodes and nodal lines counted, their precession.

A mode e^{iωt} of a rotor is a sum of two circular waves, a e^{i(mθ + ωt)} with the spin and b e^{i(mθ − ωt)} against
it, θ the angle about the axis, counted in the sense of the spin; of a shaft z = u_2 + i u_3 = a e^{iωt} + b e^{−iωt},
m = 1 (Genta, Dynamics of Rotating Systems, 2005, section 2.4). From the fixed frame they have ω + mΩ and ω − mΩ.

A mode is named by these rules, one after the other:

1. The family that has most of its kinetic energy, and one more than the nodes of its shape there; of a plate its nodal
   lines (`Structure.mode_name`).
2. Of less than 0.8 of the energy, the next family too (`ModeName.mixed_with`).
3. Overdamped, it is slow or fast, and its number its place in the family (`with_overdamped`).
4. Of a rotor that precesses, forward or backward whirl by its place, or a disk's wave (`with_whirl`).
5. Those that are called the same have letters (`distinct`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from string import ascii_lowercase
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

#: Family of a beam's bending ↦ its word for a blade, and for others that turn about direction 3, or 2.
WORDS = {"flap": ("flapwise", "out-of-plane", "in-plane"), "lag": ("edgewise", "in-plane", "out-of-plane")}


class ModeName(NamedTuple):
    """The name of a mode: "1st flapwise", "2nd edgewise–flapwise", "4th edgewise, slow", "1st forward whirl".

    Attributes:
        kind: "flapwise", "in-plane", "axial", "torsion", "bending", …, two of them where the mode is mixed.
        number: from 1 on; 0 of rigid bodies, which have none.
        nodal: nodal lines in the place of kind and number: "2 nodal diameters, 1 circle".
        rest: "slow", "fast", "forward", "backward", or nothing.
        letter: of one of several that are called the same.
    """

    kind: str
    number: int
    nodal: str = ""
    rest: str = ""
    letter: str = ""

    def __str__(self) -> str:
        own = self.nodal or (f"{self.number}{ordinal_ending(self.number)} " if self.number else "") + self.kind
        return ", ".join(part for part in (own, self.letter, self.rest) if part)

    def mixed_with(self, word: str) -> ModeName:
        """Return the name of a mode that belongs to another family too, by the word of that."""
        return self._replace(kind=f"{self.kind}–{word}", nodal=self.nodal and f"{self.nodal}–{word}")


#: The name of a motion that nothing holds.
RIGID_BODY = ModeName("rigid body", 0)


def nodal_lines(diameters: int, circles: int) -> str:
    """Return the nodal lines of a disk in words: "1 nodal diameter", "0 nodal diameters, 1 circle"."""
    circle = f", {circles} circle{'s' * (circles != 1)}" if circles else ""
    return f"{diameters} nodal diameter{'s' * (diameters != 1)}{circle}"


def ordinal_ending(number: int) -> str:
    """Return "st", "nd", "rd" or "th", as follows a number in English."""
    return "th" if number % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")


@dataclass(frozen=True)
class Wave:
    """How a mode of a rotor precesses, seen from the rotor or the fixed frame.

    Attributes:
        number: m, nodal diameters of a disk, 1 of a shaft that bends, 0 of torsion and stretch.
        share: (|a|² − |b|²)/(|a|² + |b|²): 1 for a wave that runs with the spin, −1 against it, 0 for a standing one.
        shaft: whether it is that of a shaft, which whirls, or of a disk.
        fixed: whether frequency and shape are those in the fixed frame.
    """

    number: int
    share: float
    shaft: bool
    fixed: bool = False

    @property
    def at_rest(self) -> int:
        """Per-rev order, in the frame of the mode, at which a wave against the spin is critical."""
        return 1 if self.fixed else 2 if self.shaft else self.number

    def seen_fixed(self, omega: float, speed: float) -> float:
        """Return the frequency ω in the fixed frame, rad/s: positive with the spin, negative against it."""
        return (omega if self.share > 0.0 else -omega) + (0.0 if self.fixed else self.number * speed)

    def direction(self, omega: float, speed: float) -> str:
        """Return "forward", "backward", or "" of a standing wave.

        A shaft's whirl has the direction that the fixed frame sees: forward whirl above its critical speed runs against
        the spin in the rotor. A disk's wave has that in the disk.
        """
        # A standing mode has orbits that are ellipses of an axial ratio below 1 %. An overdamped one does not whirl.
        if abs(self.share) < 0.02 or self.number == 0 or speed == 0.0 or (self.fixed and omega == 0.0):
            return ""
        return "forward" if (self.seen_fixed(omega, speed) if self.shaft else self.share) > 0.0 else "backward"


def shaft_waves(moves: npt.NDArray[Any], turns: npt.NDArray[Any], axis: npt.NDArray[np.float64]) -> list[Wave]:
    """Return the whirl of modes of a shaft, their motions (modes, n, 3); that of torsion and stretch stands."""
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    y, z = moves @ first, moves @ np.cross(axis, first)
    a, b = (np.sum(np.abs(y + sign * 1j * z) ** 2, axis=1) for sign in (1.0, -1.0))
    bends = a + b > 2.0 * np.sum(np.abs(moves @ axis) ** 2 + np.abs(turns @ axis) ** 2, axis=1)
    shares = np.where(bends, (a - b) / np.maximum(a + b, 1e-300), 0.0)
    return [Wave(int(n), share, True) for n, share in zip(bends, shares.tolist(), strict=True)]


def in_phase(y: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """Return the real part of y, turned by the phase of its largest entry."""
    return np.asarray(np.real(y * np.exp(-1j * np.angle(y.flat[np.argmax(np.abs(y))]))))


def sign_changes(y: npt.NDArray[np.float64], noise: float = 1e-3) -> int:
    """Return how often the values (n,) along a line change sign; those below noise times the largest do not."""
    y = y[np.abs(y) > noise * np.max(np.abs(y))]
    return int(np.count_nonzero(np.diff(np.sign(y))))


#: Stations along a plate at which its cross lines are sampled, and highest polynomial across.
STATIONS, ACROSS = 24, 4


def plate_mode_name(
    family: str,
    coordinates: dict[str, npt.NDArray[Any]],
    y: npt.NDArray[Any],
    disk: Disk | None = None,
    cantilever: bool = True,
) -> ModeName:
    """Return the name of a plate mode.

    A plate clamped along an edge has "nth bending" (n − 1 nodal lines across it, none along), "nth torsion" (one line
    along), "chordwise (m,n)" (m ≥ 2 lines along) and "nth in-plane"; a disk "m nodal diameters, s circles", beside its
    clamp; one that is held otherwise "bending (m,n)", n − 1 lines along x and m − 1 across.
    """
    real = in_phase(y)
    if disk is not None:
        lines = nodal_lines(*disk.lines(real))
        return ModeName(family, 1, lines if family == "bending" else f"in-plane, {lines}")
    along, across = _lines(coordinates["x"], coordinates["y"], real)
    if family != "bending":
        return ModeName(family, across + 1)
    if not cantilever:
        return ModeName(family, across + 1, f"bending ({across + 1},{along + 1})")
    if along > 1:
        return ModeName("chordwise", across + 1, f"chordwise ({along},{across + 1})")
    return ModeName(("bending", "torsion")[along], across + 1)


#: Differences of the radius of an outline, in parts of the largest one, up to which it is round (a polygon of ten
#: sides), and up to which it nearly is (one of five).
ROUND, NEARLY = 0.05, 0.2


@dataclass(frozen=True)
class Disk:
    """The nodes of a round plate.

    Attributes:
        r: distance from its centre, (n,), m.
        angle: about it, (n,), rad.
        area: that a node stands for, (n,), m².
        off: largest difference of the radius of an outline around the centre, in parts of the largest radius.
    """

    r: npt.NDArray[np.float64]
    angle: npt.NDArray[np.float64]
    area: npt.NDArray[np.float64]
    off: float

    @classmethod
    def of(cls, x: npt.NDArray[Any], y: npt.NDArray[Any], triangles: npt.NDArray[np.int64]) -> Disk:
        """Return the nodes about the centre of the area; outlines around it are the rim and a hole there."""
        from scipy.sparse import csr_array  # slow to load, and most commands name no mode of a plate
        from scipy.sparse.csgraph import connected_components

        z = x + 1j * y
        corners = z[triangles]
        areas = np.abs(np.imag((corners[:, 1] - corners[:, 0]).conj() * (corners[:, 2] - corners[:, 0]))) / 2
        z = z - areas @ corners.mean(axis=1) / areas.sum()
        edges, uses = np.unique(
            np.sort(np.concatenate([triangles[:, i] for i in ([0, 1], [1, 2], [2, 0])])), axis=0, return_counts=True
        )
        ends, n = edges[uses == 1].T, len(z)
        loop, off = connected_components(csr_array((np.ones(len(ends[0])), ends), (n, n)), directed=False)[1], 0.0
        for line in (z[ends[0][loop[ends[0]] == i]] for i in np.unique(loop[ends[0]])):
            angles = np.sort(np.angle(line))
            if np.max(np.diff(angles, append=angles[0] + 2 * np.pi)) < np.pi:  # else it is a hole elsewhere
                off = max(off, float(np.ptp(np.abs(line)) / np.max(np.abs(z))))
        area = np.asarray(np.bincount(triangles.ravel(), np.repeat(areas / 3, 3), n), dtype=np.float64)
        return cls(np.abs(z), np.angle(z), area, off)

    def parts(self, w: npt.NDArray[Any]) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        """Return (parts, (rings, m); their squares' sum over the rings, (m,)) of a shape in e^{−imθ}, m ≥ 0."""
        edges = np.linspace(self.r.min(), self.r.max(), STATIONS // 2 + 1)
        ring = np.clip(np.digitize(self.r, edges) - 1, 0, STATIONS // 2 - 1)
        orders = np.arange(16)
        parts = np.zeros((STATIONS // 2, len(orders)), dtype=complex)
        for i in np.unique(ring):
            here = ring == i
            wave = np.exp(1j * np.outer(orders, self.angle[here]))
            parts[i] = wave @ (self.area[here] * w[here]) / np.sum(self.area[here])
        return parts, np.sum(np.abs(parts) ** 2, axis=0)

    def lines(self, w: npt.NDArray[Any]) -> tuple[int, int]:
        """Return (nodal diameters, nodal circles) of a shape."""
        parts, squares = self.parts(w)
        best = int(np.argmax(squares * np.where(np.arange(len(squares)) == 0, 1, 2)))
        return best, sign_changes(in_phase(parts[:, best]), 0.05)

    def wave(self, w: npt.NDArray[Any], axis: float) -> Wave:
        """Return how a mode w e^{iωt} travels."""
        with_it, against = (self.parts(wave)[1] for wave in (w, w.conj()))
        m = int(np.argmax(with_it + against))
        total, sense = with_it[m] + against[m], -1.0 if axis < 0.0 else 1.0
        return Wave(m, float(sense * (with_it[m] - against[m]) / total) if m > 0 and total > 0.0 else 0.0, False)


@lru_cache(maxsize=4)
def _fits(x: bytes, y: bytes) -> list[tuple[int, npt.NDArray[Any], npt.NDArray[Any]]]:
    """Return of each station along nodes its number, its nodes, and what fits Legendre functions to values there."""
    along, across = np.frombuffer(x), np.frombuffer(y)
    edges, out = np.linspace(along.min(), along.max(), STATIONS + 1), []
    station = np.clip(np.digitize(along, edges) - 1, 0, STATIONS - 1)
    for i in range(STATIONS):
        here = np.flatnonzero(station == i)
        half = np.ptp(across[here]) / 2 if len(here) else 0.0
        if half > 0.0:
            s = (across[here] - across[here].min()) / half - 1
            degree = min(ACROSS, len(np.unique(np.round(s, 6))) - 1)
            out.append((i, here, np.linalg.pinv(np.polynomial.legendre.legvander(s, degree))))
    return out


def _lines(x: npt.NDArray[Any], y: npt.NDArray[Any], w: npt.NDArray[Any]) -> tuple[int, int]:
    """Return (nodal lines along the plate, nodal lines across it): the largest Legendre part across, and its zeros."""
    parts = np.zeros((STATIONS, ACROSS + 1))
    for i, here, fit in _fits(x.tobytes(), y.tobytes()):
        parts[i, : len(fit)] = fit @ w[here]
    weight = np.sum(parts**2, axis=0) / (2 * np.arange(ACROSS + 1) + 1)
    along = int(np.argmax(weight))
    return along, sign_changes(parts[:, along], 0.02)


# --- names of several modes ---------------------------------------------------------------------------------------


def with_overdamped(
    names: list[ModeName], values: npt.NDArray[Any], energies: tuple[npt.NDArray[Any], ...], sure: npt.NDArray[Any]
) -> list[ModeName]:
    """Return the names of modes, those of overdamped ones as "4th edgewise, slow" and "4th edgewise, fast".

    The number of an overdamped mode is not that of its nodes, which damping can move, but its place in its family: each
    undamped mode becomes one that vibrates, or a slow and a fast one.
    """
    mass, stiffness = (np.real(e) for e in energies)
    over = (values.imag == 0.0) & (mass > 0.0) & (~sure | ((values.real < 0.0) & (stiffness > 0.0)))
    counted, out = Counter[tuple[str, str]](), list(names)
    for j, name in enumerate(names):
        slow = abs(values[j]) ** 2 * mass[j] < abs(stiffness[j])
        rest = ("slow" if slow else "fast") if over[j] else ""
        counted[name.kind, rest] += 1
        if over[j]:
            number = counted[name.kind, ""] + counted[name.kind, rest]
            out[j] = ModeName(name.kind, number, rest=rest)
    return out


def distinct(names: list[ModeName]) -> list[str]:
    """Return the names in words; those that occur more than once with a letter each."""
    letters = [ascii_lowercase[names[:i].count(n) % 26] for i, n in enumerate(names)]
    several = (n if names.count(n) == 1 else n._replace(letter=a) for n, a in zip(names, letters, strict=True))
    return [str(n) for n in several]


def with_whirl(names: list[ModeName], waves: Sequence[Wave], omega: npt.NDArray[Any], speed: float) -> list[ModeName]:
    """Return the names of a rotor's modes with the direction they run in, and those of whirl by their place.

    The number of a whirling mode is not that of its nodes, which a disk on the shaft can move. It is its place among
    those of its direction, by the frequency in the fixed frame: "2nd backward whirl". Those of shafts that do not
    whirl are of "bending".
    """
    ways = [wave.direction(w, speed) for wave, w in zip(waves, omega, strict=True)]
    out = [name._replace(rest=way or name.rest) for name, way in zip(names, ways, strict=True)]
    for j, wave in enumerate(waves):
        if wave.shaft:
            words = ("bending" if word in sum(WORDS.values(), ()) else word for word in out[j].kind.split("–"))
            out[j] = out[j]._replace(kind="–".join(dict.fromkeys(words)))
    for way in ("forward", "backward"):
        same = [j for j, wave in enumerate(waves) if wave.shaft and ways[j] == way]
        same.sort(key=lambda j: abs(waves[j].seen_fixed(float(omega[j]), speed)))
        for place, j in enumerate(same, start=1):
            out[j] = ModeName(f"{way} whirl", place)
    return out
