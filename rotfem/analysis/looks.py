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

#: Part of the largest value by which a function is off a straight line in a step that has to be gone in parts.
CURVED = 5e-2


def look_at(course: Course, times: Array) -> None:
    """Find the knots and marks of a course that are not known, between the ends of steps (s).

    Raises:
        InputError: the speed of the frame jumps: no force is large enough for that.
    """
    if course.known:
        return
    course.known = True
    number = int(np.clip(LOOKS // (len(times) - 1), FEWEST, MOST))
    shares = np.arange(number) / number
    t = np.append((times[:-1, None] + np.diff(times)[:, None] * shares).ravel(), times[-1])
    f = course.values(t)
    size = float(np.abs(f).max())
    if not size > 0.0:
        return
    knots = _jumps(course, t, f, size)
    if len(knots) and course.name == "motion.speed":
        raise InputError(
            "motion.speed",
            None,
            f"jumps at t = {knots[0]:.9g} s; a speed that changes at once takes a force without bound: give a ramp",
        )
    course.knots = np.union1d(course.knots, knots)
    course.marks = np.union1d(course.marks, _fast(t, f, number, size))


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
