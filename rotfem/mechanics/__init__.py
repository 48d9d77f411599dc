"""The words of the physics: bodies, strains, effects, theories, motion and loads; together a problem."""
