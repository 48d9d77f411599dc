"""What tangents do not see of how errors grow: motions as large as the structure, and bursts of them.

A tangent in the middle of a window says how errors grow where a motion is much the same throughout. In a burst the
structure turns round within a few steps, and an error, a lag of the motion at first, grows as its rates do. By how much
these rise is no matter of the steps. Eight planar strips that cracked, in steps of 2 to 4 ms, were off by 1.7 to 11
times what tangents say; with this growth 0.7 to 3.1 times their true error is told.

Short of that, motions as large as the structure are quick and slow, too, and what the mesh lacks while they are quick
grows with them: of ten soft strips, with and without damping, errors of the mesh above 1e-4 were 1 to 6 times what
tangents say, their largest rate 1.4 to 2.8 times the root of the mean square.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.error_samples import Samples

Array = npt.NDArray[np.float64]

#: Factor to the median rate, and to that of the slowest vibration with 1 rad of rotation, from which a rate is quick.
QUICK = 5.0

#: Rotation at such rates in all, rad, from which they are a burst and no small motion among smaller ones.
TURNED = np.pi

#: Order of the schemes whose errors are told too small in bursts; of higher ones they are told large enough.
ORDER = 2

#: Largest growth: errors of the strips grew 11 times at most, those of the mesh 3 times.
MOST, OF_MESH = 10.0, 3.0


@dataclass(frozen=True)
class Burst:
    """A burst of a motion.

    Attributes:
        t: when it is quickest, s.
        growth: its largest rate of rotation, in units of the root of the mean square of those before it.
    """

    t: float
    growth: float


def burst_in(t: Array, lengths: Array, rates: Array, slowest: float) -> Burst | None:
    """Return the burst of a motion; None if it has none.

    Args:
        t: ends of the steps, s, (n,).
        lengths: of the steps, s, (n,).
        rates: of rotation, the largest of the structure in every step, rad/s, (n,).
        slowest: frequency of the slowest vibration, rad/s.
    """
    quick = rates > QUICK * max(float(np.median(rates)), slowest)
    if not float((rates * lengths)[quick].sum()) > TURNED:
        return None
    peak = int(np.argmax(rates))
    before = ~quick & (np.arange(len(rates)) < peak)
    calm = float(np.sqrt((rates**2 * lengths)[before].sum() / max(lengths[before].sum(), lengths[peak])))
    return Burst(float(t[peak]), float(min(MOST, rates[peak] / max(calm, slowest, rates[peak] / MOST))))


def growth_in(lengths: Array, rates: Array, size: float) -> float:
    """Return by which factor errors of the mesh grow beyond what tangents say in a motion without a burst.

    Args:
        lengths: of the steps, s, (n,).
        rates: as in `burst_in`.
        size: largest displacement of the tip, in lengths of the structure.
    """
    mean = float(np.sqrt((rates**2 * lengths).sum() / lengths.sum()))
    quick = float(rates.max()) / mean if mean > 0.0 else 1.0
    return 1.0 + (min(MOST, quick) - 1.0) * min(1.0, size**2)


def turning_rates(system: Any, samples: Samples, components: Sequence[int]) -> Array:
    """Return the largest rate of rotation of a structure in every step, rad/s, (n,); 0 where it is counted anew.

    Args:
        system: equations of the structure, its hub held.
        samples: states, and the steps between them.
        components: numbers of the unknowns of a node that are rotations.
    """
    n, size, states, steps = len(system.zeros()), len(system.structure.unknowns), samples.states, samples.steps
    turned = samples.displacements[:, :n].reshape(len(states), n // size, size)[:, :, list(components)]
    begin, end = np.array(steps).T
    angles = np.sqrt(((turned[end] - turned[begin]) ** 2).sum(axis=2)).max(axis=1, initial=0.0)
    if any(state[-1] is not states[0][-1] for state in states):
        angles[[states[i][-1] is not states[j][-1] for i, j in steps]] = 0.0
    if system.comm.size > 1:
        angles = np.max(system.comm.allgather(angles), axis=0)
    t = np.array([state[0] for state in states])
    return np.asarray(angles / (t[end] - t[begin]))
