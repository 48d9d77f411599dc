"""How far two answers are apart, and what follows: errors, refinement to an accuracy, effects, cost."""
