"""Pictures of proposals and symbols."""
