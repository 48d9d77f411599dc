"""`rotfem response`: what harmonic loads make of a structure that spins steadily, over their frequency.

The motion is small and about the equilibrium under the loads that are constant; all harmonic loads of the scene work
together, with their amplitudes and phases, at one frequency that is swept (see `rotfem.analysis.frequency_response`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.accuracy.errors import OUT_OF_RANGE
from rotfem.analysis.equilibrium import steady_state
from rotfem.analysis.frequency_response import (
    FrequencyResponse,
    HarmonicOutput,
    hub_output,
    root_of_free_hub,
    root_output,
    station_output,
    tip_output,
)
from rotfem.analysis.modal import ModalAnalysis, Spinning
from rotfem.commands.advice import beyond, frozen_in_frame
from rotfem.commands.mode_tables import doubtful, mode_rows, remarks
from rotfem.commands.modes import analysis_of, final_speed
from rotfem.commands.problem import Problem
from rotfem.commands.processes import modal_summary, shared_out
from rotfem.errors import InputError, SceneError, input_of
from rotfem.mechanics.loads import Load, Loads, PlaceLoad, Term
from rotfem.results.columns import described
from rotfem.results.modes import ResponseResult
from rotfem.scene import Scene
from rotfem.units import split_unit

Array = npt.NDArray[Any]

#: Change of the log of an amplitude that bends its curve visibly; least distance of frequencies added for it, in parts
#: of the range; part of the largest amplitude of its unit below which one is too small to matter.
BEND, NARROW, DEEP = 0.2, 2e-4, 1e-6

#: Times at which swept loads are: 0 without their harmonics, 1 with the part in phase, 2 with that a quarter ahead.
SWEPT = (0.0, 1.0, 2.0)


def response_of(
    scene: Scene,
    low: float | str | None,
    high: float | str | None,
    number: int,
    per_rev: Sequence[float],
    comm: MPI.Comm,
    problem: Problem | None = None,
) -> ResponseResult:
    """Return amplitudes and phases under harmonic loads (see `rotfem.response`), of a problem or of that of a scene."""
    scene, started = scene.showing("frequency", high if low is None else low), perf_counter()
    with input_of(scene.file):
        problem = problem or Problem.of(scene)
        if any(support.of_frequency for support in getattr(scene.structure, "supports", ())):
            why = "depend on the frequency of whirl; modes, campbell and unbalance take them"
            raise InputError("structure.supports", None, why)
        problem = problem.replace(loads=swept_loads(problem.loads))
        analysis = analysis_of(scene, problem, comm)
        spinning = analysis.at(final_speed(scene, problem), scene.modes.count)
        answers = FrequencyResponse(analysis, spinning, *loaded(scene, analysis, spinning))
        asked, peaks, undamped = frequencies_of(answers, spinning, (low, high, number, per_rev))

        def answers_at(omegas: Array) -> Array:  # the same bits on all ranks, which then choose the same frequencies
            if analysis.comm.size == comm.size:
                return np.array([comm.bcast(answers.direct(omega)) for omega in omegas])
            return np.array(shared_out(list(omegas), answers.direct, comm))

        direct = answers_at(asked)
        if not len(per_rev) or low is not None or high is not None:
            given = asked[~peaks]
            infinite = spinning.pairs.values[undamped].imag
            asked, direct = resolved(answers_at, asked, direct, answers.names, number, infinite)
            peaks = ~np.isin(asked, given)
        return result_of(scene, answers, (asked, peaks, undamped), direct, started)


def loaded(scene: Scene, analysis: ModalAnalysis, spinning: Spinning) -> tuple[Array, list[HarmonicOutput]]:
    """Return f̂ of the harmonic loads at an equilibrium, what they add to the forces on the owned unknowns, and outputs.

    The equilibrium is left in the system.
    """
    system, motion = analysis.system, analysis.system.motion.at_speed(spinning.speed)
    forces, held, moments, q = [], [], list[Any](), spinning.q
    if system.linear and analysis.about == "steady":  # a load prestresses what is displaced
        q = steady_state(system, spinning.speed, analysis.newton, notes=[])
    for t in (*SWEPT, SWEPT[0]):  # what is read of motions is about the loads that are constant
        system.set_time(t, motion)
        system.set_state(q)
        forces.append(system.residual().array.copy())  # −F: loads push with their sign
        held.append(system.clamp_forces())
        moments.append(0.0 if system.row is None else -system.row.work())
    force, push, moment = (parts[1] - parts[0] + 1j * (parts[2] - parts[0]) for parts in (forces, held, moments))
    outputs = [tip_output(system), root_output(system, push)]
    if analysis.free:
        outputs[1:] = [root_of_free_hub(analysis.system, push, spinning.speed), hub_output(analysis.system)]
        force = np.append(force, [moment] if analysis.comm.rank == analysis.comm.size - 1 else [])
    if scene.output.stations is not None:
        beam = system.structure
        names = (*scene.output.sections(beam.type), *beam.components)
        outputs.append(station_output(system, scene.output.positions(beam.length), names))
    return np.asarray(force), outputs


def frequencies_of(
    answers: FrequencyResponse, spinning: Spinning, wanted: tuple[Any, Any, int, Sequence[float]]
) -> tuple[Array, Array, list[int]]:
    """Return the frequencies (rad/s, increasing), which of them were added to see peaks, and modes without damping."""
    low, high, number, per_rev = wanted
    lines = abs(spinning.speed) * np.array([k for k in per_rev if k > 0.0])
    if len(per_rev) and (spinning.speed == 0.0 or len(lines) < len(per_rev)):
        raise SceneError("command line", "--per-rev", list(per_rev), "orders must be above 0, of a hub that spins")
    if len(lines) and low is None and high is None:
        return np.unique(lines), np.zeros(len(np.unique(lines)), dtype=bool), []
    swinging = spinning.pairs.resolved.imag
    last = angular(high, "--to", 1.2 * float(np.max(swinging)))  # a fifth beyond the highest mode
    free = answers.loose
    first = angular(low, "--from", 0.5 * float(np.min(swinging[swinging > 0.0], initial=last)) if free else 0.0)
    if free and first == 0.0:
        raise SceneError("command line", "--from", low, "must be above 0 of a free hub or a hinge that nothing holds")
    if not 0.0 <= first < last < np.inf or number < 2:
        reason = "frequencies must increase from at least 0 (rad/s, or with a unit), and their number be at least 2"
        raise SceneError("command line", "--from, --to, --number", [first, last, number], reason)
    grid = np.concatenate([np.linspace(first, last, number), lines])
    more, undamped = answers.peaks(first, last)
    asked = np.unique(np.concatenate([grid, more]))
    return asked, ~np.isin(asked, grid), undamped


def resolved(
    answers_at: Callable[[Array], Array],
    omegas: Array,
    values: Array,
    outputs: Sequence[str],
    most: int,
    infinite: npt.ArrayLike = (),
) -> tuple[Array, Array]:
    """Return frequencies (rad/s) and answers, so close that amplitudes on a logarithmic scale run smoothly.

    Where the logarithm of an amplitude is off the line through its neighbours by more than BEND, the intervals on both
    sides are halved, the worst first.
    """
    least, left = NARROW * float(omegas[-1] - omegas[0]), most
    units = np.array([described(name)[1] for name in outputs])
    of_one_unit = units[:, None] == units
    while left > 0:
        sizes = np.abs(values)
        largest = np.max(of_one_unit * np.max(sizes, axis=0), axis=1)
        heights = np.log(np.maximum(sizes, DEEP * largest + 1e-300))
        part = ((omegas[1:-1] - omegas[:-2]) / (omegas[2:] - omegas[:-2]))[:, None]
        bend = np.max(np.abs(heights[1:-1] - (1 - part) * heights[:-2] - part * heights[2:]), axis=1)
        of_interval = np.maximum(np.append(bend, 0.0), np.insert(bend, 0, 0.0))
        of_interval[np.diff(omegas) < least] = 0.0
        inside = np.searchsorted(omegas, infinite)
        of_interval[inside[(inside > 0) & (inside < len(omegas))] - 1] = 0.0
        worst = np.argsort(-of_interval)[:left]
        chosen = np.sort(worst[of_interval[worst] > BEND])
        if not len(chosen):
            break
        further = 0.5 * (omegas[chosen] + omegas[chosen + 1])
        values = np.insert(values, chosen + 1, answers_at(further), axis=0)
        omegas = np.insert(omegas, chosen + 1, further)
        left -= len(further)
    return omegas, values


def angular(value: float | str | None, option: str, default: float) -> float:
    """Return a frequency in rad/s, of a number or a text that may have a unit."""
    if value is None:
        return default
    try:
        number, unit = split_unit(str(value))
        return float(number) * unit
    except ValueError as error:
        raise SceneError("command line", option, value, str(error)) from None


def result_of(
    scene: Scene,
    found: FrequencyResponse,
    asked: tuple[Array, Array, list[int]],
    direct: Array,
    started: float,
) -> ResponseResult:
    """Return the result of the answers at frequencies, those of peaks marked."""
    (omegas, peaks, undamped), outputs = asked, found.names
    analysis, spinning = found.analysis, found.spinning
    rows = list[dict[str, Any]]()
    for omega, answers, peak in zip(omegas, direct, peaks, strict=True):
        row: dict[str, Any] = {"frequency": float(omega), "frequency_hz": float(omega / (2 * np.pi))}
        row |= {} if spinning.speed == 0.0 else {"per_rev": float(omega / abs(spinning.speed))}
        for name, answer in zip(outputs, answers, strict=True):
            row |= {name: float(abs(answer)), f"{name}_phase": float(np.angle(answer))}
        rows.append(row | {"peak": int(peak)})
    modes = mode_rows(spinning)
    stability, said = remarks(spinning, modes)
    held = beyond(analysis.problem, [spinning.speed])
    warnings = [*frozen_in_frame(analysis.problem), *held, *said, *doubtful(modes)]
    warnings += [no_damping(modes, undamped)] if undamped else too_large(analysis, outputs, direct)
    if scene.accuracy is not None:
        warnings.append(
            f"accuracy = {scene.accuracy:g} is not pursued: a frequency response is of the scene's own model and mesh"
        )
    summary = {
        **modal_summary("response", analysis, scene, started),
        "speed": spinning.speed,
        "stability": stability.summary(),
        "outputs": outputs,
        "frequencies": len(omegas),
        "peaks": {
            name: {"frequency": float(omegas[i]), "amplitude": float(abs(direct[i, j]))}
            for j, (name, i) in enumerate(zip(outputs, np.argmax(np.abs(direct), axis=0), strict=True))
        },
        "modes": modes[: scene.modes.count],
        "warnings": list(dict.fromkeys(warnings)),
        "advice": [],
    }
    return ResponseResult(summary, rows, direct)


def too_large(analysis: ModalAnalysis, outputs: Sequence[str], direct: Array) -> list[str]:
    """Return the warning of amplitudes θ beyond linear theory, whose relative error is about ½ θ²."""
    length = analysis.structure.length
    tip = [j for j, name in enumerate(outputs) if name.startswith("tip_")]
    turns = {outputs[j]: np.max(np.abs(direct[:, j])) / (length if "_u" in outputs[j] else 1.0) for j in tip}
    worst = max(turns, key=lambda name: turns[name], default="")
    if not worst or turns[worst] ** 2 / 2 <= OUT_OF_RANGE:
        return []
    how = f"{turns[worst]:.2g} of the length" if "_u" in worst else f"{turns[worst]:.2g} rad"
    return [
        f"{worst} has an amplitude of {how}: the response is linear, in error by about "
        f"{100 * turns[worst] ** 2 / 2:.2g} % there; rotfem run takes deflections of any size"
    ]


def no_damping(modes: Sequence[Mapping[str, Any]], undamped: Sequence[int]) -> str:
    """Return the warning of modes without damping."""
    named = ", ".join(f"{modes[j]['label']} at {modes[j]['frequency']:.6g} rad/s" for j in undamped[:3])
    named += f" and {len(undamped) - 3} more" if len(undamped) > 3 else ""
    return (
        f"no damping: the response is infinite at {named}; peaks there only show how near a frequency came; "
        "give [structure.damping]"
    )


def swept_loads(given: Loads) -> Loads:
    """Return loads whose harmonic parts at the times SWEPT are 0, cos φ and sin φ times their amplitude.

    So a load Re(f̂ e^{iωt}) of any frequency, f̂ = amplitude e^{iφ}, can be put together.
    """
    made = given.replaced({name: load.unpitched or load for name, load in given.named.items()})
    changing = {name: load for name, load in made.named.items() if not load.constant}
    if not any(term.phase is not None for load in changing.values() for term in getattr(load, "terms", ())):
        why = "a frequency response needs a harmonic load, such as loads.tip_force.harmonic = "
        raise InputError("loads", None, why + "{ amplitude = [0, 1], frequency = 1 }; its frequency is swept")
    swept: dict[str, Load] = {}
    for name, load in changing.items():
        if isinstance(load, PlaceLoad) or any(t.amplitudes is not None and t.phase is None for t in load.terms):
            raise InputError(f"loads.{name}", None, "must be constant or harmonic in a frequency response")
        swept[name] = replace(load, terms=tuple(map(_swept, load.terms)))
    return made.replaced(swept)


def _swept(term: Term) -> Term:
    if term.phase is None:
        return term
    factors = np.array([0.0, np.cos(term.phase), np.sin(term.phase)])
    return replace(term, amplitudes=lambda t: np.asarray(factors[np.searchsorted(SWEPT, t)][:, None]))
