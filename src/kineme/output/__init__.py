"""How results are shown: text, tables, figures, pages; one look for all."""
