"""A blade that narrows from root to tip and may be swept: edges "clamped", "tip", "leading" and "trailing"."""

from __future__ import annotations

from pathlib import Path

from _gmsh import command, finish, model


def make(
    path: Path, length: float, root: float, tip: float, sweep: float, size: float, triangles: bool = False
) -> None:
    """Write the mesh: chord `root` at x = 0 and `tip` at x = length, its middle moved by `sweep` along −y (m)."""
    with model("trapezoidal blade") as gm:
        corners = [(0, -root / 2), (length, -sweep - tip / 2), (length, -sweep + tip / 2), (0, root / 2)]
        points = [gm.geo.addPoint(x, y, 0, size) for x, y in corners]
        lines = [gm.geo.addLine(points[i], points[(i + 1) % 4]) for i in range(4)]
        surface = gm.geo.addPlaneSurface([gm.geo.addCurveLoop(lines)])
        gm.geo.synchronize()
        names = ("trailing", "tip", "leading", "clamped")
        groups = {name: (1, [line]) for name, line in zip(names, lines, strict=True)}
        finish(path, {**groups, "plate": (2, [surface])}, triangles)


if __name__ == "__main__":
    command(make, __doc__ or "", length=1.0, root=0.4, tip=0.2, sweep=0.1, size=0.05)
