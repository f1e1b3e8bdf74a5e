"""A rigid body of small motion, standing in for a vessel."""
