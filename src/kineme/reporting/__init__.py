"""Results, shown and written: text, tables, figures, HTML pages, whole files."""
