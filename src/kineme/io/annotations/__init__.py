"""What happens when in a recording, as records, in files that other programs read."""
