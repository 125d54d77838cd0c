"""Scenes: TOML files read and checked, without any mechanics."""
