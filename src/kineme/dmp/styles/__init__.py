"""Many demonstrations of one movement: their average with its spread, and the styles in which they differ."""
