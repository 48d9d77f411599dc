"""Run, modes, campbell, explain and cost: a scene in, results out; and the command line."""
