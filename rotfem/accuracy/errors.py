"""The error of an answer: its distance to one in steps of twice the length on half the cells.

Let e be the error of an answer, q e that of the coarser one, and d their distance. Where errors have one sign

    e = d / (q − 1),    q = rᵖ

with r the ratio of their steps or cells and p the order (Richardson's extrapolation; Hairer, Nørsett & Wanner 1993,
section II.4).

- Of steps p is 2: higher orders are reduced by stiff components (Hairer & Wanner 1996, section IV.15). Vibrations that
  are out of phase in one of the answers have no order. They may be small compared with the motion, but hardly so in its
  acceleration: where d or the same of second differences is above `ASYMPTOTIC`, d is not divided.
- Of elements of degree k of a beam, which end where its sections jump, p is 2k − 2: displacements at nodes and
  eigenvalues have 2k (Strang & Fix 1973, sections 1.6 and 6.3), two less where it is so thin that elements lock
  (Arnold, Numerische Mathematik 37 (1981) 405).
- Of plates p is `CORNER`.
- Above `ASYMPTOTIC`, and of plates, a third answer, coarser in the same ratio, shows whether the order holds. With d'
  its distance to the second one q is d'/d, but at most rᵖ, above `ASYMPTOTIC` that of p = max(2, k), where the corners
  of the clamp are not what counts. Where q is small, e is at most the larger one of both distances. Where d is smaller
  than the highest order of a smooth answer makes it, it is so by chance, and that takes its place.
- Where cells cannot be halved, the other answer has elements of one degree more, on plates and mesh files of one less,
  unless those lock.

The error of a theory is the distance of the coarser answer to that of the richest theory.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from rotfem import registry
from rotfem.accuracy.answer import Answer, Answers, Elements, Setting, distance
from rotfem.analysis.schemes import LONGEST
from rotfem.errors import ComputationError, InputError
from rotfem.results.columns import ShortTable
from rotfem.results.distance import Distance, Spectrum
from rotfem.scene import Scene

#: Relative distance of two answers up to which their order holds without a third one.
ASYMPTOTIC = 0.1

#: Distance to an answer of one degree more as a part of the error, where that is a quarter of it, as on half the cells.
BEYOND = 0.75

#: Ratio of the lengths of cells from which on two meshes are compared: that of three cells to two.
LONGER = 1.5

#: Order of steps that holds for all motions.
CERTAIN = 2

#: Order of elements of plates: 2λ of stresses r^(λ−1) at a right corner of clamp and free edge, λ = 0.76 for ν = 0.3
#: (Williams, Journal of Applied Mechanics 19 (1952) 526).
CORNER = 1.5

#: Loosest tolerance of adaptive steps.
LOOSEST = 0.5

#: Elements of a second answer of a beam below which one is longer than half a wave of some modes: of lower order.
FEW = 3

#: Part of the steps of an answer that a coarser one may take: with more, other things than their error make the steps.
FEWER = 0.75

#: Relative error below which none is known: what Newton's increments leave.
FLOOR = 1e-9

#: Error from which a warning names its cures; error of a theory from which it is warned of.
NOTICED, OUT_OF_RANGE = 0.01, 0.05

#: Characters of a line of the table of settings.
LINE = 120

#: Contributions to an error as they are called in text.
WORDS = {
    "discretisation": "steps and mesh",
    "time": "steps",
    "space": "mesh",
    "model": "theory",
    "effects": "effects left out",
    "round_off": "round-off",
    "geometry": "straight edges along curves",
}

#: What is better where a mesh has straight edges along curves.
ORDER_2 = "cells of order 2 follow them (gmsh: Mesh.ElementOrder = 2)"

# --- the coarser answer -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Coarser:
    """A setting to compare with, and at most how many times as large its error is.

    Attributes:
        setting: it.
        far: the ratio of their errors where distances are above `ASYMPTOTIC`.
        near: where they are nearer.
        most: the highest that smooth answers have.
    """

    setting: Setting
    far: float
    near: float
    most: float


def in_longer_steps(own: Setting, end: float) -> Coarser | None:
    """Return a setting in steps of twice the length; None where there is none.

    Args:
        own: of a history.
        end: of that, s.
    """
    order = order_of(own)
    if own.step is not None:
        ratio = 2.0 ** min(CERTAIN, order)
        longer = replace(own, step=2 * own.step, looser=ratio**2)  # as Newton's method converges with squares
        return Coarser(longer, ratio, ratio, ratio) if 2 * own.step <= end else None
    assert own.tolerance is not None
    tolerance = min(own.tolerance * 2.0**order, LOOSEST)
    ratio = (tolerance / own.tolerance) ** (1.0 / order)
    longest = min(2.0 * (own.max_step or LONGEST * end), end)
    setting = replace(own, tolerance=tolerance, max_step=longest)
    return Coarser(setting, *[ratio**CERTAIN] * 3) if ratio > 1.1 else None


def on_other_meshes(own: Setting) -> list[Coarser]:
    """Return settings on half the cells, of one degree less, and of one more; elements of degree 1 lock."""
    k = own.degree
    degrees = [Coarser(replace(own, degree=k - 1), 2.0, 2.0, 2.0)] if k > 2 else []
    degrees.append(Coarser(replace(own, degree=k + 1), *[1.0 + BEYOND] * 3))
    if own.elements is None:
        return degrees
    plate = isinstance(own.elements, tuple)
    cells = own.elements if isinstance(own.elements, tuple) else (own.elements,)
    half = tuple((n + 1) // 2 for n in cells)
    ratio = min(n / m for n, m in zip(cells, half, strict=True))
    elements: Elements = (half[0], half[1]) if len(half) == 2 else half[0]
    orders = (max(2, k), CORNER if plate else 2 * max(2, k) - 2, 2 * k)
    fewer = [Coarser(replace(own, elements=elements), *(ratio**p for p in orders))] if ratio >= LONGER else []
    return [*fewer, *(degrees if plate else degrees[::-1])]


def coarser(own: Setting, end: float) -> list[Coarser]:
    """Return settings that are coarser in steps and mesh, the best one first; none where steps cannot be longer."""
    meshes = on_other_meshes(own)
    if not own.moving:
        return meshes
    pairs = [(mesh, in_longer_steps(mesh.setting, end)) for mesh in meshes]
    return [
        Coarser(steps.setting, min(steps.far, mesh.far), min(steps.near, mesh.near), mesh.most)
        for mesh, steps in pairs
        if steps is not None
    ]


def by_order(apart: float, before: float | None, other: Coarser, holds: bool) -> float:
    """Return the error of an answer.

    Args:
        apart: its distance to the coarser one.
        before: distance of this one to the next coarser; None without one.
        other: the coarser setting.
        holds: whether that is known to be in the asymptotic range.
    """
    if holds or before is None:
        return apart / ((other.near if holds else min(2.0, other.near)) - 1.0)
    least, largest = max(apart, before / other.most), max(apart, before)
    if least == 0.0:
        return 0.0
    q = min(other.far if largest > ASYMPTOTIC else other.near, before / least)
    return min(least / (q - 1.0), largest) if q > 1.0 else largest


def finer(own: Setting) -> Setting:
    """Return the next finer setting, steps of half the length and twice the cells; of a mesh file a degree more."""
    out, n = own, own.elements
    if n is None:
        out = replace(out, degree=own.degree + 1)
    else:
        out = replace(out, elements=(2 * n[0], 2 * n[1]) if isinstance(n, tuple) else 2 * n)
    if own.step is not None:
        return replace(out, step=own.step / 2)
    return out if own.tolerance is None else replace(out, tolerance=own.tolerance / 2 ** order_of(own))


def order_of(setting: Setting) -> int:
    """Return the order of the steps of a history."""
    order: int = registry.schemes[str(setting.scheme)].order
    return order


# --- the error --------------------------------------------------------------------------------------------------------


@dataclass
class Errors:
    """Contributions to the error of an answer, relative to the largest value of its output, or to each frequency.

    Attributes:
        parts: name (see `WORDS`) ↦ error; None where it is unknown.
        unknown: why.
        scale: largest value of the output.
        at: time of the largest difference, s.
        each: of every mode: error by the mesh; None where it is unknown.
        rows: settings with their errors and CPU seconds, of the coarser answer, this one and, extrapolated, the next.
    """

    parts: dict[str, float | None]
    unknown: list[str] = field(default_factory=list)
    scale: float = 0.0
    at: float | None = None
    each: Sequence[float | None] = field(default_factory=list)
    rows: list[dict[str, Any]] = field(default_factory=list)

    @property
    def total(self) -> float | None:
        """Sum of the contributions; None where one is unknown."""
        known = [float(part) for part in self.parts.values() if part is not None]
        return sum(known) if len(known) == len(self.parts) else None

    def summary(self) -> dict[str, Any]:
        """Return the table `error` of a summary."""
        more = {} if self.at is None else {"time_at": self.at}
        return {**self.parts, "total": self.total, "scale": self.scale, **more}


def estimate(answers: Answers, own: Answer, parts: bool = False) -> Errors:
    """Return the error of an answer.

    Args:
        answers: of its scene.
        own: the answer.
        parts: whether errors of steps and mesh are wanted one by one.
    """
    scene, setting = answers.scene, own.setting
    end = 0.0 if scene.time is None else scene.time.end
    each = [None] * len(own.output.values) if isinstance(own.output, Spectrum) else []
    out = Errors({}, scale=own.output.scale, each=each)
    ways: dict[str, Callable[[Setting], list[Coarser]]] = {"space": on_other_meshes}
    if setting.moving and parts:
        ways = {"time": lambda s: [c for c in [in_longer_steps(s, end)] if c is not None], **ways}
    elif setting.moving:
        ways = {"discretisation": lambda s: coarser(s, end)}
    rows = answers.times
    for name, others in ways.items():
        answers.times = rows
        found = _compare(out, name, answers, own, others)
    if (lost := own.outcome.round_off) is not None:  # a bound; that of another mesh is independent, so d shows it
        out.parts["round_off"] = min([lost, *(r["error"] for r in out.rows[:1])])
    if (chords := own.outcome.chords) > 0.0:
        out.parts["geometry"] = chords
    if not registry.theories[setting.theory].exact:
        poor = own if found is None or found.setting.degree > setting.degree else found
        out.parts["model"] = of_theory(out, answers, own, poor)
    return out


def _compare(
    out: Errors, name: str, answers: Answers, own: Answer, others: Callable[[Setting], list[Coarser]]
) -> Answer | None:
    """Add a contribution by the distance to the first of coarser answers that there is; return that."""
    out.parts[name] = None
    found, why = _next(answers, own, others(own.setting))
    if found is None:
        out.unknown.append(f"there is no coarser answer: {why}")
        return None
    answer, other = found
    apart = distance(own, answer)
    if not math.isfinite(apart.size):
        out.unknown.append("nothing moves, where it does with a coarser setting")
        return answer
    kinks = name != "space" and answer.outcome.steps > FEWER * own.outcome.steps
    if kinks and own.setting.tolerance is None:
        out.unknown.append("kinks and jumps of what is prescribed leave no longer steps")
        return answer
    if isinstance(own.output, Spectrum) and isinstance(cells := answer.setting.elements, int) and cells < FEW:
        other = replace(other, near=other.far)
    halved = answer.setting.degree == own.setting.degree
    before: Distance | None = None
    plate, moving = isinstance(own.setting.elements, tuple), own.setting.moving
    if halved and not moving and (plate or apart.size > ASYMPTOTIC):
        coarsest = [c for c in others(answer.setting)[:1] if c.setting.degree == own.setting.degree]
        third, _ = _next(answers, answer, coarsest)
        if third is not None:
            output = answer.output  # of modes with those that are no partner by their order
            output = replace(output, count=None) if isinstance(output, Spectrum) else output
            before = output.apart(third[0].output)
    known = moving or not plate or before is None
    if isinstance(own.output, Spectrum):
        last = [None] * len(apart.each) if before is None else before.each[apart.partners]
        pairs = [(float(d), b) for d, b in zip(apart.each, last, strict=True)]
        out.each = each = [by_order(d, b, other, known and d <= ASYMPTOTIC) for d, b in pairs]
        error = max(each, default=0.0)
    else:
        holds = known and max(apart.size, apart.bent) <= ASYMPTOTIC
        error = by_order(apart.size, None if before is None else before.size, other, holds)
    if kinks:
        error += own.setting.tolerance or 0.0  # which bounds the error of the steps by what the controller sums
    out.parts[name], out.at = error, apart.at if out.at is None else out.at
    if name != "time":
        following = finer(own.setting)
        out.rows = [row(answer.setting, apart.size, answer.seconds), row(own.setting, error, own.seconds)]
        if halved:
            growth = max(1.0, own.seconds / max(answer.seconds, 1e-3))  # of no more than the work: one-off costs
            seconds = min(own.seconds * growth, own.predicted(following))
            out.rows.append(row(following, error / other.far, seconds, True))
    return answer


def _next(answers: Answers, own: Answer, others: list[Coarser]) -> tuple[tuple[Answer, Coarser] | None, str]:
    """Return the first of coarser answers that there is, with its setting; None and why without one.

    Of fixed steps it has every second row, where longer steps end, too.
    """
    why = "there are too few steps to take steps of twice the length"
    if own.setting.step is not None and answers.times is not None:
        answers.times = np.unique(np.append(answers.times[::2], answers.times[-1]))
    for other in others:
        found, reason = attempt(answers, other.setting)
        if found is not None and has_longer_cells(own, found):
            return (found, other), ""
        why = f"{other.setting.words()}: {reason or 'places that are nodes leave no longer cells'}"
    return None, why


def has_longer_cells(own: Answer, other: Answer) -> bool:
    """Return whether each cell of another answer is at least LONGER times as long, or its degree is another one."""
    if own.setting.degree != other.setting.degree or own.setting.elements == other.setting.elements:
        return True
    for here, there in zip(own.outcome.lines, other.outcome.lines, strict=True):
        middle = (here[1:] + here[:-1]) / 2
        lengths = np.diff(there)[np.searchsorted(there, middle) - 1] / np.diff(here)
        if float(lengths.min()) < LONGER * (1 - 1e-9):
            return False
    return True


def attempt(answers: Answers, setting: Setting) -> tuple[Answer | None, str]:
    """Return the answer with a setting, or None and why it fails."""
    try:
        return answers(setting), ""
    except (ComputationError, InputError) as error:
        return None, error.what if isinstance(error, ComputationError) else error.allowed


def exact_theory(scene: Scene) -> str:
    """Return the name of the richest exact theory of a scene's structure; "" where there is none."""
    kind = scene.structure.type
    exact = [theory for theory in registry.theories if theory.exact and theory.holds_for(kind)]
    return str(max(exact, key=lambda theory: theory.rank).name) if exact else ""


