"""Policy improvement: a primitive that costs less, found by trying variants of it in batches."""
