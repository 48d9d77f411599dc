"""The scene: everything a computation needs to know, validated once.

A scene is a TOML file or the same nested tables in Python, in SI units or with units in quotes. What passes here is
complete and consistent; what does not raises one `SceneError` that names the key, its value and what is allowed.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, get_args

import numpy as np
from pydantic import BaseModel, Field, PlainValidator, PrivateAttr, ValidationError, ValidationInfo

from rotfem import registry
from rotfem.errors import OutputError, SceneError, show
from rotfem.scene.beams import Structure
from rotfem.scene.extensions import Extensions, load_wanted
from rotfem.scene.files import READ, apply_overrides, read_toml, set_keys, to_builtin
from rotfem.scene.loads import LoadsTable, bare_tables, check_in_plane, check_loads
from rotfem.scene.motion import AnyMotion, MotionTable
from rotfem.scene.settings import (
    NO_STEPS,
    AngularUnit,
    BeamMesh,
    Initial,
    ModelTable,
    ModesTable,
    OutputTable,
    PlateMesh,
    Solver,
    Time,
)
from rotfem.scene.structure import designed
from rotfem.scene.table import SceneModel, empty, problem, scene_error, unit
from rotfem.scene.values import ROUND_OFF, Matrix
from rotfem.short import short
from rotfem.units import unit_of


def abridged(value: Any, given: Any) -> Any:
    """Return the tables of a scene, long ones of numbers as rows, columns, SHA-256, and the file that is given."""
    if isinstance(value, Mapping):
        # A load may be given as the path of its table, without the table around it.
        below = given if isinstance(given, Mapping) else dict.fromkeys(value, given)
        return {key: abridged(entry, below.get(key)) for key, entry in value.items()}
    if not isinstance(value, list) or len(value) <= 1000 or not isinstance(value[0], list):
        return value
    table = np.array([np.concatenate([np.ravel(entry) for entry in row]) for row in value], dtype="<f8")
    note = {"rows": len(table), "columns": table.shape[1], "sha256": hashlib.sha256(table.tobytes()).hexdigest()}
    return {"file": given, **note} if isinstance(given, str) else note


#: A relative error that may be asked for, and CPU seconds that it may take.
Accuracy = Annotated[float, Field(strict=True, ge=1e-8, le=0.5)]
Budget = Annotated[float, Field(strict=True, gt=0, le=1e9), unit("s")]


def _as_mesh(value: Any, info: ValidationInfo) -> BeamMesh | PlateMesh:
    """Return the mesh of the structure's type."""
    structure = info.data.get("structure")
    kind = (info.context or {}).get("type") or getattr(structure, "type", None)
    table = PlateMesh if kind == "plate" else BeamMesh
    mesh: BeamMesh | PlateMesh = table.model_validate(value, context=info.context)
    return mesh if structure is None else mesh.suited(structure)


if TYPE_CHECKING:
    Mesh = BeamMesh | PlateMesh
else:
    Mesh = Annotated[Any, PlainValidator(_as_mesh)]


