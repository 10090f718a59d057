"""What the columns of a recording are: positions, angles, orientations, discrete values."""
