"""The columns of a recording as positions, angles, orientations and discrete values."""
