"""Arms that come with kineme, and arms from any URDF file."""
