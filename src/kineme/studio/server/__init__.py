"""The HTTP interface of an action library, and its safety."""