class Scene(SceneModel):
    """A validated scene. Immutable; `replace` makes variants. Two are equal where all that they say is.

    Attributes:
        structure: what moves: planar beam, spatial beam or plate.
        motion: how the hub turns and moves.
        model: theory, effects and frame.
        initial: initial state.
        loads: gravity and applied loads.
        mesh: discretisation, `BeamMesh` or `PlateMesh`.
        time: time interval and scheme, or None.
        modes: what modes to compute.
        solver: settings of Newton's method.
        output: what to compute in addition to what is always recorded.
        extensions: Python files that register what the scene names.
        accuracy: wanted error, relative to the largest displacement of the tip, or to each frequency; theory, mesh,
            scheme and step follow from it.
        accuracy_of: its output; by default that of the command, the tip or the frequencies.
        accuracy_budget: limit of the CPU time (s) of all answers together; none by default.
    """

    structure: Structure
    motion: AnyMotion
    model: ModelTable = empty()
    initial: Initial = empty()
    loads: LoadsTable = empty()
    mesh: Mesh = empty()
    time: Time | None = None
    modes: ModesTable = empty()
    solver: Solver = empty()
    output: OutputTable = empty()
    extensions: Extensions = empty()
    accuracy: Accuracy | None = None
    accuracy_of: Literal["tip", "root_moment", "frequencies"] | None = None
    accuracy_budget: Budget | None = None

    _name: str = PrivateAttr("scene")
    _file: str = PrivateAttr("scene")
    _directory: str = PrivateAttr(".")
    _tables: dict[str, Any] = PrivateAttr(default_factory=dict)
    _hints: list[str] = PrivateAttr(default_factory=list)
    _inputs: tuple[Path, ...] = PrivateAttr(())

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], name: str = "scene", directory: str | Path = ".") -> Self:
        """Return the validated scene of nested tables."""
        return cls._validate(data, name, name, str(directory))

    @classmethod
    def _validate(cls, data: Mapping[str, Any], name: str, file: str, directory: str, trust: bool = False) -> Self:
        tables, before = to_builtin(data), len(READ)
        load_wanted(tables, file, directory, trust)
        given = tables.get("motion")
        tables = with_shown(tables, "speed", given.get("speed") if isinstance(given, Mapping) else None)
        whole, hints = designed(tables, file), list[str]()
        structure = whole.get("structure")
        kind, length = (structure.get(k) if isinstance(structure, Mapping) else None for k in ("type", "length"))
        if "loads" in whole:
            whole = {**whole, "loads": bare_tables(whole["loads"], length)}
        context = {"directory": directory, "accuracy": whole.get("accuracy"), "type": kind}
        try:
            scene = cls.model_validate(whole, context={**context, "hints": hints})
        except ValidationError as error:
            raise scene_error(file, error) from None
        scene._name, scene._file, scene._directory, scene._tables, scene._hints = name, file, directory, tables, hints
        scene._inputs = tuple(dict.fromkeys(READ[before:]))
        return scene

    def __repr__(self) -> str:
        given = {name: getattr(self, name) for name in type(self).model_fields if name in self.model_fields_set}
        return short("Scene", {"name": self._name, **given})

    @property
    def name(self) -> str:
        """Name of the scene: its file without folder and ending."""
        return self._name

    @property
    def file(self) -> str:
        """Name of the file as errors show it."""
        return self._file

    @property
    def directory(self) -> str:
        """Folder where relative paths in the scene start."""
        return self._directory

    @property
    def hints(self) -> tuple[str, ...]:
        """What files that the scene names have and it does not get, one line each."""
        return tuple(dict.fromkeys(self._hints))

    @property
    def inputs(self) -> tuple[Path, ...]:
        """Files that were read for it: its own, and those that it names."""
        return self._inputs

    @property
    def tables(self) -> dict[str, Any]:
        """Nested tables of what was set, without defaults; not to be changed."""
        return self._tables

    def replace(self, changes: Mapping[str, Any]) -> Self:
        """Return a variant of the scene, validated from what the user set, with the changes and fresh defaults."""
        tables = set_keys(self._file, self._tables, changes.items())
        variant = type(self)._validate(tables, self._name, self._file, self._directory)
        variant._inputs = tuple(dict.fromkeys(variant._inputs + self._inputs))
        return variant

    def write(self, path: str | Path, remark: str = "") -> Path:
        """Write what was set in the scene as TOML, after a remark of comment lines; return the path.

        What is read from there is equal. Paths of files that the scene reads are relative to the folder of the new one.

        Raises:
            SceneError: the scene holds a Python function, which no file can.
            OutputError: the file cannot be written.
        """
        import tomli_w

        path, start = Path(path), Path(self._directory)
        files = set(map(os.path.realpath, self._inputs))

        def moved(value: Any) -> Any:
            """Return tables with the paths of files made relative to the folder of the new one."""
            if isinstance(value, Mapping):
                return {key: moved(entry) for key, entry in value.items()}
            if isinstance(value, list):
                return [moved(entry) for entry in value]
            if not isinstance(value, str | Path) or "\0" in str(value):
                return value
            ours = os.path.realpath(start / value) in files and not Path(value).is_absolute()
            return os.path.relpath(start.resolve() / value, path.parent.resolve()) if ours else str(value)

        def joined(array: re.Match[str]) -> str:
            """Return an array in a line where it fits one."""
            line = " ".join(array[1].split()).rstrip(",")
            return f"[{line}]" if len(line) < 100 else array[0]

        try:
            text, before = tomli_w.dumps(moved(self._tables)), ""
            while text != before:
                before, text = text, re.sub(r'\[\n((?: +(?![ \]])[^"{}=\n]*,\n)+) *\]', joined, text)
        except TypeError:
            why = "holds a Python function, so that it cannot be written as TOML"
            raise SceneError(self._file, allowed=why) from None
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(remark + text, encoding="utf-8")
        except OSError as error:
            raise OutputError(path, error.strerror or str(error)) from None
        return path

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scene) and self.__dict__ == other.__dict__

    def showing(self, what: str, given: object) -> Self:
        """Return the scene with "speed" or "frequency" shown in the unit of a text, if it has none itself."""
        tables = with_shown(self._tables, what, given)
        return self if tables is self._tables else self.replace({f"output.{what}": tables["output"][what]})

    def to_dict(self) -> dict[str, Any]:
        """Return tables of what was set and of all defaults, fit for JSON and TOML; functions become their names."""
        tables: dict[str, Any] = plain(self)
        for name in {"output", "extensions"} - self.model_fields_set:
            del tables[name]
        if self.structure.mesh_file is not None:
            without = {"elements", "cell"} | ({"degree"} - self.mesh.model_fields_set)
            tables["mesh"] = {key: value for key, value in tables["mesh"].items() if key not in without}
        return tables

    def digest(self) -> dict[str, Any]:
        """Return `to_dict` with long tables referred to instead of repeated (see `abridged`)."""
        digest: dict[str, Any] = abridged(self.to_dict(), self._tables)
        return digest

    def check_run(self) -> None:
        """Check that the scene can be run: a time history needs times, a steady state a constant speed."""
        if self.time is None and not self.motion.is_steady:
            how = "give its end, and step, tolerance or an accuracy"
            why = f'missing; with motion.type = "{self.motion.type}" a run is a history: {how}'
            raise SceneError(self._file, "time", None, why)
        if self.time is not None and self.time.step is None and self.time.tolerance is None:
            raise SceneError(self._file, "time.step", None, NO_STEPS)
        if self.time is None and (key := self.initial.first) is not None:
            raise SceneError(self._file, f"initial.{key}", None, "needs [time]: a steady state has no beginning")

    def _check(self) -> None:
        """Refuse tables that cannot be combined, the most basic of them first."""
        structure, motion, model = self.structure, self.motion, self.model
        if structure.is_planar:
            check_planar(motion, self.loads)
        for i, support in enumerate(getattr(structure, "supports", ())):
            if support.frame == "fixed" and any(motion.axis[1:]):
                why = "is of a beam that spins about its own axis; those of others stand in the rotating frame"
                raise problem(f"structure.supports.{i}.frame", "fixed", why)
        check_loads(structure, motion, self.loads)
        check_mesh(structure, self.mesh)
        check_prestress(structure, model)
        check_initial(structure, motion, model, self.initial)
        if self.accuracy is not None and not self.output.error:
            why = "cannot be combined with accuracy, which is met by what is estimated"
            raise problem("output.error", False, why)
        self.output.check(structure.type, structure.length)


