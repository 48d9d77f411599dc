"""Masses at places along a beam: the [[structure.masses]] tables."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, PlainValidator, model_validator

from rotfem.scene.values import (
    Array,
    Bounds,
    Matrix,
    NonNegative,
    Number,
    SceneModel,
    Vector3,
    as_padded_vector3,
    as_symmetric_matrix,
    problem,
)

#: Part of the length by which a place may be beside the beam.
NEAR = 1e-9


def as_inertia(value: Any) -> float | Matrix:
    """Return a moment of inertia or a tensor, 3×3; raise on anything else."""
    if isinstance(value, list | tuple):
        return as_symmetric_matrix(value, 3, definite=False)
    return Bounds(ge=0.0).number(value)


class PointMass(SceneModel):
    """A rigid body fixed to a section.

    Attributes:
        x: place along the beam (m).
        mass: kg.
        offset: position of its center relative to the axis, section axes (m).
        inertia: about its center (kg·m²): of a planar beam about axis 3; of a spatial one a tensor in section axes, or
            a number, isotropic.
    """

    x: Number = Field(description="a place along the beam (m)")
    mass: NonNegative = 0.0
    offset: Annotated[Vector3, PlainValidator(as_padded_vector3)] = (0.0, 0.0, 0.0)
    inertia: Annotated[float | Matrix, PlainValidator(as_inertia)] = 0.0

    @property
    def inertia_matrix(self) -> Array:
        """Inertia tensor (kg·m²), shape (3, 3)."""
        return self.inertia * np.eye(3) if isinstance(self.inertia, float) else np.array(self.inertia)

    @model_validator(mode="after")
    def _check_any(self) -> Self:
        if self.mass == 0.0 and not np.any(self.inertia_matrix):
            raise problem("mass", self.mass, "give mass, inertia, or both")
        return self


def check_masses(masses: Iterable[PointMass], length: float, planar: bool) -> None:
    """Refuse masses beside the beam (m), and those that are none of a planar one."""
    for i, body in enumerate(masses):
        key = f"masses.{i}"
        if not -NEAR <= body.x / length <= 1 + NEAR:
            raise problem(f"{key}.x", body.x, f"must be from 0 to the length {length:g}")
        if planar and body.offset[2] != 0.0:
            raise problem(f"{key}.offset", list(body.offset), "the third component must be 0 for a planar_beam")
        if planar and not isinstance(body.inertia, float):
            raise problem(f"{key}.inertia", None, "must be a number, about axis 3, for a planar_beam")
