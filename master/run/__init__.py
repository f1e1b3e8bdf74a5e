"""A run: units opened, stepped, recorded."""
