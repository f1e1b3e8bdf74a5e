"""Units of the stability cases, each a package that `master.fmi.build` packs into an FMU."""
