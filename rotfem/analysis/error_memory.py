"""What an error watch must know to go on as if a run had never ended, as a tree of plain values and arrays.

Arrays over the mesh have its nodes as first axis, so that they can be put into an order that any number of processes
knows; all others, the same on every process, get a first axis of length one, which is no number of nodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.error_samples import Inner, Samples
from rotfem.analysis.error_watch import ErrorWatch
from rotfem.analysis.error_window import Window
from rotfem.analysis.ritz_vectors import RitzVectors
from rotfem.analysis.schemes import State

Array = npt.NDArray[Any]
Tree = dict[str, Any]

#: Attributes of a watch, of a window and of its shapes that are plain or the same on every process.
OF_WATCH = ("_bytes", "_closed", "_landed", "_sound", "_farthest")
OF_WINDOW = ("t", "M", "C", "K", "bends", "epsilon", "theory", "missing", "turn", "rates")
OF_SHAPES = ("squares", "tip", "made")


def kept(watch: ErrorWatch, state: State) -> Tree:
    """Return what a watch knows.

    Args:
        watch: of a march.
        state: that the march has reached.
    """
    watch.catch_up(state)
    nodes = _nodes(watch)
    reached = watch._reached
    goes_on = reached is not None and reached.q is state.q and reached.a is state.a
    return {
        **{name: getattr(watch, name) for name in OF_WATCH},
        "goes_on": goes_on,
        "now": _samples(watch._now, nodes),
        "windows": [_window(w, nodes if w is watch._windows[-1] else 0) for w in watch._windows],
    }


def put_back(watch: ErrorWatch, tree: Tree, state: State) -> None:
    """Make a watch know what a tree says; the march goes on from a state."""
    for name in OF_WATCH:
        setattr(watch, name, tree[name])
    watch._reached = state if tree["goes_on"] else None
    watch._now = _samples_of(tree["now"])
    watch._windows = [_window_of(watch, entry) for entry in tree["windows"]]


def _nodes(watch: ErrorWatch) -> int:
    """Return the number of nodes of this process, ghosts too."""
    nodes = watch.system.V.dofmap.index_map
    return int(nodes.size_local + nodes.num_ghosts)


def _samples(samples: Samples, nodes: int) -> Tree:
    """Return states (values at nodes, then the angles of a hub), steps and pieces."""
    data: list[Any] = []
    for state in samples.states:
        if not any(state[4] is datum for datum in data):
            data.append(state[4])
    out: Tree = {"steps": samples.steps, "pieces": samples.pieces, "t": [state[0] for state in samples.states]}
    out |= {"data": data, "datum": [_place(data, state[4]) for state in samples.states]}
    out |= {"within": [instant[:2] for instant in samples.inner]}
    for i, name in enumerate("qva", 1):
        whole = np.array([*(state[i] for state in samples.states), *(x[i + 1] for x in samples.inner)]).T
        size = len(whole) // nodes * nodes if len(whole) else 0
        out[name], out[f"hub_{name}"] = whole[:size].reshape(nodes, -1), whole[size:][None]
    return out


def _place(data: Sequence[Any], datum: Any) -> int:
    return next(i for i, known in enumerate(data) if known is datum)


def _samples_of(tree: Tree) -> Samples:
    own_number, inner = len(tree["t"]), [tuple(place) for place in tree["within"]]
    number = own_number + len(inner)
    arrays = []
    for name in "qva":
        over = tree[name]
        own = over.reshape(-1, number) if number else np.zeros((0, 0))
        arrays.append(np.concatenate([own, tree[f"hub_{name}"][0].reshape(-1, number)]).T if number else own)
    data = [tree["data"][i] for i in tree["datum"]]
    states = [(t, *(np.ascontiguousarray(x[i]) for x in arrays), data[i]) for i, t in enumerate(tree["t"])]
    within: list[Any] = [
        (int(step), float(t), *(np.ascontiguousarray(x[own_number + k]) for x in arrays))
        for k, (step, t) in enumerate(inner)
    ]
    return Samples(states, [tuple(step) for step in tree["steps"]], list(tree["pieces"]), inner=within)


def _window(window: Window, nodes: int) -> Tree:
    """Return a window that is closed; its shapes only where the next one needs them, with nodes."""
    out: Tree = {name: _same(getattr(window, name)) for name in OF_WINDOW}
    out |= {name: _same(getattr(window.shapes, name)) for name in OF_SHAPES}
    out |= {"speed": window.speed, "motion": _same(np.array(window.motion)), "shift": window.shapes.shift}
    out |= {"steps": _same(np.array(window.samples.steps)), "pieces": window.samples.pieces}
    if (inner := window.inner) is not None:
        out["inner"] = {"steps": _same(inner.steps), "t": _same(inner.t), "motion": _same(np.array(inner.motion))}
    if nodes:
        out |= {name: _over_nodes(getattr(window.shapes, name), window, nodes) for name in ("V", "massed")}
    return out


def _same(x: Any) -> Any:
    return None if x is None else np.asarray(x)[None]


def _over_nodes(owned: Array, window: Window, nodes: int) -> Array:
    """Return columns (owned, r) as values at the nodes of this process, ghosts zero."""
    size = window.shapes.block
    whole = np.zeros((nodes * size, owned.shape[1]))
    whole[: len(owned)] = owned
    return whole.reshape(nodes, -1)


def _window_of(watch: ErrorWatch, tree: Tree) -> Window:
    window = Window.__new__(Window)
    window.shapes = shapes = RitzVectors.__new__(RitzVectors)
    for thing, names in ((window, OF_WINDOW), (shapes, OF_SHAPES)):
        for name in names:
            setattr(thing, name, None if tree[name] is None else tree[name][0])
    window.speed, window.motion, window.free = tree["speed"], tuple(tree["motion"][0]), watch.system.hub is not None
    window.inner = None
    if (within := tree.get("inner")) is not None:
        window.inner = Inner(within["steps"][0], within["t"][0], tuple(within["motion"][0]))
    window.samples = Samples([], [(int(a), int(b)) for a, b in tree["steps"][0]], list(tree["pieces"]))
    space, r = watch.system.V.dofmap, len(shapes.squares)
    shapes.comm, shapes.shift, shapes.block = watch.system.comm, tree["shift"], space.index_map_bs
    owned = space.index_map.size_local * shapes.block
    for name in ("V", "massed"):
        x = tree[name].reshape(-1, r)[:owned] if name in tree else np.zeros((0, r))
        setattr(shapes, name, np.ascontiguousarray(x))
    return window
