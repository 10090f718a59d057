"""Files: recordings in, movements out, and a container for learned things. No pickle, atomic writes."""
