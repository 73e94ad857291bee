"""Detection of undeclared glossy surfaces: `search` tests planes by the `evidence` in frames."""
