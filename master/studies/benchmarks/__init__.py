"""Speed against error, and cost against size."""
