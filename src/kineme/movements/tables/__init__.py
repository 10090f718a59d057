"""Tables of samples: which column is time, which are coordinates, and which tell movements apart."""