def of_theory(out: Errors, answers: Answers, own: Answer, poor: Answer) -> float | None:
    """Return the error of a theory by an answer of it in a coarse setting; None where it is unknown."""
    richest = exact_theory(answers.scene)
    if not richest:
        out.unknown.append(f"there is no exact theory of a {answers.scene.structure.type}")
        return None
    rich, why = attempt(answers, replace(poor.setting, theory=richest))
    if rich is None:
        out.unknown.append(f"there is no answer of {richest} to compare with: {why}")
        return None
    if own.outcome.stable and rich.outcome.stable is False:
        return 1.0  # above a buckling load that the theory does not have
    size = distance(rich, poor).size
    return size if math.isfinite(size) else None


def row(setting: Setting, error: float | None, seconds: float, extrapolated: bool = False) -> dict[str, Any]:
    """Return a row of the table of settings: `setting`, `error` (relative), `seconds` of CPU, `extrapolated`."""
    more = {"extrapolated": True} if extrapolated else {}
    return {"setting": setting.summary(), "words": setting.words(), "error": error, "seconds": seconds, **more}


# --- in words ---------------------------------------------------------------------------------------------------------


def percent(ratio: float | None) -> str:
    """Return a ratio in per cent with two digits, of large ones three."""
    if ratio is None:
        return "unknown"
    if 0.0 < ratio <= FLOOR:
        return f"< {100 * FLOOR:.0e} %"
    return "0 %" if ratio == 0.0 else f"{100 * ratio:.2g} %" if ratio < 0.995 else f"{100 * ratio:.3g} %"


