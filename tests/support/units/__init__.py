"""Two tiny units with the port conventions of pipe and vessel, to test adapter, master and ledger without physics."""
