"""A spring-damper end held by its top, standing in for a pipe."""
