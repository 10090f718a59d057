"""Recognizers side by side: protocols, methods, report."""
