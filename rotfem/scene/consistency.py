"""Checks of what the tables of a scene say together. Each raises a problem that names the key to change."""

from __future__ import annotations

from typing import Any

from rotfem import registry
from rotfem.errors import show
from rotfem.scene.loads import Loads, check_loads
from rotfem.scene.motion import Motion, TorqueMotion
from rotfem.scene.settings import BeamMesh, Initial, Model, PlateMesh
from rotfem.scene.span_tables import FORCE
from rotfem.scene.table import problem
from rotfem.scene.values import ROUND_OFF, Matrix


def check_together(scene: Any) -> None:
    """Refuse tables of a scene that cannot be combined, the most basic of them first."""
    structure, motion, model = scene.structure, scene.motion, scene.model
    if structure.is_planar:
        check_planar(motion, scene.loads)
    check_loads(structure, motion, scene.loads)
    check_mesh(structure, scene.mesh)
    check_theory(structure, model)
    check_frame(structure, motion, model)
    check_initial(structure, motion, model, scene.initial)
    check_limits(scene)
    check_accuracy(scene)
    scene.output.check(structure.type, structure.length)


def check_planar(motion: Motion, loads: Loads) -> None:
    """Refuse what would move a planar beam out of its plane."""
    if motion.axis[0] != 0.0 or motion.axis[1] != 0.0:
        raise problem("motion.axis", list(motion.axis), "must be [0, 0, 1] or [0, 0, -1] for a planar_beam")
    vectors: dict[str, Any] = {"motion.base_acceleration": motion.base_acceleration}
    vectors |= {f"loads.{name}": load for name, load in loads.named.items() if load.VECTORS is FORCE}
    for key, signal in vectors.items():
        if signal is not None and not signal.is_planar:
            value = list(signal.value) if signal.value is not None else None
            raise problem(key, value, "the third component must be 0 for a planar_beam")
    if loads.gravity[2] != 0.0:
        raise problem("loads.gravity", list(loads.gravity), "the third component must be 0 for a planar_beam")


def check_mesh(structure: Any, mesh: BeamMesh | PlateMesh) -> None:
    """Refuse a mesh that is given both as a file and by numbers of elements, and elements that lock."""
    if structure.mesh_file is None:
        if (why := mesh.locking) is not None:
            raise problem("mesh.degree", mesh.degree, why)
        return
    for key in ("elements", "cell"):
        if key in mesh.model_fields_set:
            raise problem(f"mesh.{key}", getattr(mesh, key), "has no meaning with structure.mesh")


def check_theory(structure: Any, model: Model) -> None:
    """Refuse a theory that has no strains for the structure."""
    kind, theory = structure.type, registry.theories[model.theory]
    if not theory.holds_for(kind):
        able = ", ".join(show(other.name) for other in registry.theories if other.holds_for(kind))
        has = ", ".join(theory.strains) or "no structure"
        raise problem("model.theory", theory.name, f"has strains for {has}, none for a {kind}; allowed there: {able}")
    check_prestress(structure, model)
    if model.reduced and not theory.linear:
        able = ", ".join(show(other.name) for other in registry.theories if other.linear and other.holds_for(kind))
        raise problem("model.reduced", model.reduced, f'needs a linear model.theory, not "{theory.name}": {able}')


def check_prestress(structure: Any, model: Model) -> None:
    """Refuse to say what the prestress is of where there is none, or one kind of it only."""
    kind = structure.type
    if model.prestress is None:
        return
    if structure.hinges and model.prestress == "all":
        why = (
            "is for a root without hinges and springs: the linear structure, held there, has moments that they have not"
        )
        raise problem("model.prestress", model.prestress, why)
    if kind == "plate":
        raise problem("model.prestress", model.prestress, "is for beams: that of a plate is of its membrane forces")
    if not registry.theories[model.theory].prestress and model.tolerance is None:
        able = (show(theory.name) for theory in registry.theories if kind in theory.prestress)
        raise problem("model.prestress", model.prestress, f"needs model.theory = {' or '.join(able)}")


