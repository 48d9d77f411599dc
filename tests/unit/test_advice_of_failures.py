"""What a failure recommends is no theory that the computation has already."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rotfem.analysis.equilibrium import less
from rotfem.errors import ComputationError
from rotfem.mechanics.theories import theories
from rotfem.structures.reference_rotation import check_sections


@pytest.mark.parametrize("theory", theories(), ids=lambda theory: theory.name)
def test_only_other_theories_are_recommended(theory: Any) -> None:
    """Of an equilibrium that is not found, and of a section that has turned by more than once."""
    turned = np.array([[0.0, 0.0, 0.0, 0.0, 7.0, 0.0]])
    beam: Any = SimpleNamespace(nodes=lambda q: ({"x": np.zeros(1)}, q), problem=SimpleNamespace(theory=theory))
    with pytest.raises(ComputationError) as caught:
        check_sections(beam, turned)
    system: Any = SimpleNamespace(model=SimpleNamespace(theory=theory))
    for advice in (caught.value.advice, less(system)):
        assert ("model.theory" in advice) is not theory.exact
        assert f'"{theory.name}"' not in advice
