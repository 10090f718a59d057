"""Tables of samples in text and Parquet files."""
