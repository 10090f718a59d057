"""kineme: learn movements as Dynamical Movement Primitives, recognise them, move again."""

__version__ = "0.1.0"
