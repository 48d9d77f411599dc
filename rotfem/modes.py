"""`rotfem modes`: gyroscopic eigenmodes of the spinning structure, named and checked.

Small motions e^{λt} x about an equilibrium q̄ at constant speed satisfy (λ² M + λ C + K) x = 0 with M = ∂F/∂a,
C = ∂F/∂v, K = ∂F/∂q at (q̄, 0, 0).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.advice import Hint, advise, silent
from rotfem.affine import AffineSystem
from rotfem.choice import choose
from rotfem.equilibrium import check_steady, critical_speed, newton_for, steady_state
from rotfem.errors import SceneError
from rotfem.fields import writer
from rotfem.hub import Hub
from rotfem.outputs import MODES
from rotfem.pencil import SAME, ZERO, Eigenpairs, Pencil
from rotfem.results import ModesResult
from rotfem.scene import Scene, TorqueMotion
from rotfem.simulation import as_scene, versions
from rotfem.solvers import Newton
from rotfem.system import Model, System, compile_system

Array = npt.NDArray[Any]

#: Share of kinetic energy from which a mode belongs to one family; below it is named as mixed.
PURE = 0.8

#: Part of the least eigenvalue a real part must exceed to count as growth.
GROWTH = 1e-6


@dataclass
class Spinning:
    """The structure at one speed: its equilibrium, pencil and eigenpairs.

    Attributes:
        speed: Ω, rad/s.
        q: equilibrium, local dof array.
        pencil: M, C, K there.
        pairs: eigenpairs, sorted by |λ|, one of each conjugate pair.
        clamped: M, C, K without the hub's unknown (the same pencil where the hub is not free).
        rigid: whether hub and structure can turn as a rigid body (λ = 0, not among the pairs).
    """

    speed: float
    q: Array
    pencil: Pencil
    pairs: Eigenpairs
    clamped: Pencil
    rigid: bool = False


class ModalAnalysis:
    """Compiled once, solved at any speed.

    Args:
        scene: validated scene; its own speed is only a default.
        comm: MPI communicator.
    """

    def __init__(self, scene: Scene, comm: MPI.Comm = MPI.COMM_WORLD, sweep: bool = False):
        started = perf_counter()
        rotating = scene.replace({"model.frame": "rotating"}) if scene.model.frame == "inertial" else scene
        self.scene, self.comm = rotating, comm
        self.model = Model(rotating, comm, rotating.effective_effects(spinning=True) if sweep else None)
        self.system: System = compile_system(self.model)
        motion = rotating.motion
        coupled = "hub_coupling" in self.model.effects
        self.hub = Hub(self.system, motion, coupled) if isinstance(motion, TorqueMotion) else None
        self.newton: Newton = newton_for(rotating)
        assembled = self.system.assembled
        self.seconds = {"compile": perf_counter() - started - assembled, "assemble": assembled}
        self.seconds |= {"equilibrium": 0.0, "factor": 0.0, "eigen": 0.0}

    def advise(self, command: str, hint: Hint | None, speed: float) -> list[str]:
        """Return hints about the computation ahead, up to a speed (rad/s), and hand them on."""
        critical = None
        if hint is not None and isinstance(self.system, AffineSystem) and self.scene.model.theory == "linear":
            critical = critical_speed(self.system)
        return advise(self.scene, command, hint, speed, critical)

    def at(self, speed: float, count: int, start: Array | None = None, keep: bool = True) -> Spinning:
        """Return equilibrium and eigenpairs at a speed (rad/s).

        Args:
            speed: Ω, rad/s.
            count: number of pairs, at least.
            start: an equilibrium nearby, to continue from.
            keep: whether the pencil must outlast another call; large systems save memory without.

        Raises:
            ComputationError: no equilibrium, or eigenpairs not to be trusted.
        """
        t0 = perf_counter()
        q = self.equilibrium(speed, start)
        t1 = perf_counter()
        matrices = self.system.mass_damping_stiffness(keep)
        clamped = Pencil(*matrices)
        pencil = clamped if self.hub is None else Pencil(*self.hub.bordered(*matrices))
        t2 = perf_counter()
        pairs = pencil.solve(count, clamped.scale() if self.hub is not None else 0.0)
        t3 = perf_counter()
        factored = pencil.factored
        spans = {"equilibrium": t1 - t0, "assemble": t2 - t1, "factor": factored, "eigen": t3 - t2 - factored}
        for name, span in spans.items():
            self.seconds[name] += span
        # A PETSc matrix must not outlive the mesh it was made on: their communicator goes with the mesh.
        clamped.owner = pencil.owner = self
        if self.hub is None:
            return Spinning(speed, q, pencil, pairs, clamped)
        flexible = np.flatnonzero(np.abs(pairs.values) > ZERO * np.median(np.abs(pairs.values)))
        return Spinning(speed, q, pencil, pairs.select(flexible), clamped, rigid=len(flexible) < len(pairs.values))

    def needs_fixed_hub(self, what: str) -> None:
        """Refuse what is not there for a free hub.

        Raises:
            SceneError: the hub is free.
        """
        if self.hub is not None:
            raise SceneError(self.scene.file, "motion.type", "torque", f"{what} cannot be computed for a free hub yet")

    def equilibrium(self, speed: float, start: Array | None = None) -> Array:
        """Return the state the modes are about, left in the system's functions: steady, or undeformed."""
        s = self.system
        zero = np.zeros_like(s.q.x.array)
        if self.scene.modes.about == "undeformed" or s.linear:
            s.set_time(0.0, s.motion.at_speed(speed))
            s.set_state(zero, zero, zero)
            return zero
        return steady_state(s, speed, self.newton, start)

    def right(self, spinning: Spinning) -> Array:
        """Return the eigenvectors of the locally owned unknowns, one column each."""
        return spinning.pairs.right

    def mass_times(self, spinning: Spinning) -> Array:
        """Return M times the eigenvectors."""
        return spinning.pencil.apply(spinning.pencil.M, spinning.pairs.right)

    # --- names ------------------------------------------------------------------------------------------------------

    def shares(self, spinning: Spinning) -> dict[str, Array]:
        """Return family ↦ share of the kinetic energy x^H M x in its components, shape (m,)."""
        X, MX = self.right(spinning), self.mass_times(spinning)
        bs = self.system.V.dofmap.index_map_bs
        owned = self.system.V.dofmap.index_map.size_local * bs
        along = [self.model.structure.oriented(Y[:owned].reshape(-1, bs, X.shape[1])) for Y in (X, MX)]
        local = np.real(along[0].conj() * along[1]).sum(axis=0)
        hub = np.real(X[owned:].conj() * MX[owned:]).sum(axis=0, keepdims=True)  # on the last rank, if it is free
        energy = np.concatenate([local, hub])
        energy = self.comm.allreduce(energy) if self.comm.size > 1 else energy
        total = energy.sum(axis=0)
        families = self.model.structure.families
        shares = {name: energy[list(components)].sum(axis=0) / total for name, (components, _) in families.items()}
        return shares if self.hub is None else {**shares, "hub": energy[-1] / total}

    def names(self, spinning: Spinning) -> list[str]:
        """Return "kind n" for every mode, as its structure counts them; mixed ones name both families."""
        shares, structure = self.shares(spinning), self.model.structure
        families = [name for name in shares if name != "hub"]
        table, right = np.array([shares[name] for name in families]), self.right(spinning)
        out = []
        for j in range(table.shape[1]):
            order = np.argsort(-table[:, j])
            kind, number = structure.mode_name(families[order[0]], *self.shape(right[:, j]))
            mixed = len(order) > 1 and table[order[0], j] < PURE
            out.append(f"{kind}–{families[order[1]]} {number}" if mixed else f"{kind} {number}")
        return out

    def shape(self, x: Array) -> tuple[dict[str, Array], Array]:
        """Return (coordinates of the nodes, m; complex components (n, bs) of a mode), on every rank."""
        coordinates, real = self.model.structure.nodes(x.real)
        _, imaginary = self.model.structure.nodes(x.imag)
        return coordinates, real + 1j * imaginary


