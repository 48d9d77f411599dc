"""What the commands print of their results, as lines of text."""

from __future__ import annotations

from typing import Any

from rotfem.accuracy.answer import Setting
from rotfem.accuracy.errors import error_line, percent, table_lines
from rotfem.results.columns import ShownUnits
from rotfem.results.result import Result

#: Rows of the table of `cost` that is printed in full.
LONGEST_TABLE = 40


def report(result: Result) -> list[str]:
    """Return the lines that the command prints of its result."""
    s = result.summary
    tables = [line for table in result.tables() for line in table.lines()]
    before, after = _AROUND[s["command"]](s)
    scene = s.get("scene", {})
    known = scene.get("output", {}).get("error", True)
    unknown = [] if known or s["command"] == "unbalance" else ["error: not estimated, as output.error = false"]
    if scene.get("model", {}).get("effects") == "needed" and "needed" not in s:
        before.append('all effects are in: model.effects = "needed" chooses them for the tip in rotfem run alone')
    return [*before, *shared(s), *tables, *(of_error(s) if "error" in s else unknown), *after]


def of_error(s: dict[str, Any]) -> list[str]:
    """Return the lines about the error of a result, and what other accuracies cost."""
    return ([error_line(s["error"])] if "error" in s else []) + table_lines(s.get("settings", []))


def shared(s: dict[str, Any]) -> list[str]:
    """Return the line that says what several processes have shared."""
    if "shared" not in s:
        return []
    how = {"mesh": "shared the mesh", "nothing": "each computed all of it, as it is too small to be shared"}
    return [f"{s['ranks']} processes {how.get(s['shared'], 'shared the ' + s['shared'])}"]


def of_run(s: dict[str, Any]) -> tuple[list[str], list[str]]:
    """Return what a run prints before and after its table."""
    lines = [
        f"{s['name']}: {s['theory']} theory, {s['frame']} frame, {s['elements']} elements, {s['dofs']} unknowns",
        effects(s),
    ]
    if "left_out" in s:
        lines.append(f"not computed, as nothing excites it: {', '.join(s['left_out']['unknowns'])}")
    lines += accuracy_report(s)
    if dropped := s.get("needed", {}).get("dropped"):
        together = percent(s["needed"]["change"])
        lines.append(f"effects left out for the accuracy: {', '.join(dropped)}; together {together}")
    if s["kind"] != "history":
        stable = {True: "stable ", False: "unstable ", None: ""}[s.get("stability", {}).get("stable")]
        return [*lines, f"{stable}steady state, computed in {s['timings']['total']:.2f} s"], []
    time = s["timings"]
    took = f"{time['total']:.2f} s: compilation {time['compile']:.2f} s"
    how = f"{s['steps']} time steps, {s['newton_iterations']} Newton iterations, {took}"
    return [*lines, f"{how}, assembly {time['assemble']:.2f} s, linear solves {time['solve']:.2f} s"], []


def of_campbell(s: dict[str, Any]) -> tuple[list[str], list[str]]:
    """Return what `campbell` prints before and after its tables."""
    inserted = f", {s['speeds_inserted']} inserted to follow the modes" * bool(s["speeds_inserted"])
    line = (
        f"{s['name']}: {s['theory']} theory, {s['speeds']} speeds{inserted}, "
        f"{s['dofs']} unknowns, in {s['timings']['total']:.2f} s"
    )
    return [line, *accuracy_report(s)], []


def of_explain(s: dict[str, Any]) -> tuple[list[str], list[str]]:
    """Return what `explain` prints before and after its tables."""
    absent = ", ".join(f"{name} ({why})" for name, why in s["absent_effects"].items())
    after = [f"effects without data: {absent}"] if absent else []
    before = [f"{s['name']}: {s['theory']} theory, in {s['timings']['total']:.2f} s", effects(s)]
    return before, [*after, called_for(s["needed"])]


