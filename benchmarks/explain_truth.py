"""How good every row of `rotfem explain` is on ten scenes, against runs on finer meshes with finer steps.

    ./with-fenicsx python3 benchmarks/explain_truth.py [fresh | further | odd | unseen | last | SCENE …]

of `explain_scenes.SETS["fresh"]`, of the sets named, or of the scenes named.

The truth of an effect or a theory is the difference of two runs on twice the elements with a quarter of the steps in a
scheme of fourth order; of the steps and the mesh that of the scene's own to the finer ones. Columns: kind, name and
output of the row, estimate, truth, estimate/truth.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from explain_scenes import SETS, scene

import rotfem
from rotfem.refinement.distance import distance, distance_each
from rotfem.refinement.explain import LARGE, NOTICEABLE
from rotfem.scene import Scene

#: Below it a change is not compared: round-off of two Newton solutions.
SMALLEST = 1e-8

#: Steps of a truth for every one of the scene.
FINER_STEPS = 4


def finer(of: Scene, mesh: bool = True, steps: bool = True) -> Scene:
    """Return a scene with finer mesh or steps, its rows where they were."""
    changes: dict[str, Any] = {"solver.increment_tolerance": 1e-12, "output.error": False}
    if mesh:
        n = of.mesh.elements
        changes["mesh.elements"] = [2 * k for k in n] if isinstance(n, tuple) else 2 * (n or 1)
    if steps and of.time is not None:
        assert of.time.step is not None
        every = FINER_STEPS * of.time.output_every
        changes |= {"time.step": of.time.step / FINER_STEPS, "time.output_every": every, "time.scheme": "esdirk4"}
    return of.replace(changes)


def truth_of(of: Scene, result: Any) -> dict[str, Any]:
    """Return output ↦ what a scene truly gives of those that were explained; None where it fails."""
    out: dict[str, Any] = {}
    for name in result.outputs:
        try:
            if name != "modes":
                history = rotfem.run(of).history
                out[name] = np.stack([v for k, v in history.items() if k.startswith("tip_u")], axis=1)
                continue
            hub = of.motion.type == "torque"
            turning = of.replace({"motion.speed": result.summary["speeds"][0]}) if hub else of
            rows = rotfem.modes(turning).rows  # no rigid body, of an overdamped mode the slow one
            rows = [r for r in rows if r["label"] != "rigid body" and not r["label"].endswith(", fast")]
            out[name] = np.array([complex(row["growth"], row["frequency"]) for row in rows])
        except rotfem.ComputationError:
            out[name] = None
    return out


def apart(of: dict[str, Any], to: dict[str, Any]) -> dict[str, float]:
    """Return output ↦ relative change from one truth to another; infinite where one fails."""
    measures = {"modes": distance_each}
    return {
        name: np.inf if here is None or to[name] is None else measures.get(name, distance)(here, to[name])
        for name, here in of.items()
    }


def with_truth(of: Scene, result: Any) -> list[dict[str, Any]]:
    """Return the rows of an explanation with their true changes."""
    effects = result.summary["effects"]
    exact = of.replace({"model.effects": effects, "model.frame": "rotating"})
    own = truth_of(finer(exact), result)
    for row in result.rows:
        name = row["name"]
        if row["kind"] == "effect":
            kept = sorted(set(effects) ^ {name})
            row["truth"] = apart(own, truth_of(finer(exact.replace({"model.effects": kept})), result))
        elif row["kind"] == "theory":
            row["truth"] = apart(own, truth_of(finer(exact.replace({"model.theory": name})), result))
        elif name == "time.step":
            row["truth"] = apart(truth_of(finer(exact, mesh=False), result), truth_of(exact, result))
        else:
            row["truth"] = apart(own, truth_of(finer(exact, mesh=False), result))
    return list(result.rows)


def main() -> None:
    """Print the table, and how many rows are within a factor 3, large ones for large ones counted with them."""
    inside, missed = [], []
    for name in [name for one in sys.argv[1:] or ["fresh"] for name in SETS.get(one, [one])]:
        result = rotfem.explain(scene(name))
        print(f"{name}: {', '.join(result.summary['effects'])}", flush=True)
        for row in with_truth(scene(name), result):
            if row["verdict"] == "negligible" and max(row["truth"].values()) > NOTICEABLE:
                missed.append(f"{name}: {row['name']}")
            for output, truth in row["truth"].items():
                guess = row["estimate"][output]
                off = (
                    1.0
                    if guess is None or max(guess, truth) < SMALLEST or guess == truth
                    else guess / max(truth, 1e-300)
                )
                inside.append(1 / 3 <= off <= 3 or min(guess or 0.0, truth) >= LARGE)
                mark = "" if inside[-1] else "  <-- off"
                what = f"    {row['kind']:<15}{row['name']:<20}{output:<9}"
                print(f"{what}{-1.0 if guess is None else guess:>9.1e}{truth:>9.1e}{off:>8.2f}{mark}", flush=True)
    print(f"{sum(inside)} of {len(inside)} within a factor 3; above 1 % but called negligible: {missed or 'none'}")


if __name__ == "__main__":
    main()
