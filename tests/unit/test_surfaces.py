"""Surfaces that modes move: a rigid motion moves them rigidly, and they are closed."""

from __future__ import annotations

from collections import Counter

import numpy as np

from rotfem.results.surfaces import Surface

LENGTH, N = 3.0, 13
X = np.linspace(0.0, LENGTH, N)
ROOT = np.array([0.5, -0.2, 0.1])
PLACES = ROOT + X[:, None] * np.array([np.cos(0.3), 0.0, np.sin(0.3)])


def beam(width: float = 0.2, height: float = 0.1, twist: float = 0.0) -> Surface:
    """Return a beam whose sections lie in the plane of axes 2 and 3."""
    angle = twist * X / LENGTH
    e = np.stack([0 * X, np.cos(angle), np.sin(angle)], axis=-1)
    f = np.stack([0 * X, -np.sin(angle), np.cos(angle)], axis=-1)
    return Surface.of_beam(PLACES, (width * e, height * f), LENGTH)


def test_a_rigid_rotation_moves_all_points_alike() -> None:
    """u = θ × (x − root) on the axis with the same θ in all sections: every point p goes to p + θ × (p − root)."""
    theta, surface = np.array([0.3, -0.7, 0.2]), beam(twist=1.2)
    u = np.cross(theta, PLACES - ROOT)
    shape = {"x": X, **{f"u{i + 1}": u[:, i] for i in range(3)}}
    shape |= {f"theta{i + 1}": LENGTH * theta[i] * np.ones(N) for i in range(3)}
    np.testing.assert_allclose(surface.moved(shape), np.cross(theta, surface.points - ROOT), atol=1e-14)


def test_a_planar_beam_turns_about_the_normal_with_its_imaginary_part() -> None:
    surface = beam()
    moved = surface.moved({"x": X, "alpha": 0 * X, "alpha_imag": LENGTH * np.ones(N)})
    np.testing.assert_allclose(moved, 1j * np.cross([0.0, 0.0, 1.0], surface.arms), atol=1e-15)


def test_a_beam_is_a_closed_surface_of_its_volume() -> None:
    """Every edge belongs to two triangles that run along it in both senses; ⅓ ∮ x·n dA = 4 a b (L cos 0.3)."""
    surface = beam()
    edges = Counter((int(t[i]), int(t[(i + 1) % 3])) for t in surface.triangles for i in range(3))
    assert set(edges.values()) == {1}
    assert all((b, a) in edges for a, b in edges)
    a, b, c = (surface.points[surface.triangles[:, i]] for i in range(3))
    volume = np.sum(np.einsum("ij,ij->i", a, np.cross(b, c))) / 6.0
    np.testing.assert_allclose(abs(volume), 4 * 0.2 * 0.1 * LENGTH * np.cos(0.3), rtol=1e-12)


def test_a_plate_moves_as_its_nodes_do() -> None:
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    surface = Surface.of_plate(points, np.array([[0, 1, 2]]), 1.0)
    shape = {"x": points[:, 0], "y": points[:, 1], "u3": np.array([0.0, 0.0, 1.0]), "alpha1": np.ones(3)}
    np.testing.assert_array_equal(surface.moved(shape), [[0, 0, 0], [0, 0, 0], [0, 0, 1]])
    (one,) = surface.frames({"mode 1: 1st bending": shape}, 2)
    assert one[0] == 2.0
    assert set(one[1]) == {"displacement", "displacement_imag"}
