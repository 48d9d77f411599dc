"""A disk with a round hole, clamped at its inner edge: edges "clamped" and "rim"."""

from __future__ import annotations

import math
from pathlib import Path

from _gmsh import command, finish, model

SECTORS = 4


def make(path: Path, inner: float, outer: float, size: float, triangles: bool = False) -> None:
    """Write the mesh of inner ≤ r ≤ outer with rings of even, curved cells of about a size (m) at the mean radius."""
    with model("annular disk") as gm:
        centre = gm.geo.addPoint(0, 0, 0)
        angles = [2 * math.pi * i / SECTORS for i in range(SECTORS)]
        around = max(2, round(math.pi * (inner + outer) / size / SECTORS))
        across = max(1, round((outer - inner) / size))
        rings = [[gm.geo.addPoint(r * math.cos(a), r * math.sin(a), 0) for a in angles] for r in (inner, outer)]
        arcs = [[gm.geo.addCircleArc(p[i], centre, p[(i + 1) % SECTORS]) for i in range(SECTORS)] for p in rings]
        spokes = [gm.geo.addLine(rings[0][i], rings[1][i]) for i in range(SECTORS)]
        surfaces = []
        for i in range(SECTORS):
            loop = [spokes[i], arcs[1][i], -spokes[(i + 1) % SECTORS], -arcs[0][i]]
            surfaces.append(gm.geo.addPlaneSurface([gm.geo.addCurveLoop(loop)]))
            gm.geo.mesh.setTransfiniteSurface(surfaces[-1])
        for arc in arcs[0] + arcs[1]:
            gm.geo.mesh.setTransfiniteCurve(arc, around + 1)
        for spoke in spokes:
            gm.geo.mesh.setTransfiniteCurve(spoke, across + 1)
        gm.geo.synchronize()
        finish(
            path, {"clamped": (1, arcs[0]), "rim": (1, arcs[1]), "plate": (2, surfaces)}, triangles, free=False, order=2
        )


if __name__ == "__main__":
    command(make, __doc__ or "", inner=0.05, outer=0.2, size=0.02)
