"""The action library: movements, their primitives and features, and the symbols that name them, in one database."""
