"""Compiled forms, linear solvers, Newton's method, eigenproblems; no physics."""
