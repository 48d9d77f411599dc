"""Meshes: of a beam's axis, of a rectangle, from a file; and what they are checked for."""
