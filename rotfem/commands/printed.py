"""What the commands print of their results, as lines of text; that of `cost` is in its package."""

from __future__ import annotations

from math import nan
from pathlib import Path
from typing import Any

from rotfem.refinement.estimate import error_line
from rotfem.results.units import ShownUnits, in_unit


def run_report(summary: dict[str, Any], folder: Path) -> list[str]:
    """Return the lines a run prints."""
    f, time = summary["figures"], summary["timings"]
    lines = [
        f"{summary['name']}: {summary['theory']}, {summary['frame']} frame, {summary['elements']} elements, "
        f"{summary['dofs']} dofs",
        f"effects: {', '.join(summary['effects']) or 'none'} "
        f"({summary['integrals']['F']} integrals in F, {summary['integrals']['J']} in J)",
    ]
    if "left_out" in summary:
        lines.append(f"left out, as nothing moves them: {', '.join(summary['left_out']['unknowns'])}")
    lines += choice_report(summary)
    if summary["kind"] == "history":
        lines.append(
            reduced_report(summary)
            if "reduced" in summary
            else f"{summary['steps']} steps, {summary['newton_iterations']} iterations in {time['total']:.2f} s "
            f"(compile {time['compile']:.2f}, assemble {time['assemble']:.2f}, solve {time['solve']:.2f})"
        )
        for name in ("tip_u1", "tip_u2", "tip_u3"):
            if f"{name}_min" in f:
                low, high = (f"{f[f'{name}_{w}']:.6g} m at t = {f[f'{name}_{w}_time']:.4f} s" for w in ("min", "max"))
                lines.append(f"{name.replace('_', ' ')}: {low} … {high}, at the end {f[f'{name}_final']:.6g} m")
    else:
        finals = {k.removesuffix("_final").replace("_", " "): v for k, v in f.items() if k.endswith("_final")}
        values = (f"{name} = {value:.6g}" for name, value in finals.items())
        held = {True: "stable", False: "unstable", None: ""}[summary.get("stability", {}).get("stable")]
        lines.append(f"{held} steady state in {time['total']:.2f} s: {', '.join(values)}".lstrip())
    return [*lines, *error_report(summary), f"results in {folder}"]


def error_report(summary: dict[str, Any]) -> list[str]:
    """Return the line that says how far the results may be off, if that is known."""
    return [error_line(summary["error"])] if "error" in summary else []


def reduced_report(summary: dict[str, Any]) -> str:
    """Return the line that a run prints of its reduced model."""
    model, time = summary["reduced"], summary["timings"]
    return (
        f"reduced model of {model['vectors']} vectors in {model['steps']} steps, "
        f"{time['total']:.2f} s (compile {time['compile']:.2f}, reduce {time['reduce']:.2f}); "
        f"errors: basis {model['projection_error']:.1e}, time {model['time_error']:.1e}"
    )


def check_report(summary: dict[str, Any], folder: Path) -> list[str]:
    """Return the lines `check` prints."""

    def vector(name: str) -> str:
        return ", ".join(f"{value:.6g}" for value in summary[name])

    lines = [
        f"{summary['name']}: {summary['type']}, length {summary['length']:.9g} m, {summary['elements']} elements",
        f"mass                    {summary['mass']:.9g} kg",
        f"centre of mass          ({vector('center_of_mass')}) m from the origin of the frame",
        f"first moments           ({vector('first_moment_root')}) kg·m about the clamp at ({vector('root')}) m",
        f"inertia about the axis  {summary['inertia_axis']:.9g} kg·m² of rotation",
    ]
    for where in ("root", "center"):
        name = {"root": "the clamp", "center": "its centre of mass"}[where]
        rows = ["  ".join(f"{value:13.6g}" for value in row) for row in summary[f"inertia_{where}"]]
        lines += [f"inertia about {name}, kg·m²", *(f"  {row}" for row in rows)]
    return [*lines, f"results in {folder}"]


def modes_report(summary: dict[str, Any], folder: Path) -> list[str]:
    """Return the lines `modes` prints: a table."""
    units = ShownUnits.of(summary)
    first = units.frequency if units.frequency != "Hz" else "rad/s"  # there is a column of Hz in any case
    lines = [
        f"{summary['name']}: {summary['theory']} about the {summary['about']} state at "
        f"{units.speeds(summary['speed']):g} {units.speed}, "
        f"{summary['dofs']} dofs, in {summary['timings']['total']:.2f} s",
        f"effects: {', '.join(summary['effects']) or 'none'}",
        *choice_report(summary),
        f"{'mode':>4}  {'label':<16}{first:>14}{'Hz':>12}{'damping':>12}{'error':>10}",
    ]
    for row in summary["modes"]:
        lines.append(
            f"{row['mode']:>4}  {row['label']:<16}{in_unit(row['frequency'], first):>14.6f}{row['frequency_hz']:>12.6f}"
            f"{row['damping']:>12.3e}{row['error_bound']:>10.1e}"
        )
    return [*lines, *error_report(summary), f"results in {folder}"]


#: How a branch is critical, by the kind of the speed.
MEETINGS = {
    "forward": "forward whirl, {label}",
    "backward": "backward whirl, {label}",
    "per_rev": "{label} meets {per_rev}Ω",
}


