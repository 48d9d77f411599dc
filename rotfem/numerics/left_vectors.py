"""Left vectors of eigenpairs, y^H (λ² M + λ C + K) = 0, from right ones.

Two pairs of one pencil are bi-orthogonal,

    y_i^H [(λ_i + λ_j) M + C] x_j = 0   (λ_i ≠ λ_j),

which follows from the two linearised problems; see Tisseur & Meerbergen 2001, sections 3.4 and 3.6.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


def mirrored(values: Array, right: Array) -> Array:
    """Return the left vectors of a conservative pencil: y(λ) = x(−λ̄)."""
    return _pick(right, values, -values.conj())


def matched(values: Array, others: Array, vectors: Array) -> Array:
    """Return the left vectors from the right ones of the transposed pencil: y(λ) = conj of its vector at λ."""
    return _pick(vectors, others, values).conj()


def mirror_error(values: Array) -> float:
    """Return the largest relative distance of −λ̄ from the spectrum, over the inner half of the computed λ."""
    inner = values[(np.abs(values) <= np.median(np.abs(values))) & (values != 0.0)]  # 0 mirrors itself
    distance = np.abs(values[None, :] + inner.conj()[:, None]).min(axis=1)
    return float(np.max(distance / np.abs(inner), initial=0.0))


def _pick(vectors: Array, values: Array, wanted: Array) -> Array:
    index = np.array([int(np.argmin(np.abs(values - w))) for w in wanted], dtype=int)
    return vectors[:, index]
