"""The quadratic eigenproblem of the spinning structure at any speed, and the names of its modes.

Small motions e^{λt} x about an equilibrium q̄ at constant speed satisfy (λ² M + λ C + K) x = 0 with M = ∂F/∂a,
C = ∂F/∂v, K = ∂F/∂q at (q̄, 0, 0).

With the kinetic energy ½ vᵀM v of the whole structure, that of the clamped unknowns included, a mode x of largest entry
1 has the modal mass x^H M x, and of a motion r_i of all points along direction i it has the effective mass

    |r_iᵀ M x|² / x^H M x;

those of all modes that a structure at rest has add up to its mass r_iᵀ M r_i (Clough & Penzien 1993, section 26-4).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from mpi4py import MPI

from rotfem.analysis.equilibrium import steady_state
from rotfem.analysis.mixed_modes import MixedModes
from rotfem.equations.compiled import compile_system
from rotfem.equations.modal_damping import by_family, massed
from rotfem.equations.system import System
from rotfem.errors import ComputationError, InputError
from rotfem.mechanics.problem import Problem
from rotfem.mechanics.work import kinetic_parts
from rotfem.numerics import forms
from rotfem.numerics.eigenproblem import EQUAL_EIGENVALUES, Eigenpairs, Pencil, repeated, separate
from rotfem.numerics.forms import assembled
from rotfem.numerics.newton import Newton
from rotfem.numerics.projection import summed
from rotfem.structures.mode_names import RIGID_BODY, ModeName, Wave, with_overdamped, with_whirl

Array = npt.NDArray[Any]

#: Part of an eigenvalue that its real part must exceed to count as growth.
GROWTH = 1e-6


def product(A: Array, X: Array) -> Array:
    """Return A X of real A and complex X; numpy would make A complex first."""
    return np.asarray((A @ np.ascontiguousarray(X, dtype=complex).view(np.float64)).view(np.complex128))


def participation(analysis: ModalAnalysis, spinning: Spinning) -> tuple[list[dict[str, float]], dict[str, float]]:
    """Return modal and effective masses of every mode, and the mass that there is.

    Args:
        analysis: compiled problem.
        spinning: equilibrium and eigenpairs at one speed.

    Returns:
        Rows of `modal_mass` (kg, where the largest entry of the shape is a displacement, kg·m² where it is a rotation)
        and `effective_mass_1`, … (kg) along the directions of the frame in which the structure moves; and the mass
        (kg) by the same names of directions.
    """
    system, names = analysis.system, list(analysis.structure.unknowns)
    owned = system.V.dofmap.index_map.size_local * len(names)
    energy = kinetic_parts(system.model.mechanics)["T2"]()
    momentum = forms.form(ufl.derivative(energy, system.v, system.structure.k.dq))

    def mass_times(v: Array) -> Array:
        """Return M v, the clamped unknowns included."""
        system.v.x.array[:owned] = v
        system.v.x.scatter_forward()
        return np.array(assembled(momentum, system.V, []).array)

    along = {f"effective_mass_{i + 1}": np.zeros(owned) for i in range(3) if f"u{i + 1}" in names}
    for name, r in along.items():
        r[names.index(f"u{name[-1]}") :: len(names)] = 1.0
    system.set_state(spinning.q[: len(system.q.x.array)])
    momenta = {name: mass_times(r) for name, r in along.items()}
    rows = []
    for x in spinning.right[:owned].T:
        shape = x / max(analysis.comm.allgather(complex(x[np.argmax(np.abs(x))]) if x.size else 0.0j), key=abs)
        mass = sum(float(summed(analysis.comm, part @ mass_times(part))) for part in (shape.real, shape.imag))
        sizes = {name: abs(summed(analysis.comm, p @ shape)) ** 2 for name, p in momenta.items()}
        rows.append({"modal_mass": mass, **{name: float(size / mass) for name, size in sizes.items()}})
    system.set_state(spinning.q[: len(system.q.x.array)])
    return rows, {name: float(summed(analysis.comm, r @ momenta[name])) for name, r in along.items()}


def self_checks(spinning: Spinning) -> dict[str, float]:
    """Return how far M and K are from symmetric and C from skew, relative: 0 without damping and follower loads."""
    return {f"asymmetry_{name}": value for name, value in spinning.pencil.asymmetries.items()}


@dataclass
class Spinning:
    """The structure at one speed: its equilibrium, pencil and eigenpairs.

    Attributes:
        analysis: of it.
        speed: Ω, rad/s.
        q: equilibrium, local dof array.
        pencil: M, C, K there.
        pairs: eigenpairs, sorted by |λ|, one of each conjugate pair.
        clamped: M, C, K without the hub's unknown (the same pencil where the hub is not free).
        rigid: whether hub and structure can turn as a rigid body (λ = 0, not among the pairs).
        reference: what the rotations of the equilibrium are counted from; None for the undeformed structure.
        lift: basis V that the vectors are coordinates in, and M V; None where they are those of the unknowns.
    """

    analysis: ModalAnalysis
    speed: float
    q: Array
    pencil: Pencil
    pairs: Eigenpairs
    clamped: Pencil
    rigid: bool = False
    reference: Any = None
    lift: tuple[Array, Array] | None = None

    def lifted(self, vectors: Array) -> Array:
        """Return vectors of the pairs as those of the locally owned unknowns, one column each."""
        return vectors if self.lift is None else product(self.lift[0], vectors)

    @property
    def right(self) -> Array:
        """Right vectors of the locally owned unknowns."""
        return self.lifted(self.pairs.right)

    @property
    def mass_right(self) -> Array:
        """M times the right vectors."""
        if self.lift is None:
            return self.pencil.apply(self.pencil.M, self.pairs.right)
        return product(self.lift[1], self.pairs.right)

    @cached_property
    def nonzero(self) -> Array:
        """λ of the pairs; of those that are zero to round-off i times the least that is not, for a norm."""
        lam = self.pairs.resolved
        least = np.min(np.abs(lam[lam != 0.0]), initial=np.max(np.abs(lam), initial=1.0))
        return np.where(lam == 0.0, 1j * least, lam)

    @cached_property
    def own(self) -> Array:
        """y_i^H [(λ_i + λ_j) M + C] x_j of the pairs, with the `nonzero` λ."""
        return self.pencil.gram(self.pairs.left, self.nonzero, self.pairs.right, self.nonzero)

    def first(self, count: int) -> Spinning:
        """Return it with its first modes alone."""
        out = replace(self, pairs=self.pairs.select(np.arange(min(count, len(self.pairs.values)))))
        if "waves" in self.__dict__:
            out.waves = self.waves[:count]
        return out

    @cached_property
    def _energies(self) -> Array:
        """Share of every unknown of a node, and of the hub, in the kinetic energy x^H M x, (unknowns + 1, modes)."""
        names, X, MX = self.analysis.structure.unknowns, self.right, self.mass_right
        shape = (self.analysis.structure.V.dofmap.index_map.size_local, len(names), X.shape[1])
        owned = shape[0] * shape[1]
        x, mx = (self.analysis.structure.oriented(Y[:owned].reshape(shape)) for Y in (X, MX))
        hub = np.real(np.sum(X[owned:].conj() * MX[owned:], axis=0))  # on the last rank
        energies = summed(self.analysis.comm, np.vstack([np.real(np.sum(x.conj() * mx, axis=0)), hub]))
        return np.asarray(energies / energies.sum(axis=0))

    @cached_property
    def shares(self) -> dict[str, Array]:
        """Family ↦ share of the kinetic energy x^H M x in its components, (m,); of a free hub that of the hub too."""
        shares = {
            name: self._energies[list(i)].sum(axis=0) for name, (i, _) in self.analysis.structure.families.items()
        }
        return shares | ({"hub": self._energies[-1]} if self.analysis.free else {})

    @property
    def rotary(self) -> Array:
        """Share of the rotations of the nodes in the kinetic energy of every mode, (m,)."""
        turns = [i for i, name in enumerate(self.analysis.structure.unknowns) if not name.startswith("u")]
        return np.asarray(self._energies[turns].sum(axis=0))

    @cached_property
    def waves(self) -> list[Wave]:
        """How every mode of a shaft or a disk precesses; empty for other structures.

        The sense of the spin counts, without spin that of its axis.
        """
        axis = self.analysis.system.motion.axis * (-1.0 if self.speed < 0.0 else 1.0)
        nodes = [self.analysis.structure.nodes(x) for x in self.right.T]
        shapes = np.array([values for _, values in nodes])
        found = self.analysis.structure.waves(nodes[0][0], shapes, axis) if nodes else []
        return [replace(wave, fixed=self.analysis.fixed) for wave in found]

    @cached_property
    def names(self) -> list[ModeName]:
        """The name of every mode, as its structure counts them; mixed ones name both families, rotors the direction.

        One that nothing holds, zero to round-off, is "rigid body".
        """
        families, structure = [name for name in self.shares if name != "hub"], self.analysis.structure
        out, shapes = [], [structure.nodes(x) for x in self.right.T]
        for j, shape in enumerate(shapes):
            first, *others = sorted(families, key=lambda name: -self.shares[name][j])
            name, mixed = structure.mode_name(first, *shape), others and self.shares[first][j] < 0.8
            out.append(name.mixed_with(structure.words.get(others[0], others[0])) if mixed else name)
        pencil, pairs, speed = self.pencil, self.pairs, self.speed
        if pencil.damped and np.any(pairs.values.imag == 0.0):
            local = [np.sum(pairs.right.conj() * pencil.apply(A, pairs.right), axis=0) for A in (pencil.M, pencil.K)]
            sure = (pairs.bounds < 1.0) & pencil.stiff(pairs.right)
            out = with_overdamped(out, pairs.values, tuple(summed(pencil.comm, np.array(local))), sure)
        out = with_whirl(out, self.waves, pairs.values.imag, abs(speed)) if self.waves else out
        for j in np.flatnonzero(pairs.bounds >= 1.0):
            out[j] = RIGID_BODY if structure.is_rigid(*shapes[j]) else out[j]
        return out


def correlation(a: Spinning, b: Spinning, conjugate: bool = False) -> tuple[Array, Array]:
    """Return the squared correlations of the modes at two speeds, shape (m_a, m_b): 1 for equal modes, 0 for different.

    With `conjugate` they are those of the modes at a with the modes of λ̄ at b: real matrices have both.

    That of two modes is |y_i^H [(λ_i + μ_j) M + C] x_j|², scaled. Both pencils serve in turn and the mean is taken, so
    the two speeds are treated alike. The second array is this. In the first, modes with one frequency are not
    distinguished, for any combination of them is a mode too: what counts is how much of the other is in their span,
    the trace of the product of both projections by the smaller dimension.
    """
    ya, yb, xa, xb = a.pairs.left, b.pairs.left, a.pairs.right, b.pairs.right
    la, lb = a.nonzero, b.nonzero
    if conjugate:
        yb, xb, lb = yb.conj(), xb.conj(), lb.conj()
    here, there = a.pencil.gram(ya, la, xb, lb), b.pencil.gram(yb, lb, xa, la)
    own_a, own_b = a.own, b.own.conj() if conjugate else b.own
    # The two products cancel the unknown scaling of x_b and y_b against each other.
    scale = np.outer(*(np.maximum(np.abs(np.diag(own)), 1e-300) for own in (own_a, own_b)))
    single = np.abs(here) * np.abs(there.T) / scale
    groups = [repeated(lam, s.pairs.bounds) for lam, s in ((la, a), (lb, b))]
    inverses = [np.diag(1.0 / np.where(d := own.diagonal(), d, np.inf)) for own in (own_a, own_b)]
    for inverse, own, parts in zip(inverses, (own_a, own_b), groups, strict=True):
        for i in (part for part in parts if len(part) > 1):
            inverse[np.ix_(i, i)] = np.linalg.pinv(own[np.ix_(i, i)])
    traces = (inverses[0] @ here @ inverses[1]) * there.T
    firsts, sizes = ([[i[0] for i in parts] for parts in groups], [[len(i) for i in parts] for parts in groups])
    sums = np.add.reduceat(np.add.reduceat(traces, firsts[0], axis=0), firsts[1], axis=1)
    joint = np.abs(sums) / np.minimum.outer(*map(np.array, sizes))
    return joint.repeat(sizes[0], axis=0).repeat(sizes[1], axis=1), single


class ModalAnalysis:
    """Compiled once, solved at any speed.

    Args:
        problem: what is to be computed; its own speed is only a default.
        about: the state that modes are about: "steady" or "undeformed".
        newton: iteration control of the equilibria.
        comm: MPI communicator.
        system: the equations of the problem where they are compiled already.

    Raises:
        InputError: the mesh cannot be shared by the processes, or a mesh or section that cannot be computed with.

    Attributes:
        everyone: all processes that have this analysis, which may be more than share its mesh, `comm`.
        free: whether the hub is free, so that its angle is one more unknown.
        notes: remarks on the way to equilibria.
        mixed: the same modes with the stiff strains as unknowns.
    """

    def __init__(
        self,
        problem: Problem,
        about: str = "steady",
        newton: Newton | None = None,
        comm: MPI.Comm = MPI.COMM_WORLD,
        system: System | None = None,
    ):
        started = perf_counter()
        #: Whether modes are those in the fixed frame.
        self.fixed = problem.frame == "fixed"
        self.problem = problem.turning()
        self.about, self.comm = about, comm
        self.system = compile_system(self.problem, comm, moving=False) if system is None else system
        self.model, self.structure = self.system.model, self.system.structure
        self.structure.check_shared()  # SLEPc waits for ever where a process has no unknowns
        self.free = self.system.hub is not None
        self.newton, self.everyone = newton or Newton(), comm
        self._unit: float | None = None
        self._overdamped = 0 if self.fixed else None
        self.mixed = MixedModes(self.system)
        self.notes = list[str]()
        assembled = self.system.assembled
        self.seconds = {"compile": perf_counter() - started - assembled, "assemble": assembled}
        self.seconds |= {"equilibrium": 0.0, "factor": 0.0, "eigen": 0.0}

    def check_count(self, count: int, key: str = "modes.count") -> None:
        """Refuse more modes than there are unknowns, which a key of the scene asks for.

        Raises:
            InputError: says how many there are.
        """
        allowed = self.structure.free_unknowns() + int(self.free)
        if count > allowed:
            why = f"must be at most {allowed}, the number of unknowns that are free on this mesh"
            raise InputError(key, count, why)

    def at(self, speed: float, count: int, start: Spinning | None = None, keep: bool = True) -> Spinning:
        """Return equilibrium and eigenpairs at a speed (rad/s).

        Args:
            speed: Ω, rad/s.
            count: number of pairs, at least.
            start: the structure at a speed nearby, whose equilibrium to continue from.
            keep: whether the pencil must outlast another call; large systems save memory, and keep a factor, without.

        Raises:
            ComputationError: no equilibrium, or eigenpairs not to be trusted.
        """
        t0 = perf_counter()
        q = self.equilibrium(speed, start)
        t1 = perf_counter()
        pencil, clamped = self.pencils(speed, q, keep)
        t2 = perf_counter()
        if massed(clamped.M) == 0:
            raise ComputationError(
                "the structure has no mass, and so no modes", advice="rho, mass_per_length or masses"
            )
        pencil.sizes = self.stiffness_sizes(pencil.K)
        if not self.free:
            pencil.factor = self.system.analysed
        pairs = pencil.first(count, clamped.scale() if self.free else 0.0)
        self._unit, self._overdamped = pencil.unit, pencil.overdamped
        if not self.free:
            pairs = self.mixed.better(pencil, pairs, count)
        slowest = int(np.argmin(np.abs(pairs.values)))
        rigid = self.free and pairs.bounds[slowest] >= 1.0
        flexible = np.delete(np.arange(len(pairs.values)), [slowest] if rigid else [])
        pairs = pairs.select(flexible[: massed(clamped.M)])
        found = Spinning(self, speed, q, pencil, pairs, clamped, rigid, self.system.reference)
        self.separate(found)
        if any(support.of_frequency for support in getattr(self.problem.structure, "supports", ())):
            self._at_own_frequencies(found)
        for vectors in (pairs.right, pairs.left):
            vectors[self.system.clamped] = 0.0  # round-off of the scaled problem is none in the units of the scene
        t3 = perf_counter()
        spans = {"equilibrium": t1 - t0, "assemble": t2 - t1, "factor": pencil.factored, "eigen": t3 - t2}
        for name, span in spans.items():
            self.seconds[name] += span
        self.seconds["eigen"] -= pencil.factored
        if not self.free:
            self.system.analysed = pencil.factor
        if keep:
            pencil.factor = None
        return found

    def restored(self, speed: float, q: Array, pairs: Eigenpairs, rigid: bool, reference: Any = None) -> Spinning:
        """Return what `at` has found before, of its parts."""
        self.system.count_rotations_from(reference)
        pencil, clamped = self.pencils(speed, q)
        return Spinning(self, speed, q, pencil, pairs, clamped, rigid, reference)

    def _at_own_frequencies(self, spinning: Spinning) -> None:
        """Solve every mode again with the supports as they are at its own frequency of whirl, in place.

        From the frequency of the mode before to 1e-9, or ten times; the mode is the one that is most like it.
        """
        frame, pairs, count = self.model.frame, spinning.pairs, len(spinning.pairs.values)
        names = ("values", "right", "left", "errors", "bounds")
        for j in range(count):
            last = replace(spinning, pairs=pairs.select(np.array([j])))
            for _ in range(10):
                lam = last.pairs.values[0]
                frame.whirl = abs(float(lam.imag))
                pencil, clamped = self.pencils(spinning.speed, spinning.q)
                found = replace(spinning, pencil=pencil, clamped=clamped, pairs=pencil.solve(count))
                self.separate(found)
                i = np.argmax(correlation(last, found)[1], axis=1)
                last = replace(found, pairs=found.pairs.select(i))
                if abs(last.pairs.values[0] - lam) <= 1e-9 * abs(lam):
                    break
            for name in names:
                getattr(pairs, name)[..., j] = getattr(last.pairs, name)[..., 0]
        frame.whirl = None
        order = np.argsort(np.abs(pairs.values), kind="stable")
        for name in names:
            getattr(pairs, name)[...] = getattr(pairs, name)[..., order]

    def separate(self, spinning: Spinning) -> None:
        """Choose the shapes of modes of one frequency, in place: of one family each, or forward and backward whirl.

        Whirl is an eigenvector of a turn about the axis, J u = e₁×u; i J is Hermitian.
        """

        def by_turn(X: Array, MX: Array) -> Array:
            names, shape = list(self.structure.unknowns), (-1, len(self.structure.unknowns), X.shape[1])
            x, mx = X.reshape(shape), MX.reshape(shape).conj()
            pairs = [(names.index(f"{kind}2"), names.index(f"{kind}3")) for kind in ("u", "theta")]
            out = sum(mx[:, j].T @ x[:, i] - mx[:, i].T @ x[:, j] for i, j in pairs)
            return np.asarray(1j * summed(self.comm, out))

        whirls = self.fixed and self.problem.motion.is_spinning
        tell = by_turn if whirls else partial(by_family, self.structure)
        separate(spinning.pencil, spinning.pairs, (spinning.right, spinning.lifted(spinning.pairs.left)), tell)

    def pencils(self, speed: float, q: Array, keep: bool = True) -> tuple[Pencil, Pencil]:
        """Return the pencil about a state q (local dof array) at a speed (rad/s), and the same with the hub held."""
        self.system.set_time(0.0, self.system.motion.at_speed(speed))
        self.system.set_state(q)
        matrices = self.system.mass_damping_stiffness(keep)
        clamped = Pencil(*matrices)
        pencil = Pencil(*self.system.with_hub(matrices)) if self.free else clamped
        clamped.unit = pencil.unit = self._unit
        pencil.overdamped = self._overdamped
        # A PETSc matrix must not outlive the mesh it was made on: their communicator goes with the mesh.
        clamped.owner = pencil.owner = self
        return pencil, clamped

    def stiffness_sizes(self, K: Any) -> Array | None:
        """Return √ of what the entries of K are sums of, for each owned unknown; None where the diagonal says it.

        In a deformed state all displacements of a node have a part of the axial stiffness in their entries, or of the
        force it makes of a strain that is the difference of far larger numbers.
        """
        if self.system.linear:
            return None
        sizes = np.sqrt(np.abs(K.getDiagonal().array))
        moves = np.array([name.startswith("u") for name in self.structure.unknowns])
        owned = self.system.V.dofmap.index_map.size_local * len(moves)
        nodes = sizes[:owned].reshape(-1, len(moves))
        nodes[:, moves] = nodes[:, moves].max(axis=1, keepdims=True)
        return np.asarray(sizes)

    def needs_fixed_hub(self, what: str) -> None:
        """Refuse what is not there for a free hub."""
        if self.free:
            raise InputError("motion.type", "torque", f"{what} cannot be computed for a free hub yet")

    def equilibrium(self, speed: float, start: Spinning | None = None) -> Array:
        """Return the state the modes are about, left in the system's functions: steady, or undeformed."""
        s = self.system
        if self.about == "undeformed" or s.linear:
            s.set_time(0.0, s.motion.at_speed(speed))
            s.set_state(zero := s.zeros())
            return np.asarray(zero)
        if start is not None:
            s.count_rotations_from(start.reference)
        first = None if start is None else start.q
        return steady_state(s, speed, self.newton, first, self.notes)


def stability(lam: complex, bound: float = 0.0) -> str:
    """Return "stable", "static instability" (real growth), "dynamic instability" (growing oscillation) or "unresolved".

    Args:
        lam: eigenvalue, 1/s.
        bound: how far it can be off, relative to its size; growth within it is none, and where it is all of the
            eigenvalue nothing is known.
    """
    if bound >= 1.0:
        return "unresolved"
    if lam.real <= max(GROWTH, bound) * abs(lam):
        return "stable"
    return "static instability" if lam.imag <= EQUAL_EIGENVALUES * abs(lam) else "dynamic instability"
