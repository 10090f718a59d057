"""Arrays by name: NPZ, JSON, MATLAB."""
