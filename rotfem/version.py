"""The version, in one place, and those of what the program computes with."""

from __future__ import annotations

import platform
from functools import cache

__version__ = "0.8.0"


@cache
def versions() -> dict[str, str]:
    """Return the versions of the program and of what it computes with."""
    from importlib import metadata  # a sixth of what `import rotfem` takes

    out = {"rotfem": __version__, "python": platform.python_version()}
    for name in ("fenics-dolfinx", "fenics-ufl", "petsc4py", "slepc4py", "numpy", "scipy"):
        try:
            out[name.removeprefix("fenics-")] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return out
