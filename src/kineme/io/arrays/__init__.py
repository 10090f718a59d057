"""Files of named arrays: NPZ, JSON, MATLAB, HDF5."""
