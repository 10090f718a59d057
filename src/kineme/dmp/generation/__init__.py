"""Generate a new movement from a recording or a saved primitive."""
