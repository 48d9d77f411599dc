"""The tables of modes, of any modal analysis: rows, shapes, and what is to be warned of."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.modal import ModalAnalysis, Spinning, stability
from rotfem.analysis.stability import Stability, stability_of_pencil
from rotfem.commands.fields import modes_writer, surface_of
from rotfem.results.modes import ModesResult
from rotfem.structures.mode_names import RIGID_BODY, Wave, distinct
from rotfem.units import speed_text

Array = npt.NDArray[Any]


def mode_tables(found: Spinning, count: int, formats: tuple[str, ...] | None = None) -> ModesResult:
    """Return the first modes at a speed, with warnings of the model and of instabilities."""
    analysis, rigid, structure = found.analysis, int(found.rigid), found.analysis.structure
    spinning = found.first(count - rigid)
    rows = mode_rows(spinning)
    stability, warnings = remarks(spinning, rows)
    rows = [{**row, "mode": row["mode"] + rigid} for row in rows]
    scaled = spinning.pairs.right / scales(spinning)
    titles = [f"mode {row['mode']}: {row['label']}" for row in rows]
    shapes = {title: scaled_shape(analysis, x) for title, x in zip(titles, scaled.T, strict=True)}
    if rigid:  # hub and structure turn together, λ = 0
        columns = rows[0] if rows else mode_rows(found.first(1))[0]
        first: dict[str, Any] = dict.fromkeys(columns, 0.0)
        rows = [{**first, "mode": 1, "label": str(RIGID_BODY), "stability": "neutral", "share_hub": 1.0}, *rows]
    summary = {
        **{"command": "modes", "status": "done", "theory": analysis.problem.theory.name, "speed": found.speed},
        **{"effects": list(analysis.model.effects), "modes": rows, "shapes": {"length": structure.length}},
        **{"stability": stability.summary(), "warnings": warnings},
    }
    out = ModesResult(summary, rows, shapes, triangles=structure.surface(), analysis=analysis, spinning=spinning)
    if shapes and formats is not None:
        out.surface = surface_of(structure, next(iter(shapes.values())))
        out.fields = modes_writer(analysis, out) if formats else None
    return out


def remarks(spinning: Spinning, rows: list[dict[str, Any]]) -> tuple[Stability, list[str]]:
    """Return the stability of the equilibrium, and warnings of it, of the model, and of modes that grow."""
    analysis = spinning.analysis
    found = stability_of_pencil(analysis.structure, spinning.pencil, spinning.clamped)
    out = [*analysis.notes, *advice(analysis, spinning.speed), *instabilities(rows)]
    out += critical(rows, spinning.speed, analysis.fixed)
    # An instability that grows by more than those of the modes that are asked for is none of them.
    least = 1.001 * max((row["growth"] for row in rows), default=0.0)
    if found.stable is None or found.held_by_spin or found.growth > max(least, 0.0):
        out.append(found.warning())
    return found, out


def mode_rows(spinning: Spinning) -> list[dict[str, Any]]:
    """Return one row a mode: frequency (rad/s, Hz), damping ratio, growth (1/s), label, shares, errors."""
    rows, pairs, waves = [], spinning.pairs, spinning.waves
    names, rigid = distinct(spinning.names), [name == RIGID_BODY for name in spinning.names]
    for i, (lam, error, bound) in enumerate(zip(pairs.values, pairs.errors, pairs.bounds, strict=True)):
        if rigid[i]:
            lam, bound = 0.0j, 0.0
        size = abs(lam) if bound < 1.0 else 0.0  # else λ is zero to round-off, whose sign is no damping
        rows.append(
            {
                "mode": i + 1,
                "label": names[i],
                "frequency": float(lam.imag),
                "frequency_hz": float(lam.imag / (2 * np.pi)),
                "damping": float(-lam.real / size) if size > 0.0 else 0.0,
                "growth": float(lam.real),
                "stability": "neutral" if rigid[i] else stability(lam, float(bound)),
                **{f"share_{name}": float(share[i]) for name, share in spinning.shares.items()},
                **(whirl(waves[i], lam, abs(spinning.speed)) if waves else {}),
                "residual": float(error),
                "error_bound": float(bound),
            }
        )
    return rows


def whirl(wave: Wave, lam: complex, speed: float) -> dict[str, Any]:
    """Return what a row says of the precession of a mode λ of a rotor (see `rotfem.CampbellResult`)."""
    omega = float(lam.imag)
    direction = wave.direction(omega, speed)
    fixed = abs(wave.seen_fixed(omega, speed)) if direction or wave.shaft else omega
    out = {"turning": wave.share, "whirl": direction or "standing", "frequency_fixed": fixed}
    if wave.shaft and wave.fixed:
        out["log_decrement"] = float(-2 * np.pi * lam.real / omega) if omega > 0.0 else None
    elif wave.shaft:
        out["frequency_fixed_2"] = abs(replace(wave, share=-wave.share).seen_fixed(omega, speed))
    return out


def instabilities(rows: list[dict[str, Any]]) -> list[str]:
    """Return a warning for every unstable mode."""
    return [
        f"{row['stability']}: {row['label']} grows as exp({row['growth']:.6g} t)"
        for row in rows
        if row["stability"].endswith("instability")
    ]


def critical(rows: list[dict[str, Any]], speed: float, fixed: bool) -> list[str]:
    """Return a warning for every mode of a rotor whose forward critical speed is this one, but for 0.1 % of it."""
    return [
        f"critical speed: {row['label']} has {speed_text(omega, 3)} in the rotor at {speed_text(abs(speed))}; an "
        "unbalance meets no stiffness there"
        for row in rows
        if row.get("whirl") == "forward" and (omega := abs(row["frequency"] - fixed * abs(speed))) < 1e-3 * abs(speed)
    ]


def doubtful(rows: list[dict[str, Any]]) -> list[str]:
    """Return warnings of frequencies that round-off may have changed by 0.01 %, or the mesh by 2 %, and more."""
    lost = [(row["label"], row["error_bound"]) for row in rows if 1e-4 < row["error_bound"] < 1.0]
    zero = ", ".join(row["label"] for row in rows if row["error_bound"] >= 1.0)
    off = [(row["label"], error) for row in rows if (error := row.get("mesh_error") or 0.0) > 0.02]
    unreliable = ", ".join(f"{label} by up to {100 * bound:.2g} %" for label, bound in lost)
    coarse = ", ".join(f"{label} by about {100 * error:.2g} %" for label, error in off)
    texts = {
        unreliable: f"unreliable: round-off may have changed {unreliable} (error_bound), as axial or shear stiffness "
        "outweighs what these modes feel; fewer elements, or stiffnesses that are lower but still without influence",
        zero: f"unreliable: round-off leaves no digit of {zero}: nothing holds that motion, or axial or shear "
        "stiffness outweighs what it feels",
        coarse: f"coarse: the mesh may have changed {coarse} (mesh_error); more mesh.elements, or a higher mesh.degree",
    }
    return [text for found, text in texts.items() if found]


def advice(analysis: ModalAnalysis, speed: float) -> list[str]:
    """Return warnings about the model: a plate that is nearly a disk, frequencies without Coriolis forces."""
    doubt = getattr(analysis.structure, "doubt", "")
    found = [doubt] if doubt else []
    if speed != 0.0 and "coriolis" not in analysis.model.effects:
        found.append(
            "coriolis is not among model.effects: frequencies in the rotating frame are wrong without it, and ω² can "
            "come out negative"
        )
    return found


def scales(spinning: Spinning) -> Array:
    """Return what the eigenvectors are divided by, complex, (modes,).

    The largest translation u of a mode is then 1 and real: that of the vector, over the structure and the phase,
    max_φ |Re(u e^{iφ})|² = ½(|u|² + |u·u|), with u·u e^{2iφ} real. Of a mode whose kinetic energy is for the most part
    that of rotations, it is the largest rotation times the length of the structure.
    """
    structure = spinning.analysis.structure
    out, right, turned = [], spinning.pairs.right, spinning.rotary > 0.5
    for i in range(right.shape[1]):
        values = structure.nodes(right[:, i])[1]
        translations, rotations = values[:, structure.moves], structure.length * values[:, ~structure.moves]
        z = rotations if turned[i] or not np.any(translations) else translations
        squares = np.sum(z * z, axis=1)
        largest = int(np.argmax(np.sum(np.abs(z) ** 2, axis=1) + np.abs(squares)))
        turn = np.exp(-0.5j * np.angle(squares[largest]))
        real = np.real(z[largest] * turn)
        size = np.linalg.norm(real) * np.sign(real[np.argmax(np.abs(real))])
        out.append(size / turn)
    return np.array(out)


def scaled_shape(analysis: ModalAnalysis, x: Array) -> dict[str, Array]:
    """Return a scaled mode along the structure: x (m), real and imaginary part of each component.

    Translations are parts of the largest one, rotations (rad) are multiplied by the length of the structure over it.
    """
    coordinates, values = analysis.structure.nodes(x)
    columns: dict[str, Array] = dict(coordinates)
    for c, name in enumerate(analysis.structure.components):
        column = values[:, c] if name.startswith("u") else analysis.structure.length * values[:, c]
        columns[name], columns[f"{name}_imag"] = column.real, column.imag
    return columns