def modes(
    scene: Scene | str | Path | Mapping[str, Any],
    comm: MPI.Comm = MPI.COMM_WORLD,
    sensitivities: bool = False,
    hint: Hint | None = silent,
) -> ModesResult:
    """Return the modes of a scene at its final speed: that of a spin-up, at the end of [time], or the constant one.

    Args:
        scene: scene, path of a scene file, or nested tables.
        comm: MPI communicator; every rank gets the whole result.
        sensitivities: also compute the derivatives of all eigenvalues to the scene's parameters.
        hint: called with every line of advice before the computation starts; None asks for none.

    Raises:
        SceneError: the scene is not valid, or has no steady state.
        ComputationError: no equilibrium, or eigenpairs that fail the check of their backward error.
    """
    started = perf_counter()
    scene = as_scene(scene)
    if scene.modes.about == "steady":
        check_steady(scene)
    asked, choice = scene, None
    if scene.model.tolerance is not None:
        choice = choose(scene, (MODES,), comm=comm)
        scene = choice.apply(scene)
    analysis = ModalAnalysis(scene, comm)
    speed = final_speed(analysis)
    hints = analysis.advise("modes", hint, speed)
    spinning = analysis.at(speed, scene.modes.count, keep=False)
    flexible = scene.modes.count - int(spinning.rigid)
    spinning.pairs = spinning.pairs.select(np.arange(min(flexible, len(spinning.pairs.values))))
    rows = mode_rows(analysis, spinning)
    checks = self_checks(analysis, spinning)
    warnings = [] if choice is not None else advice(analysis, speed)
    warnings += [*unstiffened(analysis, speed, rows), *instabilities(rows)]
    rows = [{**row, "mode": row["mode"] + spinning.rigid} for row in rows]
    shapes = {f"mode {row['mode']}: {row['label']}": scaled_shape(analysis, spinning, i) for i, row in enumerate(rows)}
    if spinning.rigid:
        rows = [rigid_row(rows), *rows]
    total = perf_counter() - started
    summary: dict[str, Any] = {
        "command": "modes",
        "status": "done",
        "name": scene.name,
        "theory": scene.model.theory,
        "about": "undeformed" if analysis.system.linear else scene.modes.about,
        "speed": speed,
        "effects": list(analysis.model.effects),
        "dofs": analysis.system.V.dofmap.index_map.size_global * analysis.system.V.dofmap.index_map_bs,
        "modes": rows,
        "checks": checks,
        "warnings": warnings,
        "advice": hints,
        "timings": {**analysis.seconds, "other": total - sum(analysis.seconds.values()), "total": total},
        "versions": versions(),
        "ranks": comm.size,
        "scene": asked.to_dict(),
    }
    if choice is not None:
        summary["choice"] = choice.summary()
    structure, right = analysis.model.structure, spinning.pairs.right
    result = ModesResult(summary, rows, shapes, triangles=structure.surface(), analysis=analysis, spinning=spinning)
    if result.triangles is not None:
        first = 1 + int(spinning.rigid)
        states = [(float(first + i), scaled(comm, right[:, i])) for i in range(right.shape[1])]
        result.fields = writer(analysis.system.V, "modes", states)
    if sensitivities:
        from rotfem.sensitivity import sensitivities as derivatives

        result.sensitivities = derivatives(analysis, spinning)
    return result


