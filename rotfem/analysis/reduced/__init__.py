"""Linear theories in a basis of few shapes: their histories at a small part of the cost of a march."""
