"""A blade that narrows from root to tip and may be swept: edges "clamped", "tip", "leading" and "trailing"."""

from __future__ import annotations

from pathlib import Path

from _gmsh import blade, command


def make(
    path: Path, length: float, root: float, tip: float, sweep: float, size: float, triangles: bool = False
) -> None:
    """Write the mesh: chord `root` at x = 0 and `tip` at x = length, its middle moved by `sweep` along −y (m)."""
    corners = [(0, -root / 2), (length, -sweep - tip / 2), (length, -sweep + tip / 2), (0, root / 2)]
    blade(path, "trapezoidal blade", corners, size, triangles)


if __name__ == "__main__":
    command(make, __doc__ or "", length=1.0, root=0.4, tip=0.2, sweep=0.1, size=0.05)
