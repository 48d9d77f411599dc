"""The beams of the verification cases, and the folder of reference values."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from rotfem.scene import Scene
from rotfem.scene.settings import OutputTable
from tests.beams import SPIN_UP

#: Reference values (see the README.md there): spectral and collocation codes, no finite elements.
REFERENCE = Path(__file__).resolve().parents[1] / "reference"

#: The hub beam of ICCIA (2017), with shear as in the reference values: nu = 0.3, k = 5/6.
HUB_BEAM: dict[str, Any] = {
    "structure": {
        "type": "planar_beam",
        "length": 8.0,
        "section": {
            "E": 6.8952e10,
            "nu": 0.3,
            "rho": 2766.0,
            "area": 7.2986e-5,
            "second_moment": 8.2189e-9,
            "shear_correction": 5 / 6,
        },
    },
    "motion": {"type": "spin_up", "speed": 4.0, "duration": 15.0},
    "mesh": {"elements": 8, "degree": 3},
}

#: L = A_rho = EI = 1, moderately thick: r = 1/20, GA_s = EA/3.059.
UNIT_BEAM: dict[str, Any] = {
    "structure": {
        "type": "planar_beam",
        "length": 1.0,
        "section": {
            "EA": 400.0,
            "GA": 400.0 / 3.059,
            "EI": 1.0,
            "mass_per_length": 1.0,
            "rotary_inertia": 1.0 / 400.0,
        },
    },
    "motion": {"type": "constant", "speed": 0.0},
    "mesh": {"elements": 6, "degree": 3},
}

MakeScene = Callable[..., Scene]


def _factory(tables: dict[str, Any]) -> MakeScene:
    def make(changes: Mapping[str, Any] | None = None, **tops: Any) -> Scene:
        """Return the scene with whole tables replaced (keywords) and then dotted keys (mapping) changed."""
        return Scene.from_dict(copy.deepcopy(tables) | tops).replace(changes or {})

    return make


@pytest.fixture(scope="session")
def spin_up() -> MakeScene:
    return _factory(SPIN_UP)


@pytest.fixture(scope="session")
def hub_beam() -> MakeScene:
    return _factory(HUB_BEAM)


@pytest.fixture(scope="session")
def unit_beam() -> MakeScene:
    return _factory(UNIT_BEAM)


def reference_file(name: str) -> Path:
    """Return the path of a reference file."""
    return REFERENCE / name


@pytest.fixture(scope="session")
def reference() -> Callable[[str], Path]:
    """Return the function that finds a reference file."""
    return reference_file


@pytest.fixture(autouse=True)
def unestimated(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the estimates of errors, as output.error = false does: they move no answer (tests.pairs).

    Tests marked `estimated` keep them.
    """
    if request.node.get_closest_marker("estimated") is None:
        monkeypatch.setattr(OutputTable, "error", property(lambda _: False), raising=False)
