"""Loads over span and time in a scene: how they are written, and what is refused."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

import rotfem
from rotfem import Scene, SceneError

BEAM = {"type": "planar_beam", "length": 10.0, "section": {"EA": 1e6, "GA": 1e6, "EI": 1e3, "mass_per_length": 1.0}}
TIME = {"time": {"end": 0.1, "step": 0.05}}
STILL = {"type": "constant", "speed": 0.0}
RAMP = [[0, 0, 0], [5, 0, 1]]


def scene(loads: Any, **more: Any) -> Scene:
    """Return a scene of a beam with these loads."""
    return Scene.from_dict({"structure": BEAM, "motion": STILL, "mesh": {"elements": 2}, "loads": loads, **more})


def test_functions_are_refused_with_the_key() -> None:
    three = {"over_time": lambda t: 1.0, "harmonic": {"amplitude": [0, 0, 1], "frequency": 1.0}}
    for loads, words in (
        ({"distributed": {"over_span": lambda x, t: (0, 1)}}, "f(x)"),
        ({"tip_moment": three}, "one component"),
    ):
        with pytest.raises(SceneError, match=re.escape(words)) as caught:
            scene(loads)
        assert caught.value.key.startswith("loads.")


def test_a_bare_table_is_over_time_or_refused_where_it_may_be_over_the_span() -> None:
    with pytest.raises(SceneError, match=r"over_time .* over_span .* over_span_and_time"):
        scene({"distributed": [[0.0, 0, 1], [BEAM["length"], 0, 2]]}, **TIME)
    load = scene({"distributed": RAMP}, **TIME).loads.distributed
    assert load is not None
    assert load.given[0] == "over_time"


def test_a_bare_function_is_of_time_or_of_place_and_time() -> None:
    for function, key in ((lambda t: (0, t), "over_time"), (lambda x, t: (0, x * t), "over_span_and_time")):
        assert scene({"distributed": function}).loads.distributed.given == (key, function)  # type: ignore[union-attr]


def test_tables_from_files(tmp_path: Any) -> None:
    (tmp_path / "span.csv").write_text("x, f1, f2\n0, 0, 1\n5, 0, 2\n5, 0, 3\n10, 0, 4\n")
    tables = {"structure": BEAM, "motion": STILL, "loads": {"distributed": {"over_span": "span.csv"}}}
    read = Scene.from_dict(tables, directory=tmp_path).loads.distributed
    assert read is not None
    assert read.over_span == ((0, 0, 1, 0), (5, 0, 2, 0), (5, 0, 3, 0), (10, 0, 4, 0))
    (tmp_path / "span.csv").write_text("0, 0, 1\n5, 0, 2\n4, 0, 3\n")
    with pytest.raises(SceneError, match="row 3: 4 < 5"):
        Scene.from_dict(tables, directory=tmp_path)


def raises(x: float, t: float) -> tuple[float, float]:
    """Fail as a user's function may."""
    raise RuntimeError("no data")


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (raises, "raised RuntimeError: no data"),
        (lambda x, t: (1, 2, 3, 4), "must return 3 numbers, not 4"),
        (lambda x, t: (0.0, np.nan), "finite"),
        (lambda x, t: "much", "must return 3 numbers"),
        (lambda x, t: (0.0, 1.0, 1.0), "third component"),
        (lambda t: 1 / 0, "raised ZeroDivisionError"),
    ],
)
def test_a_function_that_fails_is_bad_input(function: Any, words: str) -> None:
    with pytest.raises(SceneError, match="loads.distributed") as caught:
        rotfem.run(scene({"distributed": function}, **TIME))
    assert words in str(caught.value)


def test_what_changes_with_time_is_said_where_there_is_one_time_only() -> None:
    done = rotfem.run(scene({"tip_force": {"over_time": [[0, 0, 1], [1, 0, 2]]}}, model={"theory": "linear"}))
    assert any("loads.tip_force changes with time" in line for line in done.summary["warnings"])
    assert done.tip["u2"][-1] == pytest.approx(1e3 / (3 * 1e3) + 10 / 1e6, rel=1e-9)  # F = 1: L³/3EI + L/GA


def test_a_place_of_a_plate_is_one_argument() -> None:
    plate = {"type": "plate", "length": 1.0, "width": 0.5, "thickness": 0.01, "E": 7e10, "nu": 0.3, "rho": 2700.0}
    tables = {"structure": plate, "motion": STILL, "loads": {"pressure": {"over_span": lambda x, y: y}}}
    with pytest.raises(SceneError, match=r"f\(\(x, y\)\); it takes 2 arguments"):
        Scene.from_dict(tables)
