"""A rectangular blade clamped at x = 0: edges "clamped", "tip", "leading" and "trailing"."""

from __future__ import annotations

from pathlib import Path

from _gmsh import command, finish, model


def make(path: Path, length: float, width: float, size: float, triangles: bool = False) -> None:
    """Write the mesh of 0 ≤ x ≤ length, |y| ≤ width/2 with cells of a size (m)."""
    with model("cantilever blade") as gm:
        corners = [(0, -width / 2), (length, -width / 2), (length, width / 2), (0, width / 2)]
        points = [gm.geo.addPoint(x, y, 0, size) for x, y in corners]
        lines = [gm.geo.addLine(points[i], points[(i + 1) % 4]) for i in range(4)]
        surface = gm.geo.addPlaneSurface([gm.geo.addCurveLoop(lines)])
        gm.geo.synchronize()
        names = ("trailing", "tip", "leading", "clamped")
        groups = {name: (1, [line]) for name, line in zip(names, lines, strict=True)}
        finish(path, {**groups, "plate": (2, [surface])}, triangles)


if __name__ == "__main__":
    command(make, __doc__ or "", length=1.0, width=0.2, size=0.05)
