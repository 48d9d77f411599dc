"""The residual of a problem as named terms, before anything is compiled."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from functools import cached_property
from itertools import combinations_with_replacement
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI

from rotfem.errors import InputError
from rotfem.mechanics import work
from rotfem.mechanics.bodies import Strain
from rotfem.mechanics.effects import INERTIA, INTERNAL, LOADS, Effect
from rotfem.mechanics.motion import Motion
from rotfem.mechanics.problem import Problem
from rotfem.mechanics.unbalance import Unbalance
from rotfem.mechanics.work import Frame, Mechanics, RigidTurn, Variation
from rotfem.numerics import forms
from rotfem.numerics.forms import added
from rotfem.registry import resolved, structures
from rotfem.structures.structure import Array, Structure
from rotfem.users_functions import called, of_unknowns

#: Name ↦ constants of each integral of a form, and name ↦ compiled form.
Both = tuple[dict[str, Any], dict[str, Any]]

#: Purpose and signature of a residual ↦ the forms that follow from it without their mesh; the latest ones.
_KNOWN: dict[tuple[str, str], dict[str, Any]] = {}


class HubAngle:
    """psi, psi' and psi'' of a free hub, and the motion of the frame that they make.

    Attributes:
        values: psi (rad), psi' (rad/s), psi'' (rad/s²).
        hub: inertia, torque, brake.
        motion: of the frame, read from the values.
    """

    def __init__(self, motion: Motion):
        assert motion.hub is not None
        self.hub = motion.hub
        self.values: npt.NDArray[np.float64] = np.zeros(3)
        self.start()
        self.motion = replace(
            motion,
            angle=lambda t: float(self.values[0]),
            speed=lambda t: float(self.values[1]),
            rate=lambda t: float(self.values[2]),
        )

    def start(self) -> None:
        """Reset the hub to its start."""
        self.values[:] = 0.0, self.hub.speed, 0.0


class Model:
    """The terms of a problem, each the virtual work of an effect.

    Every effect has a switch: a constant, 1 or 0, that multiplies its work and the densities of its bodies. An effect
    that is not in the model has no term, no constant and no kernel. In the linear theories all terms have switches, so
    that each can be assembled by itself.

    Attributes:
        structure: mesh, space, bodies.
        effects: names of the effects in the model.
        motion: of the frame; that of a free hub reads its unknown.
        hub: angle of a free hub; None if the rotation is prescribed.
        reacting: unbalances of a free hub in a history.
        frame: constants w, dw, a_o, gravity in use.
        mechanics: bodies, strains and loads.
        acting: the effects that have a term, by its name.
        switches: name ↦ constant factor.
        terms: name ↦ virtual work, a UFL form.
        residual: their sum F(q, v, a; δq), a UFL form.
        compositions: number of times they were written: once more at the first reference rotation.
        time: of the constants, s.
    """

    def __init__(self, problem: Problem, comm: MPI.Comm = MPI.COMM_WORLD, moving: bool = False):
        self.problem, self.comm, self.theory = problem, comm, problem.theory
        self.time, self.compositions = 0.0, 1
        self.effects = problem.effective_effects()
        self.hub = HubAngle(problem.motion) if problem.motion.hub is not None else None
        self.motion: Motion = problem.motion if self.hub is None else self.hub.motion
        self.reacting: tuple[Unbalance, ...] = ()
        if moving and self.hub is not None:
            self.problem = problem = problem.pushed(self.motion)
            self.reacting = problem.unbalances
        self.structure: Structure = resolved(structures[problem.structure.type].discretised)(problem, comm)
        fixed, pitching = problem.frame == "inertial", problem.motion.pitch is not None
        self.frame = Frame(
            self.structure.mesh, self.structure.planar, fixed, problem.loads.gravity, pitching, problem.frame == "fixed"
        )
        self.switches: dict[str, fem.Constant] = {}
        self._switched_off: frozenset[str] = frozenset()
        chosen = [Effect.registry[name] for name in self.effects]
        # In the other frame the forces of dampers are products of their constants and the speed.
        moved = ("damping", "coupling_dampers") if problem.frame == "fixed" else ("support_dampers",)
        chosen = [replace(effect, constants=None) if effect.name in moved else effect for effect in chosen]
        if pitching:  # springs of axes that the frame turns about
            chosen = [replace(effect, constants=None) if effect.at_root else effect for effect in chosen]
        further = [Effect(name, term) for name, term in problem.terms.items()]
        self.acting = {effect.name: effect for effect in (INTERNAL, INERTIA, *chosen, *further, LOADS)}
        self.compose()

    def compose(self) -> None:
        """Write the mechanics and the terms; again after a change of the reference rotation."""
        s, theory = self.structure, self.theory
        bodies = [
            replace(b, density=self._switched(b.effect or "structure", bool(b.effect), b.density))
            for b in s.bodies(self.effects)
        ]
        with of_unknowns(s.components):
            strains = self.strains(theory.measures(s.type), first_order=theory.linear)
        self.mechanics = Mechanics(bodies, strains, s.loads(), s.k, self.frame, s.damping(), s)
        self.terms = self.work(Variation(self.structure.k))
        self.residual = added(self.terms.values())
        self._stretch: Any = None

    def at_rest(self, form: Any, undeformed: bool = False) -> dict[str, Any]:
        """Return a form and its derivatives at v = a = 0 (see `rotfem.numerics.forms.at_rest`)."""
        try:
            return forms.at_rest(form, *self.structure.k.functions[:3], undeformed)
        except ValueError:  # of UFL, for a division by zero
            self.check_smooth()
            raise

    def check_smooth(self) -> None:
        """Refuse terms of a user that are not differentiable at zero velocities, as |v| v."""
        for name in (name for name, effect in self.acting.items() if callable(effect.work)):
            try:
                C = forms.at_rest(self.terms[name], *self.structure.k.functions[:3], undeformed=True)["C"]
            except ValueError:
                C = None
            if C is None or not (C.empty() or self._is_finite(C)):
                why = "has no derivative to the velocities at rest; smooth it: |v| as ufl.sqrt(inner(v, v) + eps**2)"
                raise InputError("terms" if name in self.problem.terms else "model.effects", name, why)

    def _is_finite(self, form: Any) -> bool:
        """Return whether the matrix of a form has finite numbers only, on all processes."""
        A = fem_petsc.assemble_matrix(forms.form(form, once=True))
        A.assemble()
        return bool(np.isfinite(A.norm()))

    @property
    def fixed(self) -> bool:
        """Whether the frame does not rotate."""
        return self.frame.fixed

    def strains(self, measures: Callable[..., tuple[Any, ...]], first_order: bool = False) -> list[Strain]:
        """Return the strains of a theory's measures, of first order in q or whole, with the effects' gains."""
        return self.with_gains(self.structure.strains(measures), first_order)

    def with_gains(self, strains: list[Strain], first_order: bool) -> list[Strain]:
        """Return strains with the gains of the model's effects, each times its switch."""
        return [s.gaining(self.effects, lambda name, x: self._switched(name, True, x), first_order) for s in strains]

    def prestresses(self, strain: Strain) -> bool:
        """Return whether the force of a strain is in the geometric stiffness of the prestressed linear theories."""
        usual = "axial" if self.structure.hinges else self.structure.prestress  # a hinge has no moment
        prestress = self.problem.prestress or usual
        return prestress == "all" or strain.name in self.structure.prestress_strains

    def _switched(self, name: str, effect: bool, factor: Any) -> Any:
        """Return the switch of an effect, or of a part that a linear theory assembles by itself, times a factor."""
        if not (effect or self.theory.linear):
            return factor
        if name not in self.switches:
            self.switches[name] = self.structure.constant(1.0)
        return self.switches[name] * factor

    def switch_off(self, effects: frozenset[str]) -> None:
        """Switch effects off, all others on."""
        if self._switched_off is not effects:
            self._switched_off = effects
            for name, switch in self.switches.items():
                switch.value = 0.0 if name in effects else 1.0

    def work(self, variation: Any) -> dict[str, Any]:
        """Return name ↦ virtual work of every effect for a variation, each times its switch; UFL forms."""
        out = {}
        for name, effect in self.acting.items():
            own = called(f"terms.{name}", "the function") if name in self.problem.terms else nullcontext()
            with own, of_unknowns(self.structure.components):
                term = effect.term(self.mechanics, variation)
            if not isinstance(term, int):
                out[name] = self._switched(name, name in self.effects, term)
        return out

    def derived_forms(
        self, purpose: str, make: Callable[[], dict[str, Any]], more: tuple[Any, ...] = (), once: bool = True
    ) -> Both:
        """Return derived forms of the residual; they are kept by its signature, and reused on other meshes.

        `purpose` says what they depend on besides; `more` has constants and functions that are not in the residual.
        """
        residual = self.residual
        constants = [*residual.constants(), *(x for x in more if isinstance(x, ufl.Constant))]
        functions = [*residual.coefficients(), *(x for x in more if isinstance(x, ufl.Coefficient))]
        key, whole = (purpose, residual.signature()), (functions, constants)
        if key in _KNOWN:
            (data,) = residual.subdomain_data().values()
            both = {name: known.on(self.structure.V, whole, data) for name, known in _KNOWN[key].items()}
            return {name: parts for name, (parts, _) in both.items()}, {name: form for name, (_, form) in both.items()}
        derived = make()
        compiled = {name: forms.form(f, once) for name, f in derived.items()}
        known = {name: forms.mesh_free(f, compiled[name], whole) for name, f in derived.items()}
        if None not in known.values():
            _KNOWN[key] = known
            if len(_KNOWN) > 32:
                del _KNOWN[next(iter(_KNOWN))]
        return {name: forms.constants_of(f) for name, f in derived.items()}, compiled

    @cached_property
    def turn(self) -> RigidTurn:
        """A rigid turn about the axis of the motion."""
        return RigidTurn(ufl.as_vector([float(c) for c in self.motion.axis]))

    def energies(self) -> dict[str, Any]:
        """Return UFL forms of degree 0, 1, 2 of the kinetic energy in the velocities, and of the strain energy (J).

        T = T2 + T1 + T0 = ∫ ½ρ |ẋ + w×x|². In a frame that does not rotate T1 and T0 are missing and `momentum` is the
        angular momentum about the hub (kg·m²/s) that the Jacobi integral needs there.
        """
        m = self.mechanics
        kinetic, acting = work.kinetic_parts(m), self.acting.values()
        out: dict[str, Any] = {"strain": work.strain_energy(m), "T2": kinetic["T2"]()}
        if self.fixed:
            out["momentum"] = work.momentum(m, RigidTurn(ufl.as_vector((0.0, 0.0, 1.0))))
        out |= {effect.kinetic: kinetic[effect.kinetic]() for effect in acting if effect.kinetic}
        pitch = self.problem.motion.pitch
        if pitch is not None and pitch.moves_origin:
            out["origin"] = kinetic["origin"]()
        potentials = [resolved(effect.potential)(m) for effect in acting if effect.potential is not None]
        potentials = [potential for potential in potentials if not isinstance(potential, int)]
        if potentials:
            out["potential"] = added(potentials)
        return out

    def energy(self) -> Any:
        """Return the UFL form of the energy of the conservative terms (J): the Jacobi integral.

        In a frame that does not rotate it is the energy of the structure, on which the motion of the clamp works.
        """
        parts = self.energies()
        H = parts["T2"] + parts["strain"]
        if "T0" in parts:
            H -= parts["T0"]
        if "potential" in parts:
            H += parts["potential"]
        astray = [load for load in self.mechanics.loads if load.dead and not load.conservative]
        return H + sum(ufl.inner(load.force, load.x) * load.measure for load in astray) if astray else H

    def terms_without_energy(self) -> list[Any]:
        """Return the terms without `energy`, as damping and followers; UFL forms."""
        stored = (INTERNAL.name, INERTIA.name)
        out = [
            term
            for name, term in self.terms.items()
            if name not in stored and not self.acting[name].kinetic and self.acting[name].potential is None
        ]
        others = [load for load in self.mechanics.loads if not (load.dead and load.conservative)]
        if others:
            out.append(work.loads(replace(self.mechanics, loads=others), Variation(self.structure.k)))
        return out

    def outputs(self) -> dict[str, Any]:
        """Return name ↦ UFL form of the outputs."""
        out = {}
        for name, form in self.problem.outputs.items():
            with called(f"outputs.{name}", "the function"):
                out[name] = resolved(form)(self.mechanics)
        return out

    def inside_out(self) -> bool:
        """Return whether the stretch is anywhere ≤ 0 at the state in q."""
        return self.stretches()[0] <= 0.0

    def stretches(self) -> tuple[float, float]:
        """Return the least and the largest stretch of the axis, or of a plate's area, at the state in q."""
        mesh = self.structure.mesh
        if self._stretch is None:
            points = forms.quadrature_points(mesh, self.structure.V.element.basix_element.degree)
            self._stretch = forms.expression(self.structure.stretch(self.mechanics.strains), points, self.comm)
        cells = np.arange(mesh.topology.index_map(mesh.topology.dim).size_local)
        here = self._stretch.eval(mesh, cells) if len(cells) else np.ones(1)
        least, largest = (self.comm.allreduce(float(f(here)), op) for f, op in ((np.min, MPI.MIN), (np.max, MPI.MAX)))
        return least, largest