def load_scene(path: str | Path, overrides: Sequence[str] = (), trust: bool = False) -> Scene:
    """Return the validated scene of a TOML file; trusted, it may run Python files (see `rotfem.scene.extensions`)."""
    path = Path(path)
    tables = apply_overrides(path.name, read_toml(path), overrides)
    scene = Scene._validate(tables, path.stem, path.name, str(path.parent), trust)
    scene._inputs = (path.absolute(), *scene._inputs)
    return scene


def with_shown(tables: dict[str, Any], what: str, given: object) -> dict[str, Any]:
    """Return a scene's tables with the unit of a text, if any, as output.speed or .frequency that is not given."""
    output, unit = tables.get("output", {}), unit_of(given) if isinstance(given, str) else ""
    if not isinstance(output, Mapping) or what in output or unit not in get_args(AngularUnit):
        return tables
    return {**tables, "output": {**output, what: unit}}


def as_scene(scene: Scene | str | Path | Mapping[str, Any], trust: bool = False) -> Scene:
    """Return a validated scene from a scene, the path of a file or nested tables; trusted as in `load_scene`."""
    if isinstance(scene, Scene):
        return scene
    if isinstance(scene, Mapping):
        return Scene._validate(scene, "scene", "scene", ".", trust)
    return load_scene(scene, trust=trust)


