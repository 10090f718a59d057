"""From similarities to clusters, and how many there are."""