class RigidBody(NamedTuple):
    """Integrals over the undeformed structure, frame axes.

    Attributes:
        mass: ∫ dm (kg).
        first_moment: ∫ x dm about the origin of the frame (kg·m), (3,).
        second_moment: ∫ x xᵀ dm about it, directors included (kg·m²), (3, 3).
    """

    mass: float
    first_moment: Array
    second_moment: Array

    def about(self, point: Array) -> Array:
        """Return the inertia tensor tr(E) 1 − E (kg·m²), (3, 3), about a point (m), of E = ∫ (x−p)(x−p)ᵀ dm."""
        cross = np.outer(self.first_moment, point)
        E = self.second_moment - cross - cross.T + self.mass * np.outer(point, point)
        return np.asarray(np.trace(E) * np.eye(3) - E)


def rigid_body(model: Model) -> RigidBody:
    """Return the integrals of the undeformed structure of a model, with the mass of its effects."""
    bodies = model.mechanics.bodies
    places = [b for b in bodies if b.is_position]

    parts = {"m": added(b.density * b.measure for b in places)}
    parts |= {f"{i}": added(b.density * b.x[i] * b.measure for b in places) for i in range(3)}
    pairs = list(combinations_with_replacement(range(3), 2))
    parts |= {f"{i}{j}": added(b.density * b.x[i] * b.x[j] * b.measure for b in bodies) for i, j in pairs}
    found = forms.Functionals(parts, model.structure.mesh)()
    second = np.array([[found[f"{min(i, j)}{max(i, j)}"] for j in range(3)] for i in range(3)])
    return RigidBody(found["m"], np.array([found[f"{i}"] for i in range(3)]), second)
