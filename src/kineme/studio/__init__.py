"""The studio: an action library in the browser, from a server or as one page that needs none."""
