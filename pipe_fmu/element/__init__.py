"""The two-node element: strains, their variations, assembly, ends. Eqs. (11)-(24), (33)."""
