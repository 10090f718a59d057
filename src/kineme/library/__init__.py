"""The action library: movements, their primitives and features, and the symbols they stand for, in one database."""