def plain(value: Any) -> Any:
    """Return a validated value as tables, lists and numbers, fit for JSON and TOML; functions become their names."""
    if isinstance(value, BaseModel):
        fields = {name: getattr(value, name) for name in type(value).model_fields} | (value.model_extra or {})
        return {name: plain(entry) for name, entry in fields.items() if entry is not None}
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        if value and isinstance(value[0], tuple):  # a table of numbers, maybe a long one
            return list(map(list, value))
        return [plain(entry) for entry in value]
    if callable(value):
        return f"<callable {getattr(value, '__name__', type(value).__name__)}>"
    return value


# --- what tables say together: each check raises a problem that names the key to change ------------------------------


def check_planar(motion: MotionTable, loads: LoadsTable) -> None:
    """Refuse what would move a planar beam out of its plane."""
    if motion.axis[0] != 0.0 or motion.axis[1] != 0.0:
        raise problem("motion.axis", list(motion.axis), "must be [0, 0, 1] or [0, 0, -1] for a planar_beam")
    check_in_plane("loads.gravity", [(None, loads.gravity)])
    if motion.base_acceleration is not None:
        check_in_plane("motion.base_acceleration", motion.base_acceleration.vectors)


def check_mesh(structure: Any, mesh: BeamMesh | PlateMesh) -> None:
    """Refuse a mesh that is given both as a file and by numbers of elements, and elements that lock."""
    if structure.mesh_file is None:
        if isinstance(mesh, PlateMesh) and (why := mesh.locking_on(mesh.cell)) is not None:
            raise problem("mesh.degree", mesh.degree, why)
        return
    for key in ("elements", "cell"):
        if key in mesh.model_fields_set:
            raise problem(f"mesh.{key}", getattr(mesh, key), "has no meaning with structure.mesh")


def check_prestress(structure: Any, model: ModelTable) -> None:
    """Refuse to say what the prestress is of where there is none, or one kind of it only."""
    linear = structure.type != "plate" and registry.theories[model.theory].prestress
    if model.prestress is None or (linear and not (structure.hinges and model.prestress == "all")):
        return
    able = " or ".join(show(theory.name) for theory in registry.theories if theory.prestress)
    why = f'needs a beam and model.theory = {able}; "all" a root without hinges and springs, which have no moments'
    raise problem("model.prestress", model.prestress, why)


def check_initial(structure: Any, motion: MotionTable, model: ModelTable, initial: Initial) -> None:
    """Refuse an initial state that the scene cannot have."""
    displacement = initial.tip_displacement
    if displacement is not None:
        if not structure.is_planar:
            raise problem("initial.tip_displacement", displacement, "is allowed only for a planar_beam")
        if abs(displacement) >= structure.length:
            reason = f"must be less than the length {structure.length:g} in size"
            raise problem("initial.tip_displacement", displacement, reason)
    if initial.mode is not None and motion.is_free:
        raise problem("initial.mode", initial.mode, 'needs a speed that is prescribed, not motion.type = "torque"')
    if initial.velocity is not None:
        _check_velocity(structure, initial.velocity)
    if not initial.moves:
        return
    key, value = ("initial.mode", initial.mode) if initial.mode is not None else ("initial.velocity", None)
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
