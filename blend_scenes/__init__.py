"""Scene descriptions, one TOML each; a package so that they are installed with the core."""