def check_frame(structure: Any, motion: Motion, model: Model) -> None:
    """Refuse the inertial-frame form where there is none, and a controller where the motion is solved for at once."""
    if model.reduced and isinstance(motion, TorqueMotion) and motion.function is not None:
        raise problem("model.reduced", model.reduced, "needs a torque over time, not motion.function")
    if structure.pitches and motion.is_free:
        raise problem("structure.root.pitch", None, 'over time needs a speed that is prescribed, not type = "torque"')
    if model.frame != "inertial":
        return
    if not structure.is_planar or not registry.theories[model.theory].exact:
        exact = (show(theory.name) for theory in registry.theories if theory.exact and theory.holds_for("planar_beam"))
        raise problem(
            "model.frame",
            model.frame,
            f'needs structure.type = "planar_beam" and model.theory = {" or ".join(exact)}: displacements relative to '
            "the inertial frame are large, which only exact strains allow",
        )
    if motion.is_free:
        raise problem("model.frame", model.frame, 'is not available with motion.type = "torque"; use "rotating"')
    if structure.damping.rayleigh[0] > 0.0:
        raise problem(
            "structure.damping.rayleigh",
            list(structure.damping.rayleigh),
            'the mass-proportional part must be 0 with frame = "inertial", where it would brake the revolution itself',
        )
    if structure.damping.has_modal:
        why = 'is not available with frame = "inertial", where the modes at rest turn; use "rotating"'
        raise problem("structure.damping.modal", structure.damping.modal, why)
    for effect in registry.effects:
        if effect.of_rotation and model.effects != "auto" and effect.name in model.effects:
            raise problem(
                "model.effects",
                list(model.effects),
                f'"{effect.name}" is not a separate effect with frame = "inertial"; it comes from the motion of the '
                "clamp",
            )


def check_initial(structure: Any, motion: Motion, model: Model, initial: Initial) -> None:
    """Refuse an initial state that the scene cannot have."""
    displacement, limit = initial.tip_displacement, structure.release_limit
    if displacement is not None:
        if limit is None:
            raise problem("initial.tip_displacement", displacement, "is allowed only for a planar_beam")
        if abs(displacement) >= limit:
            reason = f"must be less than the length {limit:g} in size"
            raise problem("initial.tip_displacement", displacement, reason)
    if initial.mode is not None and motion.is_free:
        raise problem("initial.mode", initial.mode, 'needs a speed that is prescribed, not motion.type = "torque"')
    if initial.velocity is not None:
        _check_velocity(structure, initial.velocity)
    if not initial.moves:
        return
    key, value = ("initial.mode", initial.mode) if initial.mode is not None else ("initial.velocity", None)
    if model.reduced:
        raise problem(key, value, "cannot be combined with model.reduced, which starts at rest")
    if model.frame == "inertial":
        raise problem(key, value, 'is relative to the turning frame: it needs model.frame = "rotating"')


def _check_velocity(structure: Any, rows: Matrix) -> None:
    length = structure.length
    why = None
    if structure.type == "plate":
        why = "is available for beams only; a plate may start in a mode"
    elif rows[0][0] != 0.0 or abs(rows[-1][0] - length) > ROUND_OFF * length:
        why = f"the table must run from x = 0 to the length {length:g}"
    elif any(rows[0][1:]):
        why = "must be zero at x = 0, where the root is held"
    elif structure.is_planar and any(row[3] for row in rows):
        why = "the third component must be 0 for a planar_beam"
    if why is not None:
        raise problem("initial.velocity", None, why)


def check_limits(scene: Any) -> None:
    """Refuse more steps and modes than the scene's limits allow."""
    for key in ("step", "output_step") if scene.time is not None else ():
        if (step := getattr(scene.time, key)) is not None:
            scene.limits.check("steps", scene.time.end / step, f"time.{key}", step)
    scene.limits.check("modes", scene.modes.count, "modes.count", scene.modes.count)


def check_accuracy(scene: Any) -> None:
    """Refuse what an accuracy excludes, and a budget without one."""
    if scene.accuracy is None:
        if scene.accuracy_budget is not None:
            reason = "is what an accuracy may take, and needs accuracy"
            raise problem("accuracy_budget", scene.accuracy_budget, reason)
        return
    if scene.model.tolerance is not None:
        reason = "cannot be combined with accuracy, which allows the model a share of its own"
        raise problem("model.tolerance", scene.model.tolerance, reason)
    if not scene.output.error:
        raise problem("output.error", False, "cannot be combined with accuracy, which is met by what is estimated")
