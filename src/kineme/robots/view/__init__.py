"""A movement of an arm as one HTML page that needs no other file, no server and no network; and as a picture."""
