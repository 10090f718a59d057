"""Files: read recordings, write movements, and save learned models. No pickle; writes are atomic."""
