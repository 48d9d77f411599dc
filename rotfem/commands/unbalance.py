"""`rotfem unbalance`: whirl of a shaft under its unbalances over the speed (see `rotfem.analysis.unbalance`)."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from scipy.optimize import brentq, minimize_scalar

from rotfem.analysis.unbalance import Orbits, UnbalanceResponse
from rotfem.commands.advice import beyond
from rotfem.commands.campbell import parse_speeds
from rotfem.commands.modes import analysis_of
from rotfem.commands.problem import Problem
from rotfem.commands.processes import modal_summary
from rotfem.errors import InputError, SceneError, input_of
from rotfem.results.unbalance import UnbalanceResult
from rotfem.scene import Scene
from rotfem.units import split_unit

Array = npt.NDArray[Any]

#: Part of a peak at whose height its width is read (API 617).
HALF_POWER = np.sqrt(0.5)


def whirl(
    scene: Scene,
    speeds: Sequence[float] | str,
    probes: Sequence[tuple[float, float]],
    operating: Sequence[float] | None,
    comm: MPI.Comm,
) -> UnbalanceResult:
    """Return amplitudes, phases, orbits and bearing forces of a shaft over the speed (see `rotfem.unbalance`)."""
    shown = scene.showing("speed", speeds)
    asked, started = parse_speeds(speeds) if isinstance(speeds, str) else list(map(float, speeds)), perf_counter()
    with input_of(shown.file):
        problem = Problem.of(shown).spinning()
        if problem.frame != "fixed":
            why = "must be a round shaft that spins about its axis: straight, the same in all directions"
            raise InputError("structure", None, f"{why}; its frame is {problem.frame}")
        if not problem.unbalances:
            raise InputError("loads.unbalance", None, "give one, or a mass with an offset across the axis")
        if operating is not None and not 0.0 < operating[0] <= operating[1]:
            raise SceneError("command line", "--operating", list(operating), "must increase, from above 0")
        for x, _ in probes:
            if not 0.0 <= x <= (shown.structure.length or 0.0):
                raise SceneError("command line", "--probe", x, f"must be from 0 to {shown.structure.length:g} m")
        analysis = analysis_of(shown, problem, comm, False)
        response = UnbalanceResponse(analysis, problem.unbalances, (x for x, _ in probes))
        answers = [response.at(speed) for speed in asked]
        rows = [
            row
            for speed, answer in zip(asked, answers, strict=True)
            for row in rows_of(response, speed, answer, probes)
        ]
        found = peaks_of(response, asked, answers, operating)
        summary = {
            **modal_summary("unbalance", analysis, shown, started),
            "unbalances": [{"x": u.x, "kg_m": u.moment, "phase": u.phase} for u in problem.unbalances],
            "places": response.places,
            "probes": [{"x": x, "angle": angle} for x, angle in probes],
            "operating": None if operating is None else list(operating),
            "peaks": found,
            "warnings": [*analysis.notes, *beyond(problem, asked, asked), *undamped(problem)],
            "advice": [],
        }
        return UnbalanceResult(summary, rows, np.array([shape for shape, _, _ in answers]), response.x)


def rows_of(
    response: UnbalanceResponse,
    speed: float,
    answer: tuple[Array, Array, list[dict[str, complex]]],
    probes: Sequence[tuple[float, float]],
) -> list[dict[str, Any]]:
    """Return one row a place at a speed (see `rotfem.UnbalanceResult`)."""
    _, there, forces = answer
    rows = []
    for x, (y, z) in zip(response.places, there.T, strict=True):
        orbit = Orbits(y, z)
        row: dict[str, Any] = {"speed": float(speed), "x": float(x)}
        for name, value in (("u2", y), ("u3", z)):
            row |= {name: float(abs(value)), f"{name}_phase": float(np.angle(value))}
        row |= {name: float(getattr(orbit, name)) for name in ("major", "minor", "angle")}
        for i in (i for i, support in enumerate(response.supports) if support == x):
            for name, value in forces[i].items():
                row |= {name: float(abs(value)), f"{name}_phase": float(np.angle(value))}
        for angle in (angle for place, angle in probes if place == x):
            reading = orbit.along(angle)
            row |= {"probe": float(abs(reading)), "probe_phase": float(np.angle(reading))}
        rows.append(row)
    return rows


def peaks_of(
    response: UnbalanceResponse,
    speeds: Sequence[float],
    answers: Sequence[tuple[Array, Array, list[dict[str, complex]]]],
    operating: Sequence[float] | None,
) -> list[dict[str, Any]]:
    """Return the peaks of the larger semi-axis at every place, between the speeds."""

    def major(speed: float, place: int) -> float:
        return float(Orbits(*response.at(float(speed))[1][:, place]).major)

    peaks = []
    for place, x in enumerate(response.places):
        sizes = np.array([Orbits(*there[:, place]).major for _, there, _ in answers])
        for i in 1 + np.flatnonzero((sizes[1:-1] > sizes[:-2]) & (sizes[1:-1] >= sizes[2:])):
            between = (speeds[i - 1], speeds[i + 1])
            top = minimize_scalar(
                lambda s, place=place: -np.log(major(s, place)),
                bounds=between,
                method="bounded",
                options={"xatol": 1e-6 * between[1]},
            )
            size, sides = float(np.exp(-top.fun)), []
            for way in (-1, 1):
                at, beyond_it = float(top.x), i + way
                while 0 <= beyond_it < len(speeds) and sizes[beyond_it] > HALF_POWER * size:
                    beyond_it += way
                if 0 <= beyond_it < len(speeds):
                    ends = sorted((at, speeds[beyond_it]))
                    sides.append(brentq(lambda s, i=place, h=HALF_POWER * size: major(s, i) - h, *ends, rtol=1e-7))
            amplification = float(top.x / (sides[1] - sides[0])) if len(sides) == 2 else None
            peaks.append(
                {
                    "x": float(x),
                    "speed": float(top.x),
                    "major": size,
                    "amplification": amplification,
                    "margin": None if operating is None else margin(float(top.x), operating),
                }
            )
    return peaks


def margin(speed: float, operating: Sequence[float]) -> float:
    """Return the distance of a speed from a range in parts of the nearer end of it; 0 within it."""
    low, high = operating
    return (low - speed) / low if speed < low else (speed - high) / high if speed > high else 0.0


def undamped(problem: Problem) -> list[str]:
    """Return a warning if nothing takes energy from the shaft, or feeds it."""
    parts = (*problem.structure.supports, *problem.structure.couplings)
    if problem.structure.damping.model_fields_set or any(part.feeds for part in parts):
        return []
    return ["nothing damps the shaft: its peaks have no height, what is shown is round-off; give supports a damping"]


def probe_of(text: str) -> tuple[float, float]:
    """Return place (m) and angle (rad) of a probe, from "x:angle", the angle in degrees or with a unit."""
    try:
        place, _, angle = text.partition(":")
        number, unit = split_unit(angle or "0") if angle else ("0", 1.0)
        return float(place), float(number) * (unit if unit != 1.0 else np.pi / 180)
    except ValueError:
        raise SceneError("command line", "--probe", text, "must be x:angle, in m and degrees") from None
