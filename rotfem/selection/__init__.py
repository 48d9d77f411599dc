"""What a scene calls for: a coarse model, estimates of what is left out, the choice of model, resolution."""
