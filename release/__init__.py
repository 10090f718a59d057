"""Build what is published and check it as a stranger would get it: ``make package``."""
