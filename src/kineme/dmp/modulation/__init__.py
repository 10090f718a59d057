"""New movements out of learned ones: one after another, one turning into another."""
