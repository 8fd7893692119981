"""The two solvers of a scene as FMI 2.0 co-simulation FMUs: adapter, the two slaves and the builder. No physics."""
