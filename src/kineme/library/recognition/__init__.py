"""Recognition with the movements of a library."""
