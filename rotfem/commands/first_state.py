"""What a history starts from: a shape, an equilibrium, a mode, velocities."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.constant_conditions import stability_ahead
from rotfem.analysis.equilibrium import static_tip_shape, steady_state
from rotfem.analysis.modal import ModalAnalysis
from rotfem.analysis.stability import stability_of
from rotfem.commands.mode_tables import mode_tables
from rotfem.equations.compiled import compile_system
from rotfem.errors import InputError
from rotfem.numerics.newton import Newton
from rotfem.selection.left_out import with_all

if TYPE_CHECKING:
    from rotfem.commands.simulation import Simulation

Array = npt.NDArray[np.float64]

#: Part of its largest displacement below which the tip does not take part in a mode.
STILL = 1e-6


def first_state(run: Simulation) -> tuple[Array | None, Array | None]:
    """Return (q, q̇) at t = 0 in the turning frame, local dof arrays; None where it is undeformed, or at rest.

    What there is to be said of them is added to the warnings of the run.
    """
    initial = run.scene.initial
    q, rates = _shape(run), None
    if initial.mode is not None:
        shape, rates = of_mode(run, initial.mode)
        q = shape if q is None else q + shape
    if initial.velocity is not None:
        rates = of_velocities(run.system.held, initial.velocity)
    return q, rates


def _shape(run: Simulation) -> Array | None:
    initial, solver = run.scene.initial, run.scene.solver
    if initial.state != "steady":
        run.stability = stability_ahead(with_all(run.system), Newton.of(solver))
        if run.stability is not None and (said := run.stability.warning()):
            run.warnings.append(f"what constant conditions hold in balance: {said}")
    if initial.tip_displacement is not None:
        return static_tip_shape(run.problem, initial.tip_displacement, Newton.of(solver), run.comm)
    if initial.state != "steady":
        return None
    system = run.system
    if run.problem.frame == "inertial":
        system = compile_system(run.problem.replace(frame="rotating"), run.comm, moving=False)
    speed = run.problem.motion.speed(0.0)
    q = steady_state(system, speed, Newton.of(solver), past_limits=solver.past_limits, notes=run.warnings)
    run.stability = stability_of(system, q, speed)
    if said := run.stability.warning():
        run.warnings.append(f"the motion starts from an equilibrium of its own: {said}")
    return q


def of_mode(run: Simulation, number: int) -> tuple[Array, Array]:
    """Return displacements and velocities, Re(a x e^{iφ}) and Re(λ a x e^{iφ}), of a mode x of the initial state.

    Its tip moves by one in the direction in which it moves most.

    Raises:
        InputError: there is no such mode.
    """
    initial, problem = run.scene.initial, run.problem
    speed = problem.motion.speed(0.0)
    analysis = ModalAnalysis(problem.spinning() if speed != 0.0 else problem, initial.state, comm=run.comm)
    analysis.check_count(number)
    spinning = mode_tables(analysis, speed, number).spinning
    if len(spinning.pairs.values) < number:
        raise InputError("initial.mode", number, f"there are {len(spinning.pairs.values)} modes")
    structure, value = run.system.held.structure, spinning.pairs.values[number - 1]
    x = analysis.right(spinning)[:, number - 1]
    whole = np.zeros(len(run.system.held.zeros()), dtype=complex)
    whole[: len(x)] = x
    moves = [i for i, name in enumerate(structure.unknowns) if name.startswith("u")]
    tip = (structure.tip_values(whole.real) + 1j * structure.tip_values(whole.imag))[moves]
    largest = tip[np.argmax(np.abs(tip))]
    if abs(largest) <= STILL * run.system.held.size(np.abs(whole)) * structure.length:
        raise InputError("initial.mode", number, "does not move the tip, which initial.amplitude is of")
    turned = (initial.amplitude or 0.0) / largest * np.exp(1j * initial.phase) * whole
    return turned.real.copy(), (value * turned).real.copy()


def of_velocities(system: Any, rows: Any) -> Array:
    """Return q̇ (local dof array) of a beam whose axis has the velocities of rows (x, v1, v2, v3), linear between.

    Its sections turn with the slope of the axis. What the clamp holds rests.
    """
    structure, table = system.structure, np.array(rows, dtype=float)
    x = structure.V.tabulate_dof_coordinates()[:, 0]
    out = np.zeros((len(x), structure.size))
    slopes = np.diff(table[:, 1:], axis=0) / np.diff(table[:, 0])[:, None]
    piece = np.clip(np.searchsorted(table[:, 0], x, side="right") - 1, 0, len(slopes) - 1)
    turns = {"alpha": (1, 1.0), "theta2": (2, -1.0), "theta3": (1, 1.0)}
    for column, name in zip(out.T, structure.unknowns, strict=True):
        if name.startswith("u"):
            column[:] = np.interp(x, table[:, 0], table[:, int(name[1])])
        elif name in turns:
            component, sign = turns[name]
            column[:] = sign * slopes[piece, component]
    rates: Array = out.ravel()
    rates[structure.clamped_unknowns(structure.clamped)] = 0.0
    return rates
