"""Schemes that couple two ends of a power bond, the bond itself, and the ledger that checks it."""
