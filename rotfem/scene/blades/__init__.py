"""Blade files of other programs, each format in a module of its own, as keys of a spatial beam."""
