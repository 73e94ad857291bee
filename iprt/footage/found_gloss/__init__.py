"""Gloss that nobody declared: `search` looks for it, by the `evidence` in frames."""
