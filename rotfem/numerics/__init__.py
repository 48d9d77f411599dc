"""Compiled forms, linear solvers, Newton's method, eigenproblems; no physics."""

import petsc4py

petsc4py.init(["rotfem", "-skip_petscrc"])  # a .petscrc of the current folder could name libraries to load
