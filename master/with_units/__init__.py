"""Code that works with the packages of the two units themselves, not with FMUs."""
