"""Tables of samples: text and Parquet, and what their columns mean."""
