"""Feature vectors of movements, as scikit-learn transformers."""
