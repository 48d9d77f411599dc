"""Whether a structure fits into memory, before its mesh is made."""

from __future__ import annotations

import os
from pathlib import Path

from mpi4py import MPI

from rotfem.errors import InputError

#: Environment variable with the memory that may be used, in GB, where it is not what the machine has.
VARIABLE = "ROTFEM_MEMORY"


def check_memory(key: str, value: object, nodes: float, components: int, dimension: int, comm: MPI.Comm) -> None:
    """Refuse a mesh whose matrices cannot be held.

    Args:
        key: what asks for so many elements.
        value: what is given there.
        nodes: nodes of the unknowns there will be.
        components: unknowns of a node.
        dimension: of the mesh.
        comm: communicator that shares it; on every process the same is raised.

    Raises:
        InputError: says how much would be needed, and how much there is.
    """
    unknowns = float(nodes) * components
    if unknowns < 1e5:  # nothing is asked of the system for what fits anywhere
        return
    # Bytes per unknown, component and dimension of the mesh: a linear history of a plate took 13.6 kB per unknown,
    # modes of 10⁵ to 10⁶ unknowns 11 kB, and planar beams of 4·10⁴ elements less than this (degrees 1 and 3: 3 kB).
    # Modes of plates on two processes together took 29 kB per unknown.
    needed = 1400 * (2.2 if comm.size > 1 else 1.0) * components * dimension * unknowns
    there = comm.allreduce(memory(), MPI.MIN) * len(set(comm.allgather(MPI.Get_processor_name())))
    if needed > there:
        raise InputError(
            key,
            value,
            f"makes {unknowns:.3g} unknowns, which need about {needed / 1e9:.3g} GB; there are {there / 1e9:.3g} GB: "
            f"take fewer elements or more machines, or set {VARIABLE} in the environment to the GB that may be used",
        )


def memory() -> float:
    """Return the bytes that this machine lets a program have, or that the user says it may have.

    Raises:
        InputError: what the user says is no number.
    """
    given = os.environ.get(VARIABLE, "")
    if given:
        try:
            return 1e9 * float(given)
        except ValueError:
            raise InputError(VARIABLE, given, "must be a number of GB") from None
    machine = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    try:
        return min(machine, float(Path("/sys/fs/cgroup/memory.max").read_text()))
    except (OSError, ValueError):  # no such group, or one without a bound
        return machine
