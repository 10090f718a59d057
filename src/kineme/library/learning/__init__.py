"""Store movements and files in the database."""
