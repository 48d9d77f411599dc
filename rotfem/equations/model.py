"""The residual as named terms, before anything is compiled."""

from __future__ import annotations

from typing import Any

import basix
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from ufl.algorithms import expand_derivatives

from rotfem.mechanics.accelerations import ACCELERATIONS, damping, load_work, virtual_work
from rotfem.mechanics.frame import Frame
from rotfem.mechanics.motion import Motion, motion_of
from rotfem.mechanics.strains import THEORIES
from rotfem.numerics import forms
from rotfem.scene import Scene
from rotfem.structures import build


def quadrature_points(domain: Any, number: int) -> Any:
    """Return the points of the Gauss rule that has `number` of them in each direction, reference cell coordinates."""
    return basix.make_quadrature(domain.basix_cell(), 2 * number - 1)[0]


def integral_count(form: Any) -> int:
    """Return the number of integrals of a UFL form after differentiation."""
    expanded = expand_derivatives(form)
    return 0 if expanded.empty() else len(expanded.integrals())


class Model:
    """The residual of a scene as named terms, before anything is compiled.

    Args:
        scene: validated scene.
        comm: MPI communicator.
        effects: names of the effects to include; the scene's own choice if None.

    Attributes:
        structure: mesh, space, bodies.
        frame: constants w, dw, a_o, gravity in use.
        motion: prescribed motion.
        strains: strain measures that make the stored energy.
        terms: name ↦ virtual work, a UFL form.
        switches: effect ↦ constant factor of its terms, where they can be switched without a new compilation.
    """

    def __init__(self, scene: Scene, comm: MPI.Comm = MPI.COMM_WORLD, effects: tuple[str, ...] | None = None):
        self.scene, self.comm = scene, comm
        self.effects = scene.effective_effects() if effects is None else effects
        self.theory = THEORIES[scene.model.theory]
        self.motion: Motion = motion_of(scene)
        self.structure = s = build(scene, comm)
        self.fixed = scene.model.frame == "inertial"
        self.frame = Frame(s.mesh, s.planar, self.fixed, scene.loads.gravity)
        self.strains = s.strains(self.theory.measures(s.type))
        self.bodies = s.bodies(self.effects)
        self.applied = s.loads()
        self.switches: dict[str, fem.Constant] = {}
        self.terms = self._terms()
        self._stretch: Any = None

    def _terms(self) -> dict[str, Any]:
        k = self.structure.k
        terms = {"internal": sum(ufl.derivative(s.energy, k.q, k.dq) for s in self.strains)}
        for name in ("inertia", *self.effects):
            if name in ACCELERATIONS:
                terms[name] = virtual_work(name, self.bodies, k, self.frame)
        if "damping" in self.effects:
            terms["damping"] = damping(self.strains, self.bodies, k, self.structure.damping())
        if self.applied:
            terms["loads"] = load_work(self.applied, k)
        return {name: term for name, term in terms.items() if not isinstance(term, int)}

    def inside_out(self) -> bool:
        """Return whether the structure is anywhere compressed to less than nothing at the state in q: none real is."""
        mesh = self.structure.mesh
        if self._stretch is None:
            points = quadrature_points(mesh, self.structure.V.element.basix_element.degree)
            self._stretch = forms.expression(self.structure.stretch(self.strains), points, self.comm)
        cells = np.arange(mesh.topology.index_map(mesh.topology.dim).size_local)
        lowest = float(self._stretch.eval(mesh, cells).min()) if len(cells) else 1.0
        return self.comm.allreduce(lowest, op=MPI.MIN) <= 0.0

    @property
    def residual(self) -> Any:
        """F(q, v, a; δq), a UFL form."""
        return sum(self.terms.values())

    def energies(self) -> dict[str, Any]:
        """Return UFL forms of degree 0, 1, 2 of the kinetic energy in the velocities, and of the strain energy (J).

        T = T2 + T1 + T0 = ∫ ½ρ |ẋ + w×x|². In a frame that does not rotate T1 is missing and `momentum` is the
        angular momentum about the hub (kg·m²/s) that the Jacobi integral needs there.
        """
        k, frame = self.structure.k, self.frame
        forms: dict[str, Any] = {"strain": sum(s.energy for s in self.strains)}
        forms["T2"] = sum(b.density * ufl.inner(b.rate(k), b.rate(k)) / 2 * b.measure for b in self.bodies)
        if self.fixed:
            forms["momentum"] = sum(b.density * ufl.cross(b.x, b.rate(k))[2] * b.measure for b in self.bodies)
        if "coriolis" in self.effects:
            forms["T1"] = sum(
                b.density * ufl.inner(b.rate(k), ufl.cross(b.resolve(frame.w), b.x)) * b.measure for b in self.bodies
            )
        if "centrifugal" in self.effects:
            wx = [(b, ufl.cross(b.resolve(frame.w), b.x)) for b in self.bodies]
            forms["T0"] = sum(b.density * ufl.inner(s, s) / 2 * b.measure for b, s in wx)
        potentials = [-ufl.inner(load.force, load.x) * load.measure for load in self.applied if load.dead]
        for name, field in (("base", 1), ("gravity", -1)):
            if name in self.effects:
                a = frame.a_o if name == "base" else frame.gravity
                potentials += [field * b.density * ufl.inner(a, b.x) * b.measure for b in self.bodies if b.is_position]
        if potentials:
            forms["potential"] = sum(potentials)
        return forms
