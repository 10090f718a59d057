"""How results are shown and written: text, tables, figures, HTML pages, whole files."""
