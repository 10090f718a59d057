"""An arm that follows a movement under live control, step by step."""
