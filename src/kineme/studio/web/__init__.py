"""Files of the pages of the server."""
