"""How alike movements are: representations, description, widths, averaged kernel, alignment, bounds."""
