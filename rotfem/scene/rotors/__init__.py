"""Rotor files of other programs."""
