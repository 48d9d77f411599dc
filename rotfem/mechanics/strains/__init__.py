"""Strain measures of the theories, one module an order, one function a structure type (see `mechanics.theories`)."""