def called_for(found: dict[str, Any]) -> str:
    """Return the line about the model that a scene calls for."""
    out = f"for {found['accuracy']:g}: {', '.join([found['theory'], *found['effects']])}"
    if found["dropped"]:
        out += f"; not needed: {', '.join(found['dropped'])}"
    if found["change"] > 0.0:
        out += f"; together {percent(found['change'])}"
    return out if found["seconds"] is None else out + "; {:.2g} s instead of {:.2g} s".format(*found["seconds"])


def of_cost(s: dict[str, Any]) -> tuple[list[str], list[str]]:
    """Return what `cost` prints before and after its table."""
    settings = f"{s['settings']} settings ({s['failed']} failed) in {s['timings']['total']:.1f} s"
    front = "" if s["settings"] <= LONGEST_TABLE else "; all settings are in cost.csv"
    after = []
    if s["uncertainty"] is not None:
        after.append(f"* no other setting is both cheaper and more accurate{front}")
        after.append(f"reference: {s['reference']}, known to {percent(s['uncertainty'])}")
    if refused := s["budget"]["refused"]:
        after.append(f"{len(refused)} ladders ended for want of time: {refused[0]['why']}")
    if (row := s["recommended"]) is not None:
        after.append(f"for a relative accuracy of {s['accuracy']:g}: {row['words']}; {measured(row)}")
    else:
        after.append(f"no setting is known to be within {s['accuracy']:g} (relative)")
    if (near := s["closest"]) is not None:
        after.append(f"within {percent(near['within'])}: {near['row']['words']}; {measured(near['row'])}")
    return [f"{s['name']}: error of {s['output']}, {settings}"], after


def measured(row: dict[str, Any]) -> str:
    """Return error and time of a row as text."""
    return f"error {'≤ ' * row['at_most']}{percent(row['total_error'])}, {row['cost']:.3g} s of CPU time"


def of_sweep(s: dict[str, Any]) -> tuple[list[str], list[str]]:
    """Return what `sweep` prints before and after its table."""
    keys = " × ".join(f"{key} ({len(values)})" for key, values in s["keys"].items())
    done = s["points"] - s["failed"]
    line = f"{done} of {s['points']} points done, {s['seconds']:.3g} s of computing"
    return [f"{s['name']}: {' '.join(s['verb'])} over {keys}", line], []


#: Command ↦ what it prints before and after its tables.
_AROUND = {
    "run": of_run,
    "check": lambda s: ([f"{s['name']}: {s['type']} of {s['elements']} elements"], []),
    "modes": lambda s: ([about(s), effects(s), *accuracy_report(s)], []),
    "campbell": of_campbell,
    "response": lambda s: ([about(s), f"{s['frequencies']} frequencies of the load"], []),
    "unbalance": lambda s: ([f"{s['name']}: {s['theory']} theory, fixed frame, {s['dofs']} unknowns", effects(s)], []),
    "explain": of_explain,
    "cost": of_cost,
    "compare": lambda s: ([], [f"largest difference: {percent(s['worst'])}"]),
    "sweep": of_sweep,
}


def about(s: dict[str, Any]) -> str:
    """Return the first line about vibrations around a state."""
    units = ShownUnits.of(s)
    return (
        f"{s['name']}: {s['theory']} theory, about the {s['about']} state at {units.speeds(s['speed']):g} "
        f"{units.speed}, {s['dofs']} unknowns, in {s['timings']['total']:.2f} s"
    )


def effects(s: dict[str, Any]) -> str:
    """Return the line that names the effects in the model."""
    return f"effects: {', '.join(s['effects']) or 'none'}"


def accuracy_report(summary: dict[str, Any]) -> list[str]:
    """Return the line that says what an accuracy has led to, if one was asked for."""
    wanted = summary.get("accuracy")
    if wanted is None:
        return []
    met = "met" if wanted["met"] else "not met"
    tries = len(wanted["attempts"])
    attempts = "" if tries == 1 else f" after {tries} attempts"
    return [f"accuracy of {percent(wanted['asked'])} {met}{attempts}: {Setting.read(wanted['chosen']).words()}"]
