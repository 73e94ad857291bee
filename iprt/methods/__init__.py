"""Relighting methods, one package each."""
