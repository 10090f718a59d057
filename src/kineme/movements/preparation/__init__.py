"""Steps that prepare movements: trim, smooth, resample, perturb."""
