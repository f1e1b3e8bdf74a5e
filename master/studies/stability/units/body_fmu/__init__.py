"""A rigid body on springs, shaken: what a vessel is to the coupling."""
