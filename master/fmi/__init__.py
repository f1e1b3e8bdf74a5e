"""FMI side of the units: parameter schema, PythonFMU adapter, FMU building."""
