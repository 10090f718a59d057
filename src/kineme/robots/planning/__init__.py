"""From a movement to a checked trajectory of the joints of an arm."""