def final_speed(analysis: ModalAnalysis) -> float:
    """Return the speed of the modes: at the end of the motion where the scene has one, constant otherwise (rad/s)."""
    scene = analysis.scene
    if scene.motion.type == "spin_up":
        return float(scene.motion.speed)
    return analysis.model.motion.speed(scene.time.end if scene.time is not None else 0.0)


def mode_rows(analysis: ModalAnalysis, spinning: Spinning) -> list[dict[str, Any]]:
    """Return one row a mode: frequency (rad/s, Hz), damping ratio, growth (1/s), label, shares, backward error."""
    shares, names = analysis.shares(spinning), analysis.names(spinning)
    rows = []
    for i, (lam, error) in enumerate(zip(spinning.pairs.values, spinning.pairs.errors, strict=True)):
        size = abs(lam)
        rows.append(
            {
                "mode": i + 1,
                "label": names[i],
                "frequency": float(lam.imag),
                "frequency_hz": float(lam.imag / (2 * np.pi)),
                "damping": float(-lam.real / size) if size > 0 else 0.0,
                "growth": float(lam.real),
                "stability": stability(lam),
                **{f"share_{name}": float(share[i]) for name, share in shares.items()},
                "residual": float(error),
            }
        )
    return rows


def rigid_row(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the row of the rigid-body mode: hub and structure turn together, λ = 0."""
    row = {name: 0.0 for name in (rows[0] if rows else ())}
    return {**row, "mode": 1, "label": "rigid body", "stability": "neutral", "share_hub": 1.0}


def stability(lam: complex) -> str:
    """Return "stable", "static instability" (real growth) or "dynamic instability" (growing oscillation)."""
    if lam.real <= GROWTH * abs(lam):
        return "stable"
    return "static instability" if lam.imag <= SAME * abs(lam) else "dynamic instability"


def instabilities(rows: list[dict[str, Any]]) -> list[str]:
    """Return a warning for every unstable mode."""
    return [
        f"{row['stability']}: {row['label']} grows as exp({row['growth']:.6g} t)"
        for row in rows
        if row["stability"] not in ("stable", "neutral")
    ]


def advice(analysis: ModalAnalysis, speed: float) -> list[str]:
    """Return warnings about the model: a rotating-frame frequency without Coriolis forces is not one."""
    if speed != 0.0 and "coriolis" not in analysis.model.effects:
        return [
            "coriolis is not among model.effects: frequencies in the rotating frame are wrong without it, and ω² can "
            "come out negative"
        ]
    return []


def unstiffened(analysis: ModalAnalysis, speed: float, rows: list[dict[str, Any]]) -> list[str]:
    """Return a warning if modes are among the rows whose stiffening by the spin the theory does not hold."""
    families, theory = analysis.model.structure.unstiffened, analysis.scene.model.theory
    found = sorted({row["label"] for row in rows for f in families if row.get(f"share_{f}", 0.0) > PURE})
    if speed == 0.0 or theory == "reissner" or not found:
        return []
    return [
        f"{', '.join(found)}: the strains of {theory} for this structure leave out the stiffening of such modes by the "
        'spin, so their frequencies are too low; model.theory = "reissner" has it'
    ]


def self_checks(analysis: ModalAnalysis, spinning: Spinning) -> dict[str, float]:
    """Return how far symmetry, the spectrum and the linearisation are from what theory says (all relative).

    M and K symmetric and C skew without damping and follower loads; then −λ̄ is an eigenvalue with λ. The tangents are
    compared with central differences of the residual.
    """
    out = {f"asymmetry_{name}": value for name, value in spinning.pencil.asymmetries().items()}
    if spinning.pencil.spectrum_error is not None:
        out["spectrum"] = spinning.pencil.spectrum_error
    out["linearisation"] = linearisation_error(analysis, spinning)
    return out


def linearisation_error(analysis: ModalAnalysis, spinning: Spinning) -> float:
    """Return the relative difference between M, C, K times a vector and central differences of the residual."""
    system, pencil = analysis.system, spinning.clamped
    if isinstance(system, AffineSystem):
        return 0.0  # the residual is made of these very matrices
    zero = np.zeros_like(spinning.q)
    # A direction without structure: for a mode, K x is what is left when large axial terms cancel.
    system.q.x.array[:] = np.random.default_rng(1).standard_normal(zero.size) * system.scale
    system.q.x.scatter_forward()
    direction = system.q.x.array.copy()
    system.set_time(0.0, system.motion.at_speed(spinning.speed))
    worst, step = 0.0, 1e-7

    def residual(q: Array, v: Array, a: Array) -> Array:
        system.set_state(q, v, a)
        return -system.residual().array.copy()

    owned = system.V.dofmap.index_map.size_local * system.V.dofmap.index_map_bs
    direction[system.clamped] = 0.0
    for A, slot in ((pencil.K, 0), (pencil.C, 1), (pencil.M, 2)):
        plus, minus = [spinning.q, zero, zero], [spinning.q, zero, zero]
        plus[slot], minus[slot] = plus[slot] + step * direction, minus[slot] - step * direction
        difference = (residual(*plus) - residual(*minus)) / (2 * step)
        exact = pencil.apply(A, direction[:owned, None].astype(complex))[:, 0].real
        exact[system.clamped] = 0.0
        sums = np.array([np.sum((difference - exact) ** 2), np.sum(exact**2)])
        error, size = analysis.comm.allreduce(sums)
        worst = max(worst, float(np.sqrt(error / size)) if size > 0 else 0.0)
    system.set_state(spinning.q, zero, zero)
    return worst


def scaled(comm: MPI.Comm, x: Array) -> Array:
    """Return an eigenvector (owned unknowns) whose largest entry, over all ranks, is 1."""
    largest = x[np.argmax(np.abs(x))] if x.size else 0.0
    return np.asarray(x / max(comm.allgather(complex(largest)), key=abs))


def scaled_shape(analysis: ModalAnalysis, spinning: Spinning, i: int) -> dict[str, Array]:
    """Return a mode shape along the structure: x (m) and the real and imaginary part of each component, largest 1."""
    coordinates, values = analysis.shape(spinning.pairs.right[:, i])
    peak = values.ravel()[np.argmax(np.abs(values))]
    values = values / peak
    columns: dict[str, Array] = dict(coordinates)
    for c, name in enumerate(analysis.model.structure.components):
        columns[name], columns[f"{name}_imag"] = values[:, c].real, values[:, c].imag
    return columns
