"""A rectangular blade clamped at x = 0: edges "clamped", "tip", "leading" and "trailing"."""

from __future__ import annotations

from pathlib import Path

from _gmsh import blade, command


def make(path: Path, length: float, width: float, size: float, triangles: bool = False) -> None:
    """Write the mesh of 0 ≤ x ≤ length, |y| ≤ width/2 with cells of a size (m)."""
    corners = [(0, -width / 2), (length, -width / 2), (length, width / 2), (0, width / 2)]
    blade(path, "cantilever blade", corners, size, triangles)


if __name__ == "__main__":
    command(make, __doc__ or "", length=1.0, width=0.2, size=0.05)
