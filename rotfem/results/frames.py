"""Results as pandas tables and xarray datasets. Neither package is needed by anything else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rotfem.results.columns import described

if TYPE_CHECKING:
    import pandas
    import xarray

#: Dimensions of a variable and its values.
Variable = tuple[tuple[str, ...], npt.NDArray[Any]]


def optional(name: str) -> Any:
    """Return a package that rotfem can do without."""
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        missing = error.name or name
        raise ImportError(f"to_{name}() needs {missing}, which is not installed: pip install {missing}") from error


def frame(columns: Mapping[str, Any], index: str | list[str]) -> pandas.DataFrame:
    """Return named columns as a table indexed by one or several of them."""
    return optional("pandas").DataFrame(dict(columns)).set_index(index)


def frame_of_rows(rows: Sequence[Mapping[str, Any]], index: str | list[str] | None = None) -> pandas.DataFrame:
    """Return rows of named values as a table; what a row does not have is NaN."""
    table = optional("pandas").DataFrame(list(rows))
    return table if index is None or table.empty else table.set_index(index)


def dataset(
    variables: Mapping[str, Variable], coordinates: Mapping[str, Variable], attributes: Mapping[str, Any]
) -> xarray.Dataset:
    """Return variables over coordinates, each with its `long_name` and `units` as far as they are known."""
    xarray = optional("xarray")

    def array(name: str, variable: Variable) -> Any:
        what, unit = described(name)
        known = {"long_name": what, "units": unit} if unit else {}
        return xarray.Variable(*variable, attrs=known)

    return xarray.Dataset(
        {name: array(name, variable) for name, variable in variables.items()},
        {name: array(name, variable) for name, variable in coordinates.items()},
        dict(attributes),
    )


def column_of_rows(rows: Sequence[Mapping[str, Any]], name: str) -> npt.NDArray[Any]:
    """Return the values of one name over rows: truth values, text, or numbers; "" or NaN stand for what is absent."""
    values = [row.get(name) for row in rows]
    there = [value for value in values if value is not None]
    if there and all(isinstance(value, bool | np.bool_) for value in values):
        return np.array(values, dtype=bool)
    if any(isinstance(value, str) for value in there):
        return np.array(["" if value is None else str(value) for value in values], dtype=str)
    if all(isinstance(value, int) for value in values):
        return np.array(values, dtype=np.int64)
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


def nodes_of(columns: Mapping[str, npt.NDArray[Any]], triangles: Any) -> dict[str, Variable]:
    """Return where the nodes of columns are and, of a plate, the triangles between them."""
    out: dict[str, Variable] = {name: (("node",), columns[name]) for name in ("x", "y") if name in columns}
    return out if triangles is None else {**out, "triangles": (("triangle", "corner"), np.asarray(triangles))}