def campbell_report(summary: dict[str, Any], folder: Path) -> list[str]:
    """Return the lines `campbell` prints: branches and critical speeds."""
    units, width = ShownUnits.of(summary), max(16, *(len(b["label"]) for b in summary["branches"]))
    ends = "".join(f"{f'{end} {units.frequency}':>14}" for end in ("first", "last"))
    lines = [
        f"{summary['name']}: {summary['theory']}, {summary['speeds']} speeds ({summary['speeds_solved']} solved), "
        f"{summary['dofs']} dofs, in {summary['timings']['total']:.2f} s",
        *choice_report(summary),
        f"{'branch':>6}  {'label':<{width}}{ends}{'confidence':>12}",
    ]
    for b in summary["branches"]:
        first, last = (
            "lost" if b[k] is None else f"{units.frequencies(b[k]):.6f}" for k in ("frequency_first", "frequency_last")
        )
        lines.append(f"{b['branch']:>6}  {b['label']:<{width}}{first:>14}{last:>14}{b['confidence']:>12.3f}")
    for c in summary["critical_speeds"]:
        at = f"{units.speeds(c['speed']):.6f} {units.speed}"
        lines.append(f"critical speed {at}: {MEETINGS[c['kind']].format(**c)}")
    return [*lines, *error_report(summary), f"results in {folder}"]


def response_report(summary: dict[str, Any], folder: Path) -> list[str]:
    """Return the lines `response` prints: where outputs are largest."""
    units = ShownUnits.of(summary)
    lines = [
        f"{summary['name']}: {summary['theory']} about the {summary['about']} state at "
        f"{units.speeds(summary['speed']):g} {units.speed}, {summary['frequencies']} frequencies, "
        f"{summary['dofs']} dofs, in {summary['timings']['total']:.2f} s",
        f"{'output':<14}{'amplitude':>14}{'at ' + units.frequency:>14}",
    ]
    for name, peak in summary["peaks"].items():
        lines.append(f"{name:<14}{peak['amplitude']:>14.6g}{units.frequencies(peak['frequency']):>14.6f}")
    off = summary["difference"]
    sizes = f"{off['median']:.1e} (median), {off['largest']:.1e} (largest)"
    modes = f"difference of the response by {len(summary['modes'])} modes: {sizes}"
    return [*lines, modes, f"results in {folder}"]


def accuracy_report(summary: dict[str, Any]) -> list[str]:
    """Return the line that says what an accuracy has led to, if one was asked for."""
    wanted = summary.get("accuracy")
    if wanted is None:
        return []
    chosen, tries = wanted["chosen"], len(wanted["attempts"])
    model = chosen["theory"] + (" by a reduced model" if chosen.get("reduced") else "")
    mesh = f"{by(chosen['elements'])} elements" if "elements" in chosen else "the mesh of the file"
    steps = f", {chosen['scheme']} to {chosen['tolerance']:.2g}" if "tolerance" in chosen else ""
    steps = f", {chosen['scheme']} with steps of {chosen['step']:.3g} s" if "step" in chosen else steps
    met = "met" if wanted["met"] else "not met"
    attempts = "" if tries == 1 else f" after {tries} attempts"
    return [f"accuracy {wanted['asked']:g} {met}{attempts}: {model}, {mesh} of degree {chosen['degree']}{steps}"]


def by(elements: int | list[int] | tuple[int, ...]) -> str:
    """Return numbers of elements as text."""
    return "×".join(map(str, elements)) if isinstance(elements, list | tuple) else str(elements)


def choice_report(summary: dict[str, Any]) -> list[str]:
    """Return the line that says which model was chosen, if one was."""
    choice = summary.get("choice")
    if choice is None:
        return accuracy_report(summary)
    dropped = ", ".join(row["name"] for row in choice["dropped"]) or "nothing"
    known = choice["estimated_error"]
    error = f"estimated error {'unknown' if known is None else f'{known:.1e}'} of {choice['tolerance']:g} allowed"
    return [f"chosen in {choice['seconds']:.2f} s: {choice['theory']}; left out: {dropped}; {error}"]


def size_of_change(estimate: float | None, resolution: float) -> str:
    """Return an estimate as text; one that is below the resolution as smaller than that."""
    if estimate is None:
        return "unknown"
    return f"<{resolution:.0e}".replace("e-0", "e-") if 0.0 < estimate < resolution else f"{estimate:.1e}"


def explain_report(summary: dict[str, Any], folder: Path) -> list[str]:
    """Return the lines `explain` prints: dimensionless groups, then a row an effect and a theory."""
    outputs, rows = summary["outputs"], summary["rows"]
    checked = any("truth" in row for row in rows)
    lines = [
        f"{summary['name']}: {summary['theory']} with {', '.join(summary['effects']) or 'no effects'}, "
        f"in {summary['timings']['total']:.2f} s",
        *(f"{value:>12.4g}  {summary['meaning'][name]}" for name, value in summary["groups"].items()),
        f"{'relative change of':<26}" + "".join(f"{n:>10}{'true':>10}" if checked else f"{n:>10}" for n in outputs),
    ]
    for row in rows:
        what = {True: "without ", False: "with "}[row["included"]] if row["kind"] == "effect" else ""
        what = "theory " if row["kind"] == "theory" else what
        cells = ""
        for name in outputs:
            below = "<" if name in row.get("bounds", ()) else ""
            cells += f"{below + size_of_change(row['estimate'][name], summary['resolution']):>10}"
            cells += f"{row.get('truth', {}).get(name, nan):>10.1e}" if checked else ""
        lines.append(f"{what + row['name']:<26}{cells}  {row['verdict']}: {row['why']}")
    lines += choice_report(summary)
    lines += [f"no {name}: {text}" for name, text in summary["absent_effects"].items()]
    return [*lines, f"results in {folder}"]


def sweep_report(summary: dict[str, Any], folder: Path) -> list[str]:
    """Return the lines `sweep` prints."""
    keys = " × ".join(f"{key} ({len(values)})" for key, values in summary["keys"].items())
    done = summary["points"] - summary["failed"]
    return [
        f"{summary['name']}: {' '.join(summary['verb'])} over {keys}",
        f"{done} of {summary['points']} points done, {summary['seconds']:.3g} s of computing",
        f"results in {folder}",
    ]
