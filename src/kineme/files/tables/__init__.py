"""Tables of samples, text and Parquet, and the roles of their columns."""
