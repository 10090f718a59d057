"""From a recording or a saved primitive to a new movement in a file."""
