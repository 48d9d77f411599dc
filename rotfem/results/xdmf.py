"""Fields over time in one XDMF file with its HDF5 file beside it, which ParaView and pyvista read."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from xml.etree import ElementTree as ET

import h5py
import numpy as np
import numpy.typing as npt

from rotfem.errors import OutputError

Array = npt.NDArray[np.float64]

#: Nodes of a cell ↦ what XDMF calls it.
CELLS = {2: "Polyline", 3: "Triangle"}


def write_xdmf(
    path: Path, points: Array, cells: npt.NDArray[np.int64], frames: Iterable[tuple[float, Mapping[str, Array]]]
) -> list[Path]:
    """Write point data over time as path (.xdmf) and, beside it, .h5; return both paths.

    Args:
        path: of the file, ending in .xdmf.
        points: positions (n, 3), m.
        cells: numbers of the points of lines or triangles, (m, 2 or 3).
        frames: (time in s, name ↦ values (n,) or (n, 3)), the same names at all times.

    Raises:
        OutputError: one cannot be written.
    """
    heavy = path.with_suffix(".h5")
    root = ET.Element("Xdmf", Version="3.0")
    series = ET.SubElement(ET.SubElement(root, "Domain"), "Grid", Name=path.stem, GridType="Collection")
    series.set("CollectionType", "Temporal")
    try:
        with h5py.File(heavy, "w") as file:
            file["points"], file["cells"] = points, cells
            for number, (t, fields) in enumerate(frames):
                grid = ET.SubElement(series, "Grid", Name=path.stem, GridType="Uniform")
                ET.SubElement(grid, "Time", Value=repr(float(t)))
                kind = {"TopologyType": CELLS[cells.shape[1]], "NodesPerElement": str(cells.shape[1])}
                topology = ET.SubElement(grid, "Topology", kind, NumberOfElements=str(len(cells)))
                _refer(topology, heavy.name, "cells", cells)
                _refer(ET.SubElement(grid, "Geometry", GeometryType="XYZ"), heavy.name, "points", points)
                for name, values in fields.items():
                    file[f"{name}/{number}"] = values
                    what = "Vector" if values.ndim > 1 else "Scalar"
                    attribute = ET.SubElement(grid, "Attribute", Name=name, AttributeType=what, Center="Node")
                    _refer(attribute, heavy.name, f"{name}/{number}", values)
        ET.indent(root)
        ET.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)
    except OSError as error:
        raise OutputError(path, str(error).splitlines()[0]) from None
    return [path, heavy]


def _refer(parent: ET.Element, file: str, name: str, values: npt.NDArray[np.generic]) -> None:
    """Say where in the HDF5 file the values of an element are."""
    kind = "Int" if values.dtype.kind == "i" else "Float"
    shape = " ".join(map(str, values.shape))
    item = ET.SubElement(parent, "DataItem", Dimensions=shape, NumberType=kind, Precision="8", Format="HDF")
    item.text = f"{file}:/{name}"


def chain(points: int) -> npt.NDArray[np.int64]:
    """Return the lines between points that follow each other, (points − 1, 2)."""
    return np.column_stack([np.arange(points - 1), np.arange(1, points)])
