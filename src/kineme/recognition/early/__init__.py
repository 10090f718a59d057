"""Early recognition: movements of which only the beginning is given."""
