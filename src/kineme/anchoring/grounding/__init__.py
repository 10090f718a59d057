"""What a symbol means: prototype, parameters, conceptual space, and back to a movement."""
