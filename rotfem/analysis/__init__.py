"""What is done with equations: equilibrium, steps in time, modes, branches, reduced bases, sensitivity, state space."""
