"""Structures: what is meshed, which spaces hold it, what carries mass and strain."""
