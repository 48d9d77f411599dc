"""How good an answer is, and how a better one is found: companions, distances, refinement."""