def _known(error: float | None) -> float | None:
    """Return an error as it is shown: of nothing no less than is known of it."""
    return None if error is None else max(error, FLOOR)


def error_line(summary: Mapping[str, Any]) -> str:
    """Return the line about `error` of a summary."""
    parts = ", ".join(f"{WORDS[n]} {percent(_known(summary[n]))}" for n in WORDS if n in summary)
    if summary["total"] is None:
        return f"error: unknown ({parts})"
    return f"error (estimated): {percent(_known(summary['total']))} ({parts})"


def table_lines(rows: list[dict[str, Any]]) -> list[str]:
    """Return the table of settings as lines."""
    cells = []
    for r in rows:
        about, size = "≈ " if r.get("extrapolated") else "", _known(r.get("error"))
        error = r.get("failed", "–" if size is None else f"{about}{size:.1e}" if size > FLOOR else f"< {FLOOR:.0e}")
        cells.append((r["words"], error, f"{about}{r['seconds']:.2g}"))
    return ShortTable(("setting", "error", "CPU s"), cells).lines(LINE) if cells else []


def warnings_of(errors: Errors, own: Setting, scene: Scene) -> list[str]:
    """Return what is to be known of an error: what is unknown, how to reduce a large one but of modes."""
    said = [f"the error is unknown: {why}" for why in errors.unknown]
    model = errors.parts.get("model") or 0.0
    if model > OUT_OF_RANGE:
        how = "out of its range" if model >= 1.0 else f"in error by about {100 * model:.2g} %"
        said.append(f'model.theory = "{own.theory}" is {how} here; "{exact_theory(scene)}" is exact')
    chords = errors.parts.get("geometry") or 0.0
    if chords > max(NOTICED, own.tolerance or 0.0):
        said.append(f"the mesh has straight edges along curves: {percent(chords)} in frequencies; {ORDER_2}")
    rest = sum(errors.parts.get(name) or 0.0 for name in ("discretisation", "time", "space"))
    if rest > max(NOTICED, own.tolerance or 0.0) and not errors.each:
        what, of = ("tip", " of its largest displacement") if own.moving else ("result", "")
        said.append(
            f"the {what} may be in error by {percent(rest)}{of}; to reduce it: {finer(own).words()}, or --accuracy"
        )
    return said
