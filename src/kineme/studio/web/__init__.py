"""What the pages of the server are made of."""
