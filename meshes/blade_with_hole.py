"""A rectangular blade with a round hole, thicker at its root: regions "root" and "blade", edges "clamped" and "tip"."""

from __future__ import annotations

from pathlib import Path

from _gmsh import command, finish, model


def make(
    path: Path,
    length: float,
    width: float,
    root: float,
    hole_at: float,
    hole_radius: float,
    size: float,
    triangles: bool = False,
) -> None:
    """Write the mesh of 0 ≤ x ≤ length, |y| ≤ width/2; region "root" up to x = root, a hole about (hole_at, 0) (m)."""
    with model("blade with hole") as gm:
        occ = gm.occ
        pieces = [(2, occ.addRectangle(0, -width / 2, 0, root, width))]
        blade = (2, occ.addRectangle(root, -width / 2, 0, length - root, width))
        hole = (2, occ.addDisk(hole_at, 0, 0, hole_radius, hole_radius))
        pieces += occ.cut([blade], [hole])[0]
        occ.fragment(pieces[:1], pieces[1:])
        occ.synchronize()
        surfaces = {tag: occ.getCenterOfMass(2, tag)[0] for _, tag in gm.getEntities(2)}
        ends = {tag: occ.getCenterOfMass(1, tag)[0] for _, tag in gm.getEntities(1)}
        gm.mesh.setSize(gm.getEntities(0), size)
        groups = {
            "clamped": (1, [tag for tag, x in ends.items() if abs(x) < 1e-9]),
            "tip": (1, [tag for tag, x in ends.items() if abs(x - length) < 1e-9]),
            "root": (2, [tag for tag, x in surfaces.items() if x < root]),
            "blade": (2, [tag for tag, x in surfaces.items() if x > root]),
        }
        finish(path, groups, triangles)


if __name__ == "__main__":
    numbers = {"length": 1.0, "width": 0.3, "root": 0.2, "hole_at": 0.6, "hole_radius": 0.06, "size": 0.05}
    command(make, __doc__ or "", **numbers)
