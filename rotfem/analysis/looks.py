"""Jumps and blows of functions of time whose knots nobody has named: looked for before a march.

A function is looked at a number of times in every step. Where it jumps, halving finds the instant, and it is a knot;
where it is far off a straight line within a step the looks themselves are marks, between which it is nearly straight.
What is narrower than the distance of two looks is not seen: there `breakpoints` say where it is.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rotfem.errors import InputError
from rotfem.mechanics.courses import Course

Array = npt.NDArray[np.float64]

#: Looks at a function in all, and fewest and most in a step.
LOOKS, FEWEST, MOST = 200_000, 4, 64

#: Part of the largest value by which a function changes between two looks where it may jump, jumps that are looked for,
#: halvings that find one, and part of the change that is left then if it is one.
STEEP, JUMPS, HALVINGS, LEFT = 1e-3, 1000, 60, 0.5

#: Changes of the slope that are followed, parts that an interval is divided into, and how often, to find a kink.
BENDS, PARTS, REFINEMENTS = 20, 8, 6

#: Part of the first change of a slope that is left at a kink, refinements at least, and round-off of a value.
BENT, SURE, ROUND_OFF = 0.4, 3, 4e-16

#: Part of the largest value by which a function is off a straight line in a step that has to be gone in parts.
CURVED = 5e-2


def look_at(course: Course, times: Array) -> None:
    """Find the knots and marks of a course that are not known, between the ends of steps (s).

    Raises:
        InputError: it, or its rate, jumps and must not (see `Course.continuous`).
    """
    if course.known:
        return
    course.known = True
    if course.continuous > 1:
        check_bends(course, times)
        return
    number = int(np.clip(LOOKS // (len(times) - 1), FEWEST, MOST))
    shares = np.arange(number) / number
    t = np.append((times[:-1, None] + np.diff(times)[:, None] * shares).ravel(), times[-1])
    f = course.values(t)
    size = float(np.abs(f).max())
    if not size > 0.0:
        return
    knots = _jumps(course, t, f, size)
    if len(knots) and course.continuous:
        raise InputError(
            course.name,
            None,
            f"jumps at t = {knots[0]:.9g} s; a speed that changes at once takes a force without bound: give a ramp",
        )
    course.knots = np.union1d(course.knots, knots)
    course.marks = np.union1d(course.marks, _fast(t, f, number, size))


def check_bends(course: Course, times: Array) -> None:
    """Refuse a course with a kink or a jump, looked for between the ends of steps (s).

    Where the slope changes much between two looks, it is followed to ever shorter intervals: that of a smooth course
    changes by a part of it there, at a kink by all of it, at a jump by more.

    Raises:
        InputError: there is one; says when.
    """
    number = int(np.clip(LOOKS // (len(times) - 1), FEWEST, MOST))
    t = np.linspace(times[0], times[-1], number * (len(times) - 1) + 1)
    values = course.values(t)[:, 0]
    slopes, noise = np.diff(values) / np.diff(t), ROUND_OFF * float(np.abs(values).max())
    changes, size = np.abs(np.diff(slopes)), float(np.abs(slopes).max())
    steep = np.flatnonzero(changes > STEEP * size)
    for i in steep[np.argsort(-changes[steep])][:BENDS]:
        where, depth = _followed(course, (float(t[i]), float(t[i + 2])), float(changes[i]), noise)
        if depth >= SURE:
            raise InputError(
                course.name,
                None,
                f"its rate jumps at t = {where:.9g} s, which takes a moment without bound: round it off",
            )


def _followed(course: Course, interval: tuple[float, float], change: float, noise: float) -> tuple[float, int]:
    """Return where a change of slope in an interval (s) is, and how often that can be refined; 0 where it is none."""
    first, last = interval
    for depth in range(REFINEMENTS):
        inner = np.asarray(np.linspace(first, last, PARTS + 1))
        if noise > 0.1 * change * (inner[1] - inner[0]):
            return 0.5 * (first + last), depth
        bends = np.abs(np.diff(np.diff(course.values(inner)[:, 0]) / np.diff(inner)))
        k = int(np.argmax(bends))
        if bends[k] < BENT * change:
            return 0.5 * (first + last), 0
        first, last = float(inner[k]), float(inner[k + 2])
    return 0.5 * (first + last), REFINEMENTS


def _jumps(course: Course, t: Array, f: Array, size: float) -> Array:
    """Return the instants at which a course jumps, of the looks at t (n,) that gave f (n, components)."""
    change = np.linalg.norm(np.diff(f, axis=0), axis=1)
    steep = np.flatnonzero(change > STEEP * size)
    found = []
    for i in steep[np.argsort(-change[steep])][:JUMPS]:
        a, b = float(t[i]), float(t[i + 1])
        f_a, f_b = f[i], f[i + 1]
        for _ in range(HALVINGS):
            middle = 0.5 * (a + b)
            if not a < middle < b:
                break
            f_m = course.values(np.array([middle]))[0]
            if np.linalg.norm(f_m - f_a) >= np.linalg.norm(f_b - f_m):
                b, f_b = middle, f_m
            else:
                a, f_a = middle, f_m
            if np.linalg.norm(f_b - f_a) < LEFT * change[i]:
                break
        if np.linalg.norm(f_b - f_a) >= LEFT * change[i]:
            found.append(b)
    instants: Array = np.unique(np.array(found, dtype=float))
    return instants


def _fast(t: Array, f: Array, number: int, size: float) -> Array:
    """Return the looks within the steps in which f is far off a straight line."""
    inside = f[:-1].reshape(-1, number, f.shape[1])
    first, last = inside[:, 0], f[number::number]
    chord = first[:, None, :] + (np.arange(number) / number)[None, :, None] * (last - first)[:, None, :]
    off = np.linalg.norm(inside - chord, axis=2).max(axis=1) > CURVED * size
    looks: Array = t[:-1].reshape(-1, number)[off].ravel()
    return looks
